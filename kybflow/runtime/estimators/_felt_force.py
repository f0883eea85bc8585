"""Estimates from an accelerometer by which angle a motion-capture body is rotated relative to its
vehicle, and which disturbance accelerates the vehicle.

Markers are placed by hand, and the body is declared where the vehicle happens to stand, so its axes
are off the vehicle's by a constant rotation. Gravity reveals its components about the level axes:
with the attitude R as corrected so far and the acceleration a from the poses, an accelerometer
measures

    f = R^T (a + g e3) =: e    without an error, and    f = e - d x e    if R is off by d,

d_x = (f_y - e_y) / e_z and d_y = (e_x - f_x) / e_z, which is averaged over a memory (the correction
of Mahony, Hamel and Pflimlin, Nonlinear complementary filters on SO(3), IEEE TAC 2008, eq. 32, with
the motion's acceleration subtracted). Gravity reveals nothing about the vertical axis. A bias of
the accelerometer appears as an angle, 0.3 degrees for 0.05 m/s^2; the on-board attitude has the
same error.

The velocity's filter takes g times the slope of body z for the acceleration
(`kybflow.flight.tracked_pose`). Wind adds a disturbance of R f - g e3 minus that acceleration;
without this term, wind that accelerates the vehicle by 0.5 m/s^2 causes a velocity error of 3 cm/s.
"""

from __future__ import annotations

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    integrate,
    rotate,
    rotate_back,
    sub,
)
from kybflow.core.signals import NS, Time
from kybflow.flight.disturbance import SHAKEN
from kybflow.runtime.estimators._imu_sums import EVERY, ImuSums

MOST = 0.05
"""The largest angle about each axis, rad; a larger one would be noticed at setup."""
FIRST = 0.5
"""Least averaging time, seconds, so that the first sample doesn't count fully."""
LARGEST = 1.0
"""The largest plausible disturbance along an axis, m/s^2."""
HARD = 0.5 * GRAVITY
"""A mean specific force that differs more from gravity is due to a touch or a fall, m/s^2."""
LONGEST = 0.2
"""Longest time (s) between two updates; after a longer one, poses were lost."""


class FeltForce:
    """The estimated rotation of the body and the estimated disturbance.

    turned: the correction, by which the attitude of a pose is multiplied from the right.
    pushed: the disturbance along world x and y, m/s^2.
    memory: the averaging time of the angle, s.
    """

    def __init__(self, memory: float, sums: ImuSums) -> None:
        self.turned: Quat = LEVEL
        self.pushed = (0.0, 0.0)
        self._memory, self._elapsed, self._sums = memory, FIRST, sums
        self._angles = (0.0, 0.0)
        self._poses, self._slopes = 0, (0.0, 0.0)
        self._since, self._velocity = sums.until(0), ZERO

    def look(
        self, time: Time, velocity: Vec3, attitude: Quat, rates: Vec3, slope: tuple[float, float]
    ) -> None:
        """Process the estimated motion at the time of a new pose. attitude: the corrected attitude.
        slope: the horizontal acceleration that follows from it, m/s^2."""
        gx, gy = slope
        hx, hy = self._slopes
        self._poses, self._slopes = self._poses + 1, (gx + hx, gy + hy)
        if self._poses < EVERY:
            return
        gx, gy = self._slopes
        self._slopes = 0.0, 0.0
        vx, vy, vz = velocity
        ux, uy, uz = self._velocity
        now, since = self._sums.until(time), self._since
        self._poses, self._since, self._velocity = 0, now, velocity
        seconds, felt = (time - since.time) / NS, now.seconds - since.seconds
        if seconds > LONGEST or not 0.5 * seconds < felt < 2.0 * seconds:
            return
        total = sub(now.gained, since.gained)
        ax, ay, az = (vx - ux) / seconds, (vy - uy) / seconds, (vz - uz) / seconds
        ex, ey, ez = rotate_back(attitude, (ax, ay, az + GRAVITY))
        force = fx, fy, fz = total[0] / felt, total[1] / felt, total[2] / felt
        if abs(fz - GRAVITY) < HARD and abs(ez - GRAVITY) < HARD:
            self._elapsed = min(self._elapsed + seconds, self._memory)
            share = min(1.0, seconds / self._elapsed)
            tx, ty = self._angles
            tx = _within(tx + share * ((fy - ey) / ez), MOST)
            ty = _within(ty + share * ((ex - fx) / ez), MOST)
            self._angles, self.turned = (tx, ty), integrate(LEVEL, (tx, ty, 0.0), 1.0)
            px, py, _ = rotate(attitude, force)
            rx, ry, _ = rates
            calm = 1.0 + (rx * rx + ry * ry) / (SHAKEN * SHAKEN)
            px, py = (px - gx / EVERY) / calm, (py - gy / EVERY) / calm
            self.pushed = _within(px, LARGEST), _within(py, LARGEST)


def _within(value: float, most: float) -> float:
    return most if value > most else -most if value < -most else value
