"""Estimates from an IMU, for `mocap`: the rotation of the body on its vehicle, the disturbance that
accelerates the vehicle (`FeltForce`), and the delay of the poses' stamps (`StampOffset`).
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    integrate,
    multiply,
    rotate,
    rotate_back,
    scale,
    sub,
)
from kybflow.core.signals import IMU_TIMEOUT, NS, Imu, Time
from kybflow.flight.force_estimates import SHAKING_RATE

POSES_PER_READING = 4
"""Poses between two readings of the sums."""
KEPT_SAMPLES = 64
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
    """Integrates IMU samples. The integrals can be read at a past time, that of a pose that arrived
    late. delay: how much older the measured motion is than its stamp, s."""

    def __init__(self, delay: float) -> None:
        self._behind = round(delay * NS)
        self._sums = deque([ImuSum(0, ZERO, ZERO, 0.0, ZERO, ZERO)], KEPT_SAMPLES)

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


LARGEST_ANGLE = 0.05
"""The largest angle about each axis, rad; a larger one would be noticed at setup."""
MIN_AVERAGING_S = 0.5
"""Least averaging time, seconds, so that the first sample doesn't count fully."""
MAX_PUSH = 1.0
"""The largest plausible disturbance along an axis, m/s^2."""
TOUCH_FORCE = 0.5 * GRAVITY
"""A mean specific force that differs more from gravity is due to a touch or a fall, m/s^2."""
MAX_GAP_S = 0.2
"""Longest time (s) between two updates; after a longer one, poses were lost."""


class FeltForce:
    """Estimates the rotation of a motion-capture body and the disturbance that accelerates its
    vehicle.

    Markers are placed by hand, and the body is declared where the vehicle happens to stand, so its
    axes are off the vehicle's by a constant rotation. Gravity reveals its components about the
    level axes: with the attitude R as corrected so far and the acceleration a from the poses, an
    accelerometer measures

        f = R^T (a + g e3) =: e    without an error, and    f = e - d x e    if R is off by d,

    d_x = (f_y - e_y) / e_z and d_y = (e_x - f_x) / e_z, which is averaged over a memory (the
    correction of Mahony, Hamel and Pflimlin, Nonlinear complementary filters on SO(3), IEEE TAC
    2008, eq. 32, with the motion's acceleration subtracted). Gravity reveals nothing about the
    vertical axis. A bias of the accelerometer appears as an angle, 0.3 degrees for 0.05 m/s^2; the
    on-board attitude has the same error.

    The velocity's filter takes g times the slope of body z for the acceleration
    (`kybflow.flight.tracked_pose`). Wind adds a disturbance of R f - g e3 minus that acceleration;
    without this term, wind that accelerates the vehicle by 0.5 m/s^2 causes a velocity error of 3
    cm/s.

    turned: the correction, by which the attitude of a pose is multiplied from the right. pushed:
    the disturbance along world x and y, m/s^2. memory: the averaging time of the angle, s.
    """

    def __init__(self, memory: float, sums: ImuSums) -> None:
        self.turned: Quat = LEVEL
        self.pushed = (0.0, 0.0)
        self._memory, self._elapsed, self._sums = memory, MIN_AVERAGING_S, sums
        self._angles = (0.0, 0.0)
        self._poses, self._slopes = 0, (0.0, 0.0)
        self._since, self._velocity = sums.until(0), ZERO

    def look(
        self, time: Time, velocity: Vec3, attitude: Quat, rates: Vec3, slope: tuple[float, float]
    ) -> None:
        """Learn from the estimated motion at the time of a new pose. attitude: the corrected
        attitude. slope: the horizontal acceleration that follows from it, m/s^2."""
        gx, gy = slope
        hx, hy = self._slopes
        self._poses, self._slopes = self._poses + 1, (gx + hx, gy + hy)
        if self._poses < POSES_PER_READING:
            return
        gx, gy = self._slopes
        self._slopes = 0.0, 0.0
        vx, vy, vz = velocity
        ux, uy, uz = self._velocity
        now, since = self._sums.until(time), self._since
        self._poses, self._since, self._velocity = 0, now, velocity
        seconds, felt = (time - since.time) / NS, now.seconds - since.seconds
        if seconds > MAX_GAP_S or not 0.5 * seconds < felt < 2.0 * seconds:
            return
        total = sub(now.gained, since.gained)
        ax, ay, az = (vx - ux) / seconds, (vy - uy) / seconds, (vz - uz) / seconds
        ex, ey, ez = rotate_back(attitude, (ax, ay, az + GRAVITY))
        force = fx, fy, fz = total[0] / felt, total[1] / felt, total[2] / felt
        if abs(fz - GRAVITY) < TOUCH_FORCE and abs(ez - GRAVITY) < TOUCH_FORCE:
            self._elapsed = min(self._elapsed + seconds, self._memory)
            share = min(1.0, seconds / self._elapsed)
            tx, ty = self._angles
            tx = _within(tx + share * ((fy - ey) / ez), LARGEST_ANGLE)
            ty = _within(ty + share * ((ex - fx) / ez), LARGEST_ANGLE)
            self._angles, self.turned = (tx, ty), integrate(LEVEL, (tx, ty, 0.0), 1.0)
            px, py, _ = rotate(attitude, force)
            rx, ry, _ = rates
            calm = 1.0 + (rx * rx + ry * ry) / (SHAKING_RATE * SHAKING_RATE)
            px, py = (px - gx / POSES_PER_READING) / calm, (py - gy / POSES_PER_READING) / calm
            self.pushed = _within(px, MAX_PUSH), _within(py, MAX_PUSH)


def _within(value: float, most: float) -> float:
    return most if value > most else -most if value < -most else value


FOLLOWING_RATE = 1.0
"""K, 1/s."""
POSE_VARIANCE = 0.2
"""(rad/s)^2: the error of a pose's attitude over a likely offset, 0.1 degrees over 4 ms,
squared."""
LARGEST_OFFSET = 0.02
"""The largest offset, s."""
RESTART_ANGLE = 0.1
"""A difference from the integrated attitude that is larger than this (rad) restarts the
integration."""


class StampOffset:
    """Estimates from the gyroscope how much too late poses are stamped.

    All poses are shifted in time if there is a clock offset, or if they are stamped on arrival. The
    measured attitude of a vehicle that turns at the rate w then lags its gyroscope. Let e be the
    difference of the measured attitude from one that integrates the gyroscope and follows the
    measured one with the time constant 1 / K. Then

        e = h(constant - offset w) + noise,    h: the high-pass s / (s + K),

    where the constant contains the body's rotation and the gyroscope's drift. Least squares over a
    memory, with a prior of zero weighted by `POSE_VARIANCE`, gives

        offset = -sum(e . h(w)) / (sum(h(w)^2) + POSE_VARIANCE)

    (the offset between a camera's and an IMU's clock is found in the same way by Furgale, Rehder
    and Siegwart, Unified temporal and spatial calibration for multi-sensor systems, IROS 2013, and
    online by Li and Mourikis, IJRR 2014).

    seconds: the estimated offset (s), zero until the vehicle has turned. memory: the time over
    which it is estimated (s).
    """

    def __init__(self, memory: float, sums: ImuSums) -> None:
        self.seconds = 0.0
        self._memory, self._sums = memory, sums
        self._attitude: Quat = LEVEL
        self._turned = self._slow = ZERO
        self._last: Time = -IMU_TIMEOUT
        self._poses = 0
        self._product = self._square = 0.0

    def look(self, time: Time, seen: Quat) -> None:
        """Update the clock offset with the attitude `seen` in a new pose. time: the pose's
        uncorrected stamp."""
        self._poses += 1
        if self._poses < POSES_PER_READING:
            return
        self._poses, dt, self._last = 0, (time - self._last) / NS, time
        felt = self._sums.until(time)
        rates, turned, self._turned = felt.rates, sub(felt.angle, self._turned), felt.angle
        believed = integrate(self._attitude, turned, 1.0)
        w, x, y, z = multiply(conjugate(believed), seen)
        two = 2.0 if w > 0.0 else -2.0
        error = ex, ey, ez = two * x, two * y, two * z
        if dt * NS >= IMU_TIMEOUT or max(map(abs, error)) > RESTART_ANGLE:
            self._attitude, self._slow = seen, rates
            return
        share = FOLLOWING_RATE * dt
        self._attitude = integrate(believed, error, share)
        self._slow = add(scale(self._slow, 1.0 - share), scale(rates, share))
        hx, hy, hz = sub(rates, self._slow)
        fades = 1.0 - dt / (self._memory + dt)
        self._product = fades * self._product + ex * hx + ey * hy + ez * hz
        self._square = fades * self._square + hx * hx + hy * hy + hz * hz
        offset = -self._product / (self._square + POSE_VARIANCE)
        self.seconds = (
            LARGEST_OFFSET
            if offset > LARGEST_OFFSET
            else -LARGEST_OFFSET
            if offset < -LARGEST_OFFSET
            else offset
        )
