"""Integrals of IMU measurements, which can be read at a past time, that of a pose that arrived
late."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Imu, Time

EVERY = 4
"""Poses between two readings of the sums."""
LONGEST = 64
"""Number of samples that are kept."""


class ImuSum(NamedTuple):
    """The integrals of all samples until `time`, body frame. angle: the integral of the body rates,
    rad. gained: the integral of the specific force, m/s. seconds: the integration time. rates,
    force: the last sample."""

    time: Time
    angle: Vec3
    gained: Vec3
    seconds: float
    rates: Vec3
    force: Vec3


class ImuSums:
    """Integrates IMU samples. delay: how much older the measured motion is than its stamp, s."""

    def __init__(self, delay: float) -> None:
        self._behind = round(delay * NS)
        self._sums = deque([ImuSum(0, ZERO, ZERO, 0.0, ZERO, ZERO)], LONGEST)

    def take(self, imu: Imu) -> None:
        """Add another sample."""
        time, dt, force, rates = imu
        self._sums.append(_added(self._sums[-1], time - self._behind, dt, rates, force))

    def until(self, time: Time) -> ImuSum:
        """Return the sums at a time, extrapolated by the next sample, or by the last one if the
        time is later."""
        found = self._sums[-1]
        for earlier in reversed(self._sums):
            if earlier.time < time:
                break
            found = earlier
        return _added(found, time, (time - found.time) / NS, found.rates, found.force)


def _added(before: ImuSum, time: Time, dt: float, rates: Vec3, force: Vec3) -> ImuSum:
    """Return the sums plus a sample of `dt` seconds, which may be negative, at `time`."""
    _, summed, reached, seconds, _, _ = before
    ax, ay, az = summed
    px, py, pz = reached
    fx, fy, fz = force
    wx, wy, wz = rates
    angle = (ax + dt * wx, ay + dt * wy, az + dt * wz)
    gained = (px + dt * fx, py + dt * fy, pz + dt * fz)
    return ImuSum(time, angle, gained, seconds + dt, rates, force)
