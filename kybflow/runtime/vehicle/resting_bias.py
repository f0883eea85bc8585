"""What the accelerometer feels along body z while the vehicle stands with its rotors at rest:
gravity and its own error (and a little of the floor's slope), which a descent without a position
must not take for motion."""

from __future__ import annotations

from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import Imu

LONG = 0.1
"""Seconds at rest from which it can be told, by then within a few cm/s^2."""
MOST_ERROR = 1.5
"""m/s^2; what is further from gravity is believed no accelerometer's error."""


class RestingBias:
    """rotors_turn: whether the vehicle was sent thrust last. Each time its rotors come to
    rest, what was felt before is forgotten."""

    __slots__ = ("_felt", "_time", "rotors_turn")

    def __init__(self) -> None:
        self.rotors_turn = False
        self._felt = self._time = 0.0

    def turn(self, rotors_turn: bool) -> None:
        """Note that the rotors begin or cease to turn."""
        if not rotors_turn:
            self._felt = self._time = 0.0
        self.rotors_turn = rotors_turn

    def feel(self, imu: Imu) -> None:
        """Add a sample that was measured at rest."""
        self._felt += imu.dt * imu.specific_force[2]
        self._time += imu.dt

    @property
    def is_known(self) -> bool:
        """Whether the vehicle has rested for long enough."""
        return self._time >= LONG

    @property
    def lift(self) -> float:
        """The specific force along body z at rest, m/s^2; gravity where that is not known."""
        if not self.is_known:
            return GRAVITY
        lift = self._felt / self._time
        return lift if abs(lift - GRAVITY) <= MOST_ERROR else GRAVITY
