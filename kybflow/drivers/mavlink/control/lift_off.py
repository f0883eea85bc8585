"""The way up from the ground.

An autopilot's own take-off ends on the ground where it is commanded down. The mission's setpoints
begin there, while the vehicle is on its way up already. So positions are kept back until they are
above it, and accelerations until they are not downward, for five seconds at most; then it is high
enough to be commanded down.

One that takes off by setpoints is given others until it has lifted: a position above, or a push
up that grows, since what it believes to hover with may be too little. What the command pushes
sideways goes along, against the wind.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Command, CommandKind, Time

LONGEST: Time = 5 * NS

LOW = 0.3
"""Metres."""
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
        """Whether it is near the height at which it last stood, and so may be landing right now."""
        height = self.height
        return height is not None and self._floor is not None and height - self._floor < LOW

    def stand(self, now: Time) -> None:
        """Note that it stands disarmed; called once a tick while it does."""
        self._stood = now
        height = self.height
        self._floor = self._floor if height is None else height

    def armed_for(self, now: Time) -> float:
        """For how many seconds it has been armed."""
        return (now - self._stood) / NS

    def begin(self, now: Time) -> None:
        """Begin to hold commands back: the vehicle takes off."""
        self._until = now + LONGEST

    def end(self) -> None:
        self._until = None

    def keeps_back(self, command: Command, now: Time) -> bool:
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
        wanted, height = _position(command), self.height
        return wanted is not None and height is not None and wanted[2] < height


def raised(command: Command, height: float, seconds: float) -> Command:
    """The command that lifts the vehicle: a position command becomes a rest `height` metres above
    it, an acceleration command a push up that grows with the seconds and leaves the rest. Others
    stay as they are."""
    setpoint, position = command.setpoint, _position(command)
    if setpoint is None:
        return command
    if position is not None:
        x, y, z = position
        place = (x, y, z + height)
        higher = setpoint._replace(position=place, velocity=ZERO, acceleration=ZERO, jerk=ZERO)
        return command._replace(setpoint=higher)
    if (wanted := _acceleration(command)) is not None:
        push = (wanted[0], wanted[1], min(PUSH + GROWTH * seconds, HARDEST))
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
