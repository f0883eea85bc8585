"""Arming, lift-off and disarming.

Arming waits in this order, checked anew in every tick: setpoints that flow (where the autopilot
wants them before the mode), the mode in which it follows setpoints, its readiness, armed rotors,
and the lift-off, by its own take-off or by setpoints above the ground. What gets lost on the way is
requested again until the arming timeout.

An autopilot reports its readiness for its current mode only; so the preflight too puts a disarmed
vehicle into the mode in which it will fly (`PreflightMode`).

An autopilot's own take-off ends on the ground where it is commanded down, and the mission's
setpoints begin there. So `LiftOff` holds positions back until they are above the vehicle, and
accelerations until they are not downward, for five seconds at most.

A vehicle that takes off by setpoints gets `raised` ones until it has lifted off: a position above,
or a push up that grows, since the hover throttle that it believes in may be too low. Sideways it
follows the command, against the wind."""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Command, CommandKind, Time
from kybflow.drivers.mavlink.control.modes import Modes
from kybflow.drivers.mavlink.control.requests import CommandRequests, Retries
from kybflow.drivers.mavlink.control.setpoints import SetpointStream
from kybflow.drivers.mavlink.firmware import FirmwareProfile
from kybflow.drivers.mavlink.protocol.dialect import mavlink
from kybflow.drivers.mavlink.telemetry.received_status import LandedState, ReceivedStatus

ARM_DISARM, TAKEOFF = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF
FORCED = 21196.0
"""The number that makes COMPONENT_ARM_DISARM stop rotors in the air."""
LEAD = 1.0
"""Seconds for which setpoints flow before the mode is requested."""
DOUBT = 0.5
"""The share of the timeout after which an autopilot that reports itself unready is asked to arm all
the same: it then says why it refuses."""
LIFTED = 0.15
"""Metres above the ground that count as lifted off, where the height is known."""
SOON: Time = NS
"""How long disarming on the ground may take; then the vehicle lands by its own mode."""
UNSURE: Time = 5 * NS
"""After this the autopilot is asked to disarm even if it does not report that it has landed."""
REPORTED: Time = 10 * NS
"""When refusals to disarm are reported: an autopilot notices its landing late."""


class Arming:
    """One attempt to arm. timeout: seconds until it is given up."""

    def __init__(
        self, profile: FirmwareProfile, status: ReceivedStatus, requests: CommandRequests,
        modes: Modes, timeout: float, now: Time,
    ) -> None:  # fmt: skip
        self._profile, self._status, self._modes = profile, status, modes
        self._begun, self._timeout = now, timeout
        self._arm = Retries(requests, ARM_DISARM, (1.0,))
        self._lift = Retries(
            requests,
            mavlink.MAV_CMD_NAV_TAKEOFF,
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, profile.takeoff_height),
        )
        self._floor: float | None = None
        modes.want("offboard")
        if modes.has_left:
            modes.again()

    def step(self, stream: SetpointStream, height: float | None, rises: bool, now: Time) -> bool:
        """Returns whether the vehicle is armed and follows. height: its own, metres, None while
        unknown. rises: raised setpoints lift it. Raises Refused after the timeout, with the
        autopilot's texts."""
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
        """What arming waits for; empty when it is done."""
        if self._profile.streams_first and stream.flows(now) < LEAD:
            return "no setpoints are sent to it"
        if not self._modes.step(now):
            return self._modes.trouble
        if not self._status.armed:
            self._floor = height
            return self._to_arm(now)
        if self._profile.climbs:
            return self._to_lift(height, now)
        if not rises or height is None or self._floor is None or height - self._floor >= LIFTED:
            return ""
        return "armed, it has not left the ground"

    def _to_arm(self, now: Time) -> str:
        unready = self._profile.ready(self._status)
        if unready and now - self._begun < DOUBT * self._timeout * NS:
            return unready
        self._arm.step(now)
        reason = self._arm.refusal or unready
        return reason or "it was asked to, and its heartbeat reports that it is not armed"

    def _to_lift(self, height: float | None, now: Time) -> str:
        landed = self._status.landed
        if landed in (LandedState.AIR, LandedState.LANDING):
            return ""
        if landed is LandedState.TAKING_OFF:
            enough = min(LIFTED, 0.5 * self._profile.takeoff_height)
            if height is None or self._floor is None or height - self._floor >= enough:
                return ""
        else:
            self._lift.step(now)
        refusal = self._lift.refusal
        return f"it won't take off: {refusal}" if refusal else "armed, it has not left the ground"


class Disarming:
    """Disarms a vehicle by request, never by force. One that does not know that it is on the
    ground, or does not disarm there within a second, is put into its own land mode, which detects
    the landing. `is_retrying`: whether it is too early to report a refusal."""

    def __init__(self, status: ReceivedStatus, requests: CommandRequests, modes: Modes) -> None:
        self._status, self._modes = status, modes
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

    def step(self, now: Time) -> None:
        self.is_retrying = self._status.armed and (
            self._begun is None or now - self._begun <= REPORTED
        )
        if not self._status.armed:
            self._begun = None
            return
        if self._begun is None:
            self._begun = now
        grounded = self._status.landed in (LandedState.GROUND, LandedState.UNKNOWN)
        if grounded or now - self._begun > UNSURE:
            self._disarm.step(now)
        if not grounded or now - self._begun > SOON:
            self._modes.want("land")
        self._modes.step(now)


class MotorStop:
    """Stops the rotors at once, in the air too: requested every 0.2 s until the heartbeat reports
    the vehicle disarmed."""

    def __init__(self, status: ReceivedStatus, requests: CommandRequests) -> None:
        self._status = status
        self._cut = Retries(
            requests,
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
            (0.0, FORCED),
            first=0.2,
            most=0.2,
            shown=0.2,
        )

    def step(self, now: Time) -> bool:
        """Returns whether the rotors have stopped."""
        if not self._status.armed:
            return True
        self._cut.step(now)
        return False


AGAIN: Time = 2 * NS
"""After this a mode that the autopilot has left is requested again."""


class PreflightMode:
    """Requests the mode that follows setpoints for the preflight. stream: given where setpoints
    must flow before the mode. hold: the command that holds the vehicle still, None while its
    position is unknown. follows: requests the mode and says whether it is in force."""

    def __init__(
        self, modes: Modes, stream: SetpointStream | None, hold: Callable[[], Command | None],
        follows: Callable[[Time], bool],
    ) -> None:  # fmt: skip
        self._modes, self._stream, self._hold, self._follows = modes, stream, hold, follows
        self._left: Time | None = None

    def step(self, now: Time) -> str:
        """Why the mode is not in force, empty when it is; called once a tick while disarmed."""
        self._modes.want("offboard")
        if self._stream is not None:
            if (holding := self._hold()) is None:
                return "it has no position to hold, which it needs first"
            self._stream.feed(holding, now)
        if not self._modes.has_left:
            self._left = None
        elif self._left is None:
            self._left = now
        elif now - self._left > AGAIN:
            self._left = None
            self._modes.again()
        return "" if self._follows(now) else self._modes.trouble


LIFTS: Time = 5 * NS
"""How long downward commands are held back at most."""
LOW = 0.3
"""Metres above the ground within which the vehicle may be landing."""
PUSH, GROWTH, HARDEST = 1.5, 0.5, 4.0
"""A push up: its acceleration at first, m/s^2, its growth per second, and its maximum."""


class LiftOff:
    """The lift-off of one vehicle: holds back downward commands until it is high enough. hold: the
    command that holds the vehicle still where it is, None while its position is unknown."""

    def __init__(self, hold: Callable[[], Command | None]) -> None:
        self._hold = hold
        self._until: Time | None = None
        self._floor: float | None = None
        self._stood: Time = 0

    @property
    def height(self) -> float | None:
        """Its own height, metres; None while unknown."""
        holding = self._hold()
        position = None if holding is None else _position(holding)
        return None if position is None else position[2]

    @property
    def is_low(self) -> bool:
        """Whether the vehicle is near the height at which it last stood, and so may be landing."""
        height = self.height
        return height is not None and self._floor is not None and height - self._floor < LOW

    def stand(self, now: Time) -> None:
        """Note that the vehicle stands disarmed; called once a tick while it does."""
        self._stood = now
        height = self.height
        self._floor = self._floor if height is None else height

    def armed_for(self, now: Time) -> float:
        """For how many seconds it has been armed."""
        return (now - self._stood) / NS

    def begin(self, now: Time) -> None:
        """Begin to hold commands back: the vehicle takes off."""
        self._until = now + LIFTS

    def end(self) -> None:
        self._until = None

    def holds_back(self, command: Command, now: Time) -> bool:
        """Whether a command must wait until the vehicle has lifted off."""
        if self._until is None:
            return False
        if now >= self._until or not self._is_downward(command):
            self._until = None
        return self._until is not None

    def _is_downward(self, command: Command) -> bool:
        push = _acceleration(command)
        if push is not None:
            return push[2] < 0.0
        target, height = _position(command), self.height
        return target is not None and height is not None and target[2] < height


def raised(command: Command, height: float, seconds: float) -> Command:
    """The command that lifts the vehicle: a position command becomes a hover `height` metres above
    it, an acceleration command keeps its horizontal part and gets a push up that grows with the
    seconds. Others are returned unchanged."""
    setpoint, position = command.setpoint, _position(command)
    if setpoint is None:
        return command
    if position is not None:
        x, y, z = position
        place = (x, y, z + height)
        higher = setpoint._replace(position=place, velocity=ZERO, acceleration=ZERO, jerk=ZERO)
        return command._replace(setpoint=higher)
    if (asked := _acceleration(command)) is not None:
        push = (asked[0], asked[1], min(PUSH + GROWTH * seconds, HARDEST))
        return command._replace(setpoint=setpoint._replace(acceleration=push, jerk=ZERO))
    return command


def _position(command: Command) -> Vec3 | None:
    if command.kind is not CommandKind.POSITION or command.setpoint is None:
        return None
    return command.setpoint.position


def _acceleration(command: Command) -> Vec3 | None:
    if command.kind is not CommandKind.ACCELERATION or command.setpoint is None:
        return None
    return command.setpoint.acceleration
