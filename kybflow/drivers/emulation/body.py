"""The body of an emulated vehicle, and the sensors that only its own computer reads.

The IMU and GPS are those of the simulated vehicle. The compass, barometer and battery monitor are
defined here. Sensors read the simulator's truth; the emulated computer never does. World ENU,
radians, metres.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from math import exp, sqrt
from typing import NamedTuple

from kybflow.core.geometry import Quat, heading_of
from kybflow.core.signals import NS, Battery, Command, Time, Truth
from kybflow.core.units import DEG
from kybflow.drivers.emulation.breaking import Failures

PERIOD: Time = NS // 20
COMPASS_ERROR, COMPASS_NOISE = 3.0 * DEG, 0.5 * DEG
"""Standard deviations of the compass, radians: of its constant error, and of its noise."""
PRESSURE_NOISE, PRESSURE_WANDERS, PRESSURE_LASTS = 0.03, 0.10, 60.0
"""Errors of the barometric height: the standard deviations of its noise and of its drift, metres,
and the drift's time constant, seconds."""
EMPTY_VOLTAGE, VOLTAGE_SPAN = 9.6, 3.0
"""The voltage of an empty three-cell battery, and how much higher that of a full one is."""


class SimulatedBody(NamedTuple):
    """The simulated vehicle that carries an emulated computer.

    drive: takes the command for the attitude loop.
    attitude: returns that loop's own attitude estimate.
    move: opens or closes the payload's servo.
    look: returns the simulator's truth, for sensors and for messages of the firmware's simulator.
    """

    drive: Callable[[Command, Time], None]
    attitude: Callable[[], Quat]
    move: Callable[[bool, Time], None]
    look: Callable[[], Truth]


class CompassAndBarometer:
    """Reads the compass and the barometer twenty times a second.

    heading: the newest heading, radians, with a constant error.
    height: the newest height above the start, metres, with an error that drifts."""

    def __init__(self, look: Callable[[], Truth], generator: random.Random) -> None:
        self._look, self._generator = look, generator
        self._error = generator.gauss(0.0, COMPASS_ERROR)
        self._drift = 0.0
        self._stays = exp(-PERIOD / NS / PRESSURE_LASTS)
        self._zero = look().position[2]
        self._due: Time = 0
        self.heading = 0.0
        self.height = 0.0

    def read(self, now: Time) -> bool:
        """Read both sensors if they are due; return whether there are new readings."""
        if now < self._due:
            return False
        self._due = now + PERIOD
        noise, truth, stays = self._generator.gauss, self._look(), self._stays
        self.heading = heading_of(truth.attitude) + self._error + noise(0.0, COMPASS_NOISE)
        step = PRESSURE_WANDERS * sqrt(1.0 - stays * stays)
        self._drift = stays * self._drift + noise(0.0, step)
        self.height = truth.position[2] - self._zero + self._drift + noise(0.0, PRESSURE_NOISE)
        return True


class BatteryMonitor:
    """Measures the simulated battery; an injected failure may set another charge."""

    def __init__(self, failures: Failures) -> None:
        self._failures = failures
        self._measured: Battery | None = None

    def measure(self, battery: Battery) -> None:
        """Store the newest measurement of the simulated battery."""
        self._measured = battery

    @property
    def remaining(self) -> float:
        """The charge, 0 to 1; full before the first measurement."""
        if self._failures.battery is not None:
            return self._failures.battery
        return 1.0 if self._measured is None else self._measured.remaining

    @property
    def voltage(self) -> float:
        """The voltage: that of a three-cell battery if a failure sets the charge; 0 before the
        first measurement."""
        if self._failures.battery is not None:
            return EMPTY_VOLTAGE + VOLTAGE_SPAN * self._failures.battery
        return 0.0 if self._measured is None else self._measured.voltage
