"""Estimates from the gyroscope how much too late poses are stamped.

All poses are shifted in time if there is a clock offset, or if they are stamped on arrival. The
measured attitude of a vehicle that turns at the rate w then lags its gyroscope. Let e be the
difference of the measured attitude from one that integrates the gyroscope and follows the measured
one with the time constant 1 / K. Then

    e = h(constant - offset w) + noise,    h: the high-pass s / (s + K),

where the constant contains the body's rotation and the gyroscope's drift. Least squares over a
memory, with a prior of zero weighted by `SURE`, gives

    offset = -sum(e . h(w)) / (sum(h(w)^2) + SURE)

(the offset between a camera's and an IMU's clock is found in the same way by Furgale, Rehder and
Siegwart, Unified temporal and spatial calibration for multi-sensor systems, IROS 2013, and online
by Li and Mourikis, IJRR 2014).
"""

from __future__ import annotations

from kybflow.core.geometry import (
    LEVEL,
    ZERO,
    Quat,
    add,
    conjugate,
    integrate,
    multiply,
    scale,
    sub,
)
from kybflow.core.signals import IMU_TIMEOUT, NS, Time
from kybflow.runtime.estimators._imu_sums import EVERY, ImuSums

FOLLOWING = 1.0
"""K, 1/s."""
SURE = 0.2
"""(rad/s)^2: the error of a pose's attitude over a likely offset, 0.1 degrees over 4 ms,
squared."""
MOST = 0.02
"""The largest offset, s."""
ASTRAY = 0.1
"""A difference from the integrated attitude that is larger than this (rad) restarts the
integration."""


class StampOffset:
    """Estimates the offset of the stamps. seconds: the estimated offset (s), zero until the vehicle
    has turned. memory: the time over which it is estimated (s)."""

    def __init__(self, memory: float, sums: ImuSums) -> None:
        self.seconds = 0.0
        self._memory, self._sums = memory, sums
        self._attitude: Quat = LEVEL
        self._turned = self._slow = ZERO
        self._last: Time = -IMU_TIMEOUT
        self._poses = 0
        self._product = self._square = 0.0

    def look(self, time: Time, seen: Quat) -> None:
        """Process the attitude of a new pose. time: its uncorrected stamp."""
        self._poses += 1
        if self._poses < EVERY:
            return
        self._poses, dt, self._last = 0, (time - self._last) / NS, time
        felt = self._sums.until(time)
        rates, turned, self._turned = felt.rates, sub(felt.angle, self._turned), felt.angle
        believed = integrate(self._attitude, turned, 1.0)
        w, x, y, z = multiply(conjugate(believed), seen)
        two = 2.0 if w > 0.0 else -2.0
        error = ex, ey, ez = two * x, two * y, two * z
        if dt * NS >= IMU_TIMEOUT or max(map(abs, error)) > ASTRAY:
            self._attitude, self._slow = seen, rates
            return
        share = FOLLOWING * dt
        self._attitude = integrate(believed, error, share)
        self._slow = add(scale(self._slow, 1.0 - share), scale(rates, share))
        hx, hy, hz = sub(rates, self._slow)
        fades = 1.0 - dt / (self._memory + dt)
        self._product = fades * self._product + ex * hx + ey * hy + ez * hz
        self._square = fades * self._square + hx * hx + hy * hy + hz * hz
        offset = -self._product / (self._square + SURE)
        self.seconds = MOST if offset > MOST else -MOST if offset < -MOST else offset
