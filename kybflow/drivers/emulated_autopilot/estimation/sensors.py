"""The simulated compass and barometer of an emulated autopilot, beside the IMU and GPS that the
simulated vehicle has. Sensors look at the truth so that the autopilot need not.

The compass shows the heading with one constant error; the barometer the height above its zero, with
one that wanders. World ENU, radians, metres.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from math import exp, sqrt

from kybflow.core.geometry import heading_of
from kybflow.core.signals import NS, Time, Truth
from kybflow.core.units import DEG

PERIOD: Time = NS // 20
COMPASS_ERROR, COMPASS_NOISE = 3.0 * DEG, 0.5 * DEG
PRESSURE_NOISE, PRESSURE_WANDERS, PRESSURE_LASTS = 0.03, 0.10, 60.0
"""Noise and wandering error of a height, standard deviations; seconds for which it is about the
same."""


class Senses:
    """Twenty readings a second of what `look` shows; `heading` and `height` are the newest."""

    def __init__(self, look: Callable[[], Truth], generator: random.Random) -> None:
        self._look, self._generator = look, generator
        self._error = generator.gauss(0.0, COMPASS_ERROR)
        self._wander = 0.0
        self._stays = exp(-PERIOD / NS / PRESSURE_LASTS)
        self._zero = look().position[2]
        self._due: Time = 0
        self.heading = 0.0
        self.height = 0.0

    def read(self, now: Time) -> bool:
        """Whether there is a new reading."""
        if now < self._due:
            return False
        self._due = now + PERIOD
        chance, truth, stays = self._generator.gauss, self._look(), self._stays
        self.heading = heading_of(truth.attitude) + self._error + chance(0.0, COMPASS_NOISE)
        step = PRESSURE_WANDERS * sqrt(1.0 - stays * stays)
        self._wander = stays * self._wander + chance(0.0, step)
        self.height = truth.position[2] - self._zero + self._wander + chance(0.0, PRESSURE_NOISE)
        return True
