"""Take-off, flight, landing and emergency stop of one drone, and the fractions of AT*PCMD.

Bit 9 of REF is a level: the drone flies while it is set. Bit 8 is a switch: setting it toggles the
emergency state. Bit 8 stays set until the drone reports the change, but no longer than a second, so
that a lost report doesn't toggle the emergency back.

The tilt of a command is split into forward and left relative to the command's heading; the drone
applies both relative to its own heading. With the compass both are relative to the world's x axis
instead. Each value of PCMD is a fraction, -1 to 1, of a configured limit.
"""

from __future__ import annotations

from enum import Enum
from math import asin, atan2

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, body_z, from_heading, heading_of, rotate_back
from kybflow.core.signals import NS, Command, CommandKind, Time
from kybflow.drivers.ardrone.at import HOVER, Move
from kybflow.drivers.ardrone.navdata import Phase, in_words
from kybflow.drivers.ardrone.params import Limits
from kybflow.drivers.ardrone.telemetry import DroneStatus
from kybflow.drivers.ardrone.wire import CommandStream
from kybflow.parts import Override


def move_of(command: Command, limits: Limits, *, by_compass: bool = False) -> Move:
    """Return the move of a TILT_CLIMB command."""
    heading = heading_of(command.attitude) if command.heading is None else command.heading
    heading = 0.0 if by_compass else heading
    x, y, z = rotate_back(from_heading(heading), body_z(command.attitude))
    setpoint = command.setpoint
    climb = (ZERO if setpoint is None else setpoint.velocity or ZERO)[2]
    return Move(
        _fraction(asin(max(-1.0, min(1.0, -y))), limits.tilt),
        _fraction(-atan2(x, z), limits.tilt),
        _fraction(climb, limits.climb),
        _fraction(-command.rates[2], limits.turn),
    )


def _fraction(value: float, most: float) -> float:
    return max(-1.0, min(1.0, value / most))


TOGGLE_TIME: Time = NS
TOGGLE_PAUSE: Time = NS // 4
"""Time for which the emergency switch is clear between two attempts."""


class Goal(Enum):
    REST = "rest"
    TAKE_OFF = "take off"
    FOLLOW = "follow"
    LAND = "land"
    STOP = "stop"
    RESET = "reset"


class FlightControl:
    """Decides which commands to send to one drone. override: why the drone doesn't follow commands;
    None if it does. take_off_time: longest duration of the drone's take-off, seconds."""

    def __init__(
        self, status: DroneStatus, stream: CommandStream, limits: Limits, take_off_time: float
    ) -> None:
        self._status, self._stream, self._limits = status, stream, limits
        self._take_off_time = round(take_off_time * NS)
        self._goal, self._since = Goal.REST, 0
        self._toggled: Time | None = None
        self._performs_until: Time = 0
        self.override: Override | None = None
        self.rest(0)

    def rest(self, now: Time) -> None:
        """Command the drone to stay on the ground, and end the flight."""
        self._change(Goal.REST, now)
        self._stream.hold(False)

    def arm(self, now: Time) -> bool:
        """Command the take-off. Return whether the drone follows moves now. Raises Refused if the
        drone won't take off or takes too long."""
        status = self._status
        if self._goal not in (Goal.TAKE_OFF, Goal.FOLLOW):
            self._change(Goal.TAKE_OFF, now)
        if status.is_in_emergency:
            self.rest(now)
            raise Refused(f"the drone won't take off: {'; '.join(in_words(status.state))}")
        if status.follows:
            self._change(Goal.FOLLOW, now)
            return True
        if now - self._since > self._take_off_time:
            seconds, where = self._take_off_time // NS, status.phase.name.lower()
            self.rest(now)
            words = "; ".join(in_words(status.state)) or f"it is `{where}`"
            raise Refused(f"the drone has not taken off within {seconds} s: {words}")
        self._stream.hold(True, HOVER)
        return False

    def send(self, command: Command, now: Time) -> None:
        """Follow a command. A disarmed command stops the flight. A command of another kind than
        TILT_CLIMB, as sent during a blind landing, lands the drone, which measures its own
        height."""
        if not command.armed:
            if self._goal is Goal.STOP and not self._status.is_in_emergency:
                self._switch(now)
            else:
                self.rest(now)
        elif command.kind is not CommandKind.TILT_CLIMB:
            self.land(now)
        elif self.override is None:
            self._change(Goal.FOLLOW, now)
            move = move_of(command, self._limits, by_compass=self._stream.bearing is not None)
            self._stream.hold(True, move)

    def start_act(self, until: Time) -> None:
        """Accept until `until` that the drone moves by itself, because it performs an action.
        Raises Refused if the drone doesn't fly or still performs another action."""
        if self._goal is Goal.FOLLOW and self._status.phase is Phase.LOOPING:
            raise Refused("it still performs an act")
        if self._goal is not Goal.FOLLOW or not self._status.follows:
            raise Refused("it doesn't fly")
        self._performs_until = until

    def land(self, now: Time) -> bool:
        """Start the drone's own landing; return whether it is on the ground."""
        self._change(Goal.LAND, now)
        self._stream.hold(False)
        return self._status.stands

    def cut(self, now: Time) -> None:
        """Stop the rotors, even in the air."""
        self._change(Goal.STOP, now)
        self._switch(now)

    def reset_emergency(self, now: Time) -> None:
        """End the emergency state of a drone on the ground; called once a tick until it has ended.
        During this time `wait` doesn't clear the switch, which would toggle the emergency again."""
        self._change(Goal.RESET, now)
        self._switch(now)

    def wait(self, now: Time) -> None:
        """Command the drone to stay on the ground before a flight; called once a tick."""
        if self._goal is not Goal.RESET or not self._status.is_in_emergency:
            self.rest(now)

    def watch(self, now: Time) -> None:
        """Set `override` when the drone stops following commands; it stays set until the drone
        has landed."""
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

    def _switch(self, now: Time) -> None:
        """Set the emergency switch for `TOGGLE_TIME`, clear it for `TOGGLE_PAUSE`, and repeat."""
        if self._toggled is None or now - self._toggled > TOGGLE_TIME + TOGGLE_PAUSE:
            self._toggled = now
        self._stream.hold(False, emergency=now - self._toggled <= TOGGLE_TIME)

    def _change(self, goal: Goal, now: Time) -> None:
        if goal is not self._goal:
            self._goal, self._since, self._toggled, self.override = goal, now, None, None
