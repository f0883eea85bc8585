"""The air that one vehicle flies in: steady wind and gusts.

Gusts along each axis are an Ornstein-Uhlenbeck process that forgets within `GUST_TIME`.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import exp, sqrt

from kybflow.core.geometry import ZERO, Vec3

GUST_TIME = 1.0
"""Seconds."""


class Wind:
    """Wind in the world frame, m/s. `gust` is a standard deviation; `noise` gives rows of three
    standard normal numbers."""

    def __init__(self, steady: Vec3, gust: float, noise: Iterator[list[float]]) -> None:
        self._steady = steady
        self._gust = gust
        self._noise = noise
        self._now = ZERO
        self.blows = gust > 0.0 or any(steady)

    def after(self, seconds: float) -> Vec3:
        """The wind, `seconds` after the last call."""
        keep = exp(-seconds / GUST_TIME)
        kick = self._gust * sqrt(1.0 - keep * keep)
        (x, y, z), (nx, ny, nz) = self._now, next(self._noise)
        self._now = (keep * x + kick * nx, keep * y + kick * ny, keep * z + kick * nz)
        (sx, sy, sz), (x, y, z) = self._steady, self._now
        return (sx + x, sy + y, sz + z)
