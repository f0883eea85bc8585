"""The state estimator of an emulated drone: attitude, height, and speed over the ground.

The attitude comes from IMU and magnetometer (`kybflow.drivers.emulation.estimation`). Height and
speed are predicted with the accelerometer and corrected with ultrasound and optical flow, at the
rates below. Units are metres, in the frame ENU.
"""

from __future__ import annotations

import random
from collections.abc import Callable

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Vec3,
    add,
    from_heading,
    heading_of,
    rotate,
    rotate_back,
    scale,
)
from kybflow.core.signals import NS, Imu, Time, Truth
from kybflow.drivers.emulation.body import CompassAndBarometer
from kybflow.drivers.emulation.estimation import AttitudeFilter

FLOW, FLOW_NOISE = NS // 60, 0.03
"""Period of the optical flow, and standard deviation of its speed, m/s."""
ECHO, ECHO_NOISE = NS // 25, 0.01
"""Period of the ultrasound, and standard deviation of its height, m."""
FOLLOWS_FLOW, FOLLOWS_ECHO, CLIMB_BY_ECHO = 3.0, 6.0, 9.0
"""Correction gains: of the speed by the flow, 1/s; of the height, 1/s, and of the climb rate,
1/s^2, by the ultrasound."""


class DroneEstimator:
    """The estimated motion of one drone. height, climb: height above the start and its rate.
    velocity: horizontal, forward and left relative to its heading. imu: the latest IMU sample."""

    def __init__(self, look: Callable[[], Truth], generator: random.Random) -> None:
        self._look, self._generator = look, generator
        self.attitude = AttitudeFilter(heading_of(look().attitude))
        self._compass = CompassAndBarometer(look, generator)
        self._zero = look().position[2]
        self._flow: Time = 0
        self._echo: Time = 0
        self.height = self.climb = 0.0
        self.velocity: Vec3 = ZERO
        self.imu: Imu | None = None

    def add_imu(self, imu: Imu) -> None:
        """Predict the motion with an IMU sample."""
        self.imu = imu
        self.attitude.add_imu(imu, None)
        level = from_heading(self.attitude.heading)
        force = rotate(self.attitude.value, imu.specific_force)
        x, y, _ = rotate_back(level, force)
        spin = self.attitude.rate[2] * imu.dt
        vx, vy, _ = self.velocity
        self.velocity = (vx + x * imu.dt + spin * vy, vy + y * imu.dt - spin * vx, 0.0)
        pull = force[2] - GRAVITY
        self.height += imu.dt * (self.climb + 0.5 * imu.dt * pull)
        self.climb += imu.dt * pull

    def correct(self, now: Time) -> None:
        """Correct the estimate with every sensor that has a new measurement."""
        if self._compass.read(now):
            self.attitude.see(self._compass.heading)
        truth, noise = self._look(), self._generator.gauss
        if now >= self._flow:
            self._flow, share = now + FLOW, FOLLOWS_FLOW * FLOW / NS
            x, y, _ = rotate_back(from_heading(heading_of(truth.attitude)), truth.velocity)
            seen = (x + noise(0.0, FLOW_NOISE), y + noise(0.0, FLOW_NOISE), 0.0)
            self.velocity = add(scale(self.velocity, 1.0 - share), scale(seen, share))
        if now >= self._echo:
            self._echo, dt = now + ECHO, ECHO / NS
            off = truth.position[2] - self._zero + noise(0.0, ECHO_NOISE) - self.height
            self.height += FOLLOWS_ECHO * dt * off
            self.climb += CLIMB_BY_ECHO * dt * off

    def rest(self) -> None:
        """Reset the motion to that of a drone on the ground."""
        self.velocity, self.height, self.climb = ZERO, 0.0, 0.0
