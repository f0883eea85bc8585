"""The air that a vehicle flies in: wind, gusts, and eddies of a room, which push and turn it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import exp, sqrt

from kybflow.core.geometry import Vec3, add
from kybflow.drivers.sim.steps.aboard import Numbers

GUST_TIME = 1.0
"""Seconds."""
EDDY_TIME = 0.5
"""Seconds."""


class Wandering:
    """Numbers that each are an Ornstein-Uhlenbeck process, which forgets within `lasts` seconds.
    deviations: their standard deviations. noise: rows of as many standard normal numbers."""

    def __init__(
        self, deviations: Sequence[float], lasts: float, noise: Iterator[list[float]]
    ) -> None:
        self._deviations, self._lasts, self._noise = deviations, lasts, noise
        self._now: Numbers = (0.0,) * len(deviations)

    def after(self, seconds: float) -> Numbers:
        """The numbers, `seconds` after the last call."""
        keep = exp(-seconds / self._lasts)
        kick = sqrt(1.0 - keep * keep)
        moved = zip(self._now, self._deviations, next(self._noise), strict=True)
        self._now = tuple(keep * x + spread * kick * n for x, spread, n in moved)
        return self._now


class GustyWind:
    """The wind at one vehicle, m/s, world frame: a steady one, and gusts along each axis. gust:
    their standard deviation. noise: rows of three standard normal numbers."""

    def __init__(self, steady: Vec3, gust: float, noise: Iterator[list[float]]) -> None:
        self._steady = steady
        self._gusts = Wandering((gust, gust, gust), GUST_TIME, noise)
        self.blows = gust > 0.0 or any(steady)

    def after(self, seconds: float) -> Vec3:
        """The wind, `seconds` after the last call."""
        x, y, z = self._gusts.after(seconds)
        return add(self._steady, (x, y, z))
