"""An autopilot's own take-off, which a position below the vehicle would end on the ground.

The mission's set-points begin there, while the vehicle is on its way up already. So they are kept
back until they are above it, for five seconds at most; then it is high enough to be commanded down.
"""

from __future__ import annotations

from collections.abc import Callable

from kybflow.geometry import ZERO
from kybflow.signals import NS, Command, CommandKind, Time

LONGEST: Time = 5 * NS

LOW = 0.3
"""Metres."""


class Lifting:
    """hold: what makes it hold still where it is, None where that is not known."""

    def __init__(self, hold: Callable[[], Command | None]) -> None:
        self._hold = hold
        self._until: Time | None = None
        self._floor: float | None = None

    @property
    def height(self) -> float | None:
        """Where it is, metres up, by its own account."""
        holding = self._hold()
        position = None if holding is None else _position(holding)
        return None if position is None else position[2]

    @property
    def is_low(self) -> bool:
        """Whether it is about where it stood last, and so may be landing there at this moment."""
        height = self.height
        return height is not None and self._floor is not None and height - self._floor < LOW

    def stand(self) -> None:
        """It is not armed, and stands."""
        height = self.height
        self._floor = self._floor if height is None else height

    def begin(self, now: Time) -> None:
        """It takes off."""
        self._until = now + LONGEST

    def end(self) -> None:
        self._until = None

    def keeps_back(self, command: Command, now: Time) -> bool:
        """Whether a command must wait for the vehicle to lift."""
        if self._until is None:
            return False
        wanted, height = _position(command), self.height
        if wanted is None or height is None or wanted[2] >= height or now >= self._until:
            self._until = None
        return self._until is not None


def raised(command: Command, height: float) -> Command:
    """A command of position so many metres higher, at rest; others as they are."""
    position = _position(command)
    if position is None or command.setpoint is None:
        return command
    x, y, z = position
    higher = command.setpoint._replace(
        position=(x, y, z + height), velocity=ZERO, acceleration=ZERO, jerk=ZERO
    )
    return command._replace(setpoint=higher)


def _position(command: Command) -> tuple[float, float, float] | None:
    is_place = command.kind is CommandKind.POSITION and command.setpoint is not None
    return command.setpoint.position if is_place and command.setpoint is not None else None
