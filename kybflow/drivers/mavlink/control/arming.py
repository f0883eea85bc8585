"""Arming and disarming.

Arming waits for these conditions in order, checking all of them again in every tick: setpoints are
being sent (if the autopilot requires them before the mode), the autopilot is in the mode in which
it follows setpoints, it reports itself ready, its rotors are armed, and it has lifted off, by its
own take-off or by setpoints above the ground. A condition that is lost again is requested again
until the arming timeout.

An autopilot reports its readiness only for its current mode; therefore the preflight also puts a
disarmed vehicle into the mode in which it will fly (`PreflightMode`)."""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Command, Time
from kybflow.drivers.mavlink.control.requests import CommandRequests, Modes, Retries
from kybflow.drivers.mavlink.control.setpoints import SetpointStream
from kybflow.drivers.mavlink.firmware import FirmwareProfile
from kybflow.drivers.mavlink.protocol.framing import mavlink
from kybflow.drivers.mavlink.telemetry.received_status import LandedState, ReceivedStatus

ARM_DISARM, TAKEOFF = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF
FORCE = 21196.0
"""The parameter with which COMPONENT_ARM_DISARM also stops the rotors in the air."""
LEAD_S = 1.0
"""Seconds for which setpoints are sent before the mode is requested."""
UNREADY_SHARE = 0.5
"""The fraction of the timeout after which arming is requested even if the autopilot reports itself
unready: its refusal then states the reason."""
LIFTED_BY = 0.15
"""Height above the ground, metres, from which the vehicle counts as lifted off, if the height is
known."""
DISARM_BY_LANDING_NS: Time = NS
"""How long disarming on the ground may take before the vehicle is put into its own land mode."""
IDLE_TIME_NS: Time = 2 * NS
"""How long a vehicle whose land mode would do harm is commanded to idle after its landing. PX4 and
ArduPilot detect a landing within a second."""
LANDED_STATE_TIMEOUT_NS: Time = 5 * NS
"""The time after which disarming is requested even if the autopilot doesn't report that it has
landed."""
REFUSAL_DELAY_NS: Time = 10 * NS
"""The time after which refusals to disarm are reported; an autopilot may detect its landing
late."""


class Arming:
    """One attempt to arm. timeout: seconds until the attempt fails."""

    def __init__(
        self, profile: FirmwareProfile, status: ReceivedStatus, requests: CommandRequests,
        modes: Modes, timeout: float, now: Time,
    ) -> None:  # fmt: skip
        self._profile, self._status, self._modes = profile, status, modes
        self._begun, self._timeout = now, timeout
        self._arm = Retries(requests, ARM_DISARM, (1.0,))
        climb = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, profile.takeoff_height)
        self._lift = Retries(requests, TAKEOFF, climb)
        self._floor: float | None = None
        modes.want("offboard")
        if modes.has_left:
            modes.again()

    def step(self, stream: SetpointStream, height: float | None, rises: bool, now: Time) -> bool:
        """Continue the attempt; return whether the vehicle is armed and follows setpoints.

        height: the vehicle's own height, metres, None while unknown.
        rises: whether the raised setpoints lift the vehicle.
        Raises Refused after the timeout, with the autopilot's texts."""
        waits = self._waits(stream, height, rises, now)
        if not waits or now - self._begun <= self._timeout * NS:
            return not waits
        texts = [part for part in self._status.words(self._begun).split("; ") if part]
        if not self._status.armed and self._status.unhealthy:
            texts.append(self._status.unhealthy)
        reason = "; ".join([waits, *(part for part in texts if part not in waits)])
        raise Refused(f"{self._profile.name} won't arm: {reason}")

    def drop(self) -> None:
        """Withdraw the requests."""
        self._arm.drop()
        self._lift.drop()

    def _waits(self, stream: SetpointStream, height: float | None, rises: bool, now: Time) -> str:
        """Return what arming is waiting for; empty when it is done."""
        if self._profile.streams_first and stream.flows(now) < LEAD_S:
            return "it gets no setpoints"
        if not self._modes.step(now):
            return self._modes.trouble
        if not self._status.armed:
            self._floor = height
            unready = self._profile.ready(self._status)
            if unready and now - self._begun < UNREADY_SHARE * self._timeout * NS:
                return unready
            self._arm.step(now)
            reason = self._arm.refusal or unready
            return reason or "it was asked to arm, but its heartbeat reports that it is not armed"
        if self._profile.climbs:
            return self._to_lift(height, now)
        if not rises or height is None or self._floor is None or height - self._floor >= LIFTED_BY:
            return ""
        return "armed, it has not left the ground"

    def _to_lift(self, height: float | None, now: Time) -> str:
        landed = self._status.landed
        if landed in (LandedState.AIR, LandedState.LANDING):
            return ""
        if landed is LandedState.TAKING_OFF:
            enough = min(LIFTED_BY, 0.5 * self._profile.takeoff_height)
            if height is None or self._floor is None or height - self._floor >= enough:
                return ""
        else:
            self._lift.step(now)
        refusal = self._lift.refusal
        return f"it won't take off: {refusal}" if refusal else "armed, it has not left the ground"


class Disarming:
    """Disarms a vehicle by request, never by force. A vehicle that doesn't report that it is on the
    ground, or doesn't disarm there within a second, is put into its own land mode, which detects
    the landing. `is_retrying`: whether it is too early to report a refusal.

    avoids_mode: whether the land mode would do harm on the ground, so that the vehicle is first
    commanded to idle for up to `IDLE_TIME_NS`, in which it detects the landing. That is so in two
    cases. If kybflow landed the vehicle by thrust and had stopped sending it positions, as in a
    wrong frame, its filter may be wrong, and the mode would tilt the vehicle to correct it. If
    kybflow landed a PX4 by accelerations, the mode lifted it by up to 0.2 m, and it came down again
    with up to 0.7 m/s."""

    def __init__(
        self, status: ReceivedStatus, requests: CommandRequests, modes: Modes, avoids_mode: bool
    ) -> None:
        self._status, self._modes, self._avoids_mode = status, modes, avoids_mode
        self._disarm = Retries(requests, ARM_DISARM, (0.0,))
        self._begun: Time | None = None
        self.is_retrying = status.armed

    def drop(self) -> None:
        """Withdraw the requests."""
        self._disarm.drop()

    @property
    def is_under_way(self) -> bool:
        """Whether the vehicle was armed in the last tick."""
        return self._begun is not None

    def idles(self, now: Time) -> bool:
        """Return whether the vehicle must be commanded to idle."""
        since = now if self._begun is None else self._begun
        return self._avoids_mode and self._status.armed and now - since <= IDLE_TIME_NS

    def step(self, now: Time) -> None:
        self.is_retrying = self._status.armed and (
            self._begun is None or now - self._begun <= REFUSAL_DELAY_NS
        )
        if not self._status.armed:
            self._begun = None
            return
        if self._begun is None:
            self._begun = now
        grounded = self._status.landed in (LandedState.GROUND, LandedState.UNKNOWN)
        if grounded or now - self._begun > LANDED_STATE_TIMEOUT_NS:
            self._disarm.step(now)
        is_late = now - self._begun > DISARM_BY_LANDING_NS
        if (is_late or not grounded) and not self.idles(now):
            self._modes.want("land")
        self._modes.step(now)


class MotorStop:
    """Stops the rotors at once, even in the air: sends the request every 0.2 s until the heartbeat
    reports the vehicle disarmed."""

    def __init__(self, status: ReceivedStatus, requests: CommandRequests) -> None:
        self._status = status
        self._cut = Retries(requests, ARM_DISARM, (0.0, FORCE), first=0.2, most=0.2, shown=0.2)

    def step(self, now: Time) -> bool:
        """Request the stop if it is due; return whether the rotors have stopped."""
        if not self._status.armed:
            return True
        self._cut.step(now)
        return False


MODE_RETRY_NS: Time = 2 * NS
"""The time after which a mode that the autopilot has left is requested again."""


class PreflightMode:
    """Requests the mode that follows setpoints during the preflight.

    stream: the setpoint stream, if setpoints must be sent before the mode; otherwise None.
    hold: returns the command that holds the vehicle still, None while its position is unknown.
    follows: requests the mode and returns whether it is in force."""

    def __init__(
        self, modes: Modes, stream: SetpointStream | None, hold: Callable[[], Command | None],
        follows: Callable[[Time], bool],
    ) -> None:  # fmt: skip
        self._modes, self._stream, self._hold, self._follows = modes, stream, hold, follows
        self._left: Time | None = None

    def step(self, now: Time) -> str:
        """Return why the mode is not in force; empty if it is. Called once a tick while
        disarmed."""
        self._modes.want("offboard")
        if self._stream is not None:
            if (holding := self._hold()) is None:
                return "it needs a position first"
            self._stream.feed(holding, now)
        if not self._modes.has_left:
            self._left = None
        elif self._left is None:
            self._left = now
        elif now - self._left > MODE_RETRY_NS:
            self._left = None
            self._modes.again()
        return "" if self._follows(now) else self._modes.trouble
