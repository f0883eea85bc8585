"""A moving ball, and how a simulated one moves. Metres, world frame (ENU)."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, distance, scale, sub
from kybflow.core.params import key, record
from kybflow.core.units import Length, Path, Speed

_ACCELERATION = 1.5
"""Acceleration after and before each stop, m/s^2."""


@record("moving_sphere", is_whole=False)
class MovingSphere:
    """A ball that moves along a path and back.

    It moves along straight lines through the points `along` and stops at each.
    """

    along: Path = key("Its path through these points, where it is simulated.")
    radius: Length = key("Its radius.", above=0.0)
    speed: Speed = key("Its greatest speed.", above=0.0, at_most=2.0)
    body: str | None = key("Its name in motion capture, the obstacle's by default.", default=None)

    def at(self, seconds: float) -> Vec3:
        """Return the position of the centre this long after the start."""
        whole = sum(leg.duration for leg in self._legs)
        left = seconds % whole if whole > 0.0 else 0.0
        for leg in self._legs:
            if left < leg.duration:
                return leg.at(left)
            left -= leg.duration
        return self.along[0]

    @cached_property
    def _legs(self) -> tuple[_Leg, ...]:
        there = [_Leg.between(a, b, self.speed) for a, b in pairwise(self.along)]
        return (*there, *(leg.turned() for leg in reversed(there)))


class _Leg(NamedTuple):
    """A straight line from rest to rest. The speed rises to `speed` within `ramp` seconds, and
    falls again within as many."""

    start: Vec3
    end: Vec3
    speed: float
    ramp: float
    duration: float

    @classmethod
    def between(cls, start: Vec3, end: Vec3, speed: float) -> _Leg:
        length = distance(start, end)
        speed = min(speed, sqrt(_ACCELERATION * length))
        ramp = speed / _ACCELERATION
        return cls(start, end, speed, ramp, length / speed + ramp if speed > 0.0 else 0.0)

    def turned(self) -> _Leg:
        return self._replace(start=self.end, end=self.start)

    def at(self, time: float) -> Vec3:
        left = self.duration - time
        if time < self.ramp:
            gone = 0.5 * _ACCELERATION * time * time
        elif left < self.ramp:
            gone = self.speed * (self.duration - self.ramp) - 0.5 * _ACCELERATION * left * left
        else:
            gone = self.speed * (time - 0.5 * self.ramp)
        return add(
            self.start, scale(sub(self.end, self.start), gone / distance(self.start, self.end))
        )
