"""Getting ready to obey, and resting again.

Arming waits, in this order and anew in every tick, for set-points that flow (where the autopilot
wants them before the mode), the mode in which it follows them, its own readiness, armed rotors, and
the lift from the ground, by its own take-off or by set-points above it. So what is lost on the way
is asked for again, until `patience` is over.
"""

from __future__ import annotations

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.control.modes import Modes
from kybflow.drivers.mavlink.control.requests import Requests
from kybflow.drivers.mavlink.control.retries import Insisting
from kybflow.drivers.mavlink.control.stream import Stream
from kybflow.drivers.mavlink.firmware.profile import Profile
from kybflow.drivers.mavlink.telemetry.heard import Heard, Landed

ARM_DISARM, TAKEOFF = 400, 22
FORCED = 21196.0
"""The number that makes COMPONENT_ARM_DISARM stop rotors in the air."""
LEAD = 1.0
"""Seconds that set-points flow before the mode is asked for."""
DOUBT = 0.5
"""The part of the patience after which an autopilot that calls itself unready is asked all the
same: it then says why."""
LIFTED = 0.15
"""Metres above where it stood that count as lifted, where the height is known."""
SOON: Time = NS
"""How long a vehicle that is to rest on the ground may take to disarm; then it lands by its own
mode."""
UNSURE: Time = 5 * NS
"""After this it is asked to disarm though it does not say that it is on the ground."""
PATIENT: Time = 10 * NS
"""How long it may refuse to disarm before that is worth a word: its landing is noticed later than
it is there."""


class Arming:
    """One attempt. `height`: the autopilot's own, metres, None while unknown."""

    def __init__(
        self, profile: Profile, heard: Heard, requests: Requests, modes: Modes, patience: float,
        now: Time,
    ) -> None:  # fmt: skip
        self._profile, self._heard, self._modes = profile, heard, modes
        self._begun, self._patience = now, patience
        self._arm = Insisting(requests, ARM_DISARM, (1.0,))
        self._lift = Insisting(
            requests, TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, profile.takeoff_height)
        )
        self._floor: float | None = None
        modes.want("offboard")
        if modes.has_left:
            modes.again()

    def step(self, stream: Stream, height: float | None, rises: bool, now: Time) -> bool:
        """Whether it is armed and follows. rises: set-points that are raised lift it. Raises
        Refused after its patience, in its words."""
        waits = self._waits(stream, height, rises, now)
        if waits and now - self._begun > self._patience * NS:
            raise Refused(f"{self._profile.name} won't arm: {self._words(waits)}")
        return not waits

    def drop(self) -> None:
        """Ask no more."""
        self._arm.drop()
        self._lift.drop()

    def _waits(self, stream: Stream, height: float | None, rises: bool, now: Time) -> str:
        """What it waits for, in words; empty when it does not wait any more."""
        if self._profile.streams_first and stream.flows(now) < LEAD:
            return "no set-points flow"
        if not self._modes.step(now):
            return self._modes.trouble
        if not self._heard.armed:
            self._floor = height
            return self._to_arm(now)
        if self._profile.climbs:
            return self._to_lift(height, now)
        return self._to_rise(height) if rises else ""

    def _to_arm(self, now: Time) -> str:
        unready = self._profile.ready(self._heard)
        if unready and now - self._begun < DOUBT * self._patience * NS:
            return unready
        self._arm.step(now)
        said = self._arm.refusal or unready
        return said or "it has been asked to, and its heartbeat says that it is not armed"

    def _to_lift(self, height: float | None, now: Time) -> str:
        landed = self._heard.landed
        if landed in (Landed.AIR, Landed.LANDING):
            return ""
        if landed is Landed.TAKING_OFF:
            enough = min(LIFTED, 0.5 * self._profile.takeoff_height)
            if height is None or self._floor is None or height - self._floor >= enough:
                return ""
        else:
            self._lift.step(now)
        refusal = self._lift.refusal
        return f"it won't take off: {refusal}" if refusal else "armed, it has not left the ground"

    def _to_rise(self, height: float | None) -> str:
        if height is None or self._floor is None or height - self._floor >= LIFTED:
            return ""
        return "armed, it has not left the ground"

    def _words(self, waits: str) -> str:
        """`waits`, with what it said itself meanwhile where that is not in it."""
        said = [part for part in self._heard.words(self._begun).split("; ") if part]
        if not self._heard.armed and self._heard.ill:
            said.append(self._heard.ill)
        return "; ".join([waits, *(part for part in said if part not in waits)])


class Resting:
    """A vehicle that is to be disarmed, asked for but never forced. One that does not know that it
    is on the ground, or that does not disarm there within a second, is put into its own land mode,
    which brings it down and notices. `insists`: whether it is too early to say that it won't."""

    def __init__(self, heard: Heard, requests: Requests, modes: Modes) -> None:
        self._heard, self._modes = heard, modes
        self._disarm = Insisting(requests, ARM_DISARM, (0.0,))
        self._begun: Time | None = None
        self.insists = heard.armed

    def drop(self) -> None:
        """Ask no more."""
        self._disarm.drop()

    @property
    def is_under_way(self) -> bool:
        """Whether it was armed when it was looked at last."""
        return self._begun is not None

    def step(self, now: Time) -> None:
        """Once a tick."""
        self.insists = self._heard.armed and (self._begun is None or now - self._begun <= PATIENT)
        if not self._heard.armed:
            self._begun = None
            return
        if self._begun is None:
            self._begun = now
        grounded = self._heard.landed in (Landed.GROUND, Landed.UNKNOWN)
        if grounded or now - self._begun > UNSURE:
            self._disarm.step(now)
        if not grounded or now - self._begun > SOON:
            self._modes.want("land")
        self._modes.step(now)


class Cutting:
    """Rotors that are to stop at once, in the air too: asked every fifth of a second until the
    heartbeat says that they rest."""

    def __init__(self, heard: Heard, requests: Requests) -> None:
        self._heard = heard
        self._cut = Insisting(requests, ARM_DISARM, (0.0, FORCED), first=0.2, most=0.2, shown=0.2)

    def step(self, now: Time) -> bool:
        """Whether they rest."""
        if not self._heard.armed:
            return True
        self._cut.step(now)
        return False
