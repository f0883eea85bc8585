"""Measures the accelerometer's bias along body z while the rotors rest, for a descent without a
position. The measured bias includes the effect of a sloping floor."""

from __future__ import annotations

from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import Imu

LONG = 0.1
"""Seconds at rest after which the bias is known to a few cm/s^2."""
MAX_BIAS = 1.5
"""Largest plausible bias, m/s^2; a larger difference from gravity is ignored."""


class RestingBias:
    """Averages the specific force along body z while the rotors rest.

    The measurement starts anew whenever the rotors come to rest. rotors_turn: whether the last
    command let the rotors turn.
    """

    __slots__ = ("_felt", "_time", "rotors_turn")

    def __init__(self) -> None:
        self.rotors_turn = False
        self._felt = self._time = 0.0

    def turn(self, rotors_turn: bool) -> None:
        """Record that the rotors start or stop turning."""
        if not rotors_turn:
            self._felt = self._time = 0.0
        self.rotors_turn = rotors_turn

    def add(self, imu: Imu) -> None:
        """Add a sample that was measured at rest."""
        self._felt += imu.dt * imu.specific_force[2]
        self._time += imu.dt

    @property
    def is_known(self) -> bool:
        """Whether the vehicle has rested for long enough."""
        return self._time >= LONG

    @property
    def specific_force(self) -> float:
        """The specific force along body z at rest, m/s^2; gravity if it is unknown or
        implausible."""
        if not self.is_known:
            return GRAVITY
        lift = self._felt / self._time
        return lift if abs(lift - GRAVITY) <= MAX_BIAS else GRAVITY
