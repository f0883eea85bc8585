"""Taking off, following, landing, and the emergency of one drone.

REF's bit 9 is a level: it says for as long as it is set that the drone is to fly. Bit 8 is a
switch: as it is set, the emergency is toggled; it is kept set until the drone says so, and for no
longer than a second, so that a lost answer doesn't toggle it back.
"""

from __future__ import annotations

from enum import Enum

from kybflow.core.errors import Refused
from kybflow.core.signals import NS, Command, CommandKind, Time
from kybflow.drivers.ardrone.control.moves import Limits, move_of
from kybflow.drivers.ardrone.protocol.at import HOVER
from kybflow.drivers.ardrone.protocol.navdata.state import Phase, in_words
from kybflow.drivers.ardrone.telemetry.status import DroneStatus
from kybflow.drivers.ardrone.transport.stream import CommandStream
from kybflow.parts import Override

TOGGLES: Time = NS
RESTS: Time = NS // 4
"""How long the emergency's switch is not set between two attempts."""


class Goal(Enum):
    """What the drone is to do."""

    REST = "rest"
    TAKE_OFF = "take off"
    FOLLOW = "follow"
    LAND = "land"
    STOP = "stop"
    RESET = "reset"


class FlightControl:
    """Decides what is sent to one drone. `override`: why it doesn't follow. patience: seconds that
    its take-off may last."""

    def __init__(
        self, status: DroneStatus, stream: CommandStream, limits: Limits, patience: float
    ) -> None:
        self._status, self._stream, self._limits = status, stream, limits
        self._patience = round(patience * NS)
        self._goal, self._since = Goal.REST, 0
        self._toggled: Time | None = None
        self._performs_until: Time = 0
        self.override: Override | None = None
        self.rest(0)

    def rest(self, now: Time) -> None:
        """Stay on the ground, and end the flight that was."""
        self._change(Goal.REST, now)
        self._stream.hold(False)

    def arm(self, now: Time) -> bool:
        """Take off; whether it follows moves now. Raises Refused."""
        status = self._status
        if self._goal not in (Goal.TAKE_OFF, Goal.FOLLOW):
            self._change(Goal.TAKE_OFF, now)
        if status.is_in_emergency:
            self.rest(now)
            raise Refused(f"the drone won't take off: {'; '.join(in_words(status.state))}")
        if status.follows:
            self._change(Goal.FOLLOW, now)
            return True
        if now - self._since > self._patience:
            seconds, where = self._patience // NS, status.phase.name.lower()
            self.rest(now)
            words = "; ".join(in_words(status.state)) or f"it is `{where}`"
            raise Refused(f"the drone has not taken off within {seconds} s: {words}")
        self._stream.hold(True, HOVER)
        return False

    def send(self, command: Command, now: Time) -> None:
        """Follow a command; one that is not armed lands, and so does one of another kind, as of a
        blind landing: the drone knows its height."""
        if not command.armed:
            self._rest_or_stop(now)
        elif command.kind is not CommandKind.TILT_CLIMB:
            self.land(now)
        elif self.override is None:
            self._change(Goal.FOLLOW, now)
            move = move_of(command, self._limits, by_compass=self._stream.bearing is not None)
            self._stream.hold(True, move)

    def let_perform(self, until: Time) -> None:
        """Take what it does until then, beside its commands, for an act. Raises Refused."""
        if self._goal is Goal.FOLLOW and self._status.phase is Phase.LOOPING:
            raise Refused("it still performs")
        if self._goal is not Goal.FOLLOW or not self._status.follows:
            raise Refused("it doesn't fly")
        self._performs_until = until

    def land(self, now: Time) -> bool:
        """Land by itself; whether it stands."""
        self._change(Goal.LAND, now)
        self._stream.hold(False)
        return self._status.stands

    def cut(self, now: Time) -> None:
        """Stop the rotors, wherever it is."""
        self._change(Goal.STOP, now)
        self._switch(now)

    def reset_emergency(self, now: Time) -> None:
        """End the emergency of a drone on the ground; called once a tick until it has ended. Until
        then `wait` does not take the switch back, which would toggle it again."""
        self._change(Goal.RESET, now)
        self._switch(now)

    def wait(self, now: Time) -> None:
        """Stay on the ground before a flight; called once a tick."""
        if self._goal is not Goal.RESET or not self._status.is_in_emergency:
            self.rest(now)

    def watch(self, now: Time) -> None:
        """Notice that it doesn't follow any more; it is not flown again before it has landed."""
        if self._goal is not Goal.FOLLOW:
            self.override = None
            return
        status = self._status
        plays = status.phase is Phase.LOOPING and now < self._performs_until
        if self.override is not None or status.follows or status.phase is Phase.TAKING_OFF or plays:
            return
        words = "; ".join(in_words(status.state)) or "by itself"
        landing = status.phase is Phase.LANDING or not status.is_in_emergency
        doing = "it lands" if landing else "its rotors have stopped"
        self.override = Override(f"{doing}: {words}", lands=True)
        self._stream.hold(False)

    def _rest_or_stop(self, now: Time) -> None:
        if self._goal is Goal.STOP and not self._status.is_in_emergency:
            self._switch(now)
        else:
            self.rest(now)

    def _switch(self, now: Time) -> None:
        """Set the emergency's switch for a while, then not, then again."""
        if self._toggled is None or now - self._toggled > TOGGLES + RESTS:
            self._toggled = now
        self._stream.hold(False, emergency=now - self._toggled <= TOGGLES)

    def _change(self, goal: Goal, now: Time) -> None:
        if goal is not self._goal:
            self._goal, self._since, self._toggled, self.override = goal, now, None, None
