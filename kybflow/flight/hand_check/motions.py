"""Recognises how a hand moves a vehicle, by the poses of motion capture and by its IMU.

A movement is over when the vehicle has moved and then stands still for `HOLD_S`. Displacements are
compared with themselves, not with metres: the poses are still if they scatter by less than a share
`STILL_SHARE` of the displacement since the last stand, so that a stream in a wrong unit shows the
same movements. What counts as a movement is decided by the IMU, or by the poses if there is none.

The IMU's rates w and specific forces f are integrated to an attitude R, whose vertical follows f
with a time constant T, and to a position x in a level frame whose x axis was that of the body at
rest. u = R^-1 e3 is the vertical in the body:

    R' = R [w + (f / |f| x u) / T],    x'' = R f - |f at rest| e3

x drifts. Therefore a movement d by the poses gives the pattern s(t) = (p(t) . d) / d^2, from which
a parabola is fitted away, as from x(t), and the movement by the IMU is the regression of x on s:

    felt = sum(x s) / sum(s s)

The vertical of the poses is the axis along which the lift was seen.

A constant error of the accelerometer and of the velocity at the start thus have no effect.

World frame and body frame as in `kybflow.core.geometry`; metres, seconds, radians.
"""

from __future__ import annotations

from enum import StrEnum
from math import acos, atan2
from typing import Any, NamedTuple

import numpy

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    UP,
    ZERO,
    Quat,
    Vec3,
    add,
    cross,
    dot,
    heading_of,
    integrate,
    norm,
    rotate,
    rotate_back,
    scale,
    sub,
)
from kybflow.core.signals import NS, Imu, Pose, Time
from kybflow.core.units import DEG

Array = numpy.ndarray[Any, numpy.dtype[numpy.float64]]

REST_S, HOLD_S = 1.5, 0.8
"""Seconds for which the vehicle must rest at first, and stand still after a movement."""
STILL_SHARE, STILL_TILT = 0.05, 4.0 * DEG
"""Largest scatter (root mean square) of a vehicle that is held still: of its position, relative to
the displacement since the last stand, and of its vertical, rad."""
LEAST_WAY, LEAST_DIP = 0.18, 15.0 * DEG
"""Smallest movements that count, m and rad."""
DEPARTED_SHARE = 0.1
"""Share of a displacement at which a movement has begun, and before whose end it is over."""
LONGEST_MOVEMENT_S = 6.0
"""Longest movement whose integral is exact enough, s."""
LEAST_PATTERN = 0.03
"""Least root mean square of the pattern s, so that enough poses show the movement itself."""
LEAST_IMU_RATE, MAX_IMU_GAP_S, MAX_IMU_ERROR = 22.0, 0.15, 1.5
"""Lowest rate of an IMU that is used, Hz; the longest gap between its samples in a movement, s; and
the largest difference of its specific force at rest from gravity, m/s^2."""
REST_WAY, REST_TURN, REST_FORCE = 0.005, 0.05, 0.3
"""Largest changes between the halves of the time at rest: of the position, m, unless its noise is a
tenth of that; of the rate, rad/s; and of the specific force, m/s^2."""
IMU_TIMEOUT_S = 5.0
"""Seconds at rest in which a usable IMU must be heard; an autopilot may have to be asked for it."""
SETTLING_TIME_S, FOLLOWING_TIME_S = 0.2, 4.0
"""Time constants T at rest and in the hand, s."""
CHECK_PERIOD_NS: Time = NS // 10
_TIME, _AT, _TOP, _HEADING = 0, slice(1, 4), slice(4, 7), 7
_MOVED, _FORCE, _RATE = slice(1, 4), slice(4, 7), slice(8, 11)
"""Columns of the poses: time, position, the vertical in the body, heading. Columns of the IMU:
time, integrated position, specific force, heading, rate."""


class HandStep(StrEnum):
    """What the hand does, in this order."""

    REST = "rest"
    LIFT = "lift"
    ALONG_X = "along x"
    ALONG_Y = "along y"
    DIP = "dip"


class HandMotion(NamedTuple):
    """What a step showed, by the poses and by the IMU (None without a usable one).

    seen: the displacement by the poses, m. felt: the displacement by the IMU, m, in a level frame
    whose x axis is that of the body at rest. seen_heading, felt_heading: the heading at the
    beginning of the movement, in the frame of the poses and in that of `felt`, rad. seen_turn,
    felt_turn: the rotation vector by which the vertical turned, in body axes, rad.
    """

    step: HandStep
    seen: Vec3
    felt: Vec3 | None
    seen_heading: float
    felt_heading: float
    seen_turn: Vec3
    felt_turn: Vec3 | None


def nearest_axis(way: Vec3) -> tuple[int, float, float]:
    """Return the axis that is nearest to a displacement, its sign, and the angle to it, rad."""
    axis = max(range(3), key=lambda i: abs(way[i]))
    n = norm(way) or 1.0
    return axis, 1.0 if way[axis] >= 0.0 else -1.0, acos(min(1.0, abs(way[axis]) / n))


class HandWatch:
    """Watches one vehicle in the hand.

    motions: what each finished step showed. step: the step that is due, None after the last.
    imu_trouble: why the IMU is not used, None if it is; known after the rest.
    """

    def __init__(self) -> None:
        self.motions: list[HandMotion] = []
        self.imu_trouble: str | None = None
        self._steps = list(HandStep)
        self._poses: list[tuple[float, ...]] = []
        self._imus: list[tuple[float, ...]] = []
        self._attitude: Quat = LEVEL
        self._velocity = self._moved = self._bias = ZERO
        self._gravity, self._following = GRAVITY, SETTLING_TIME_S
        self._up = UP
        self._began: float | None = None
        self._due: Time = 0
        self._base: Array = numpy.zeros(8)
        self._top: Vec3 | None = None

    @property
    def step(self) -> HandStep | None:
        return self._steps[0] if self._steps else None

    @property
    def moved(self) -> Vec3:
        """The displacement since the last stand, by the newest poses."""
        return _vector((numpy.array(self._poses[-10:]).mean(0) - self._base)[_AT])

    def age(self, now: Time) -> float | None:
        """Return the age of the newest pose, s; None before the first."""
        return now / NS - self._poses[-1][_TIME] if self._poses else None

    def add_imu(self, imu: Imu) -> None:
        """Add an IMU sample."""
        force, n = imu.specific_force, norm(imu.specific_force)
        if n > 0.0:
            lean = cross(scale(force, 1.0 / n), rotate_back(self._attitude, UP))
            rate = add(sub(imu.angular_velocity, self._bias), scale(lean, 1.0 / self._following))
            self._attitude = integrate(self._attitude, rate, imu.dt)
        gained = add(rotate(self._attitude, force), (0.0, 0.0, -self._gravity))
        before, self._velocity = self._velocity, add(self._velocity, scale(gained, imu.dt))
        way = scale(add(before, self._velocity), 0.5 * imu.dt)
        self._moved = add(self._moved, way)
        heading = heading_of(self._attitude)
        self._imus.append((imu.time / NS, *self._moved, *force, heading, *imu.angular_velocity))

    def add_pose(self, pose: Pose) -> bool:
        """Add a pose; return whether it ends a step."""
        top, heading = rotate_back(pose.attitude, self._up), heading_of(pose.attitude)
        self._poses.append((pose.time / NS, *pose.position, *top, heading))
        self._began = pose.time / NS if self._began is None else self._began
        if pose.time < self._due or not self._steps:
            return False
        self._due = pose.time + CHECK_PERIOD_NS
        is_over = self._rests() if self.step is HandStep.REST else self._is_moved()
        if is_over:
            self._steps.pop(0)
        return is_over

    def _recent(self, rows: list[tuple[float, ...]], seconds: float) -> Array | None:
        """Return the last rows; None if they are fewer than four or don't span the time."""
        since, first = self._poses[-1][_TIME] - seconds, len(rows)
        while first and rows[first - 1][_TIME] >= since:
            first -= 1
        if len(rows) - first < 4 or rows[first][_TIME] - since > 0.1 * seconds:
            return None
        return numpy.array(rows[first:])

    def _rests(self) -> bool:
        """Return whether the vehicle has rested for long enough; learn the IMU's errors then."""
        poses, imus = self._recent(self._poses, REST_S), self._recent(self._imus, REST_S)
        if poses is None:
            return False
        steps = numpy.diff(poses[:, _AT], 2, axis=0)
        noise = float(numpy.sqrt((steps**2).sum(1).mean() / 6.0))
        if _change(poses[:, _AT]) > max(REST_WAY, 10.0 * noise):
            return False
        self.imu_trouble = _trouble(imus)
        if self.imu_trouble and poses[-1, _TIME] - (self._began or 0.0) < IMU_TIMEOUT_S:
            return False
        if imus is not None and self.imu_trouble is None:
            if _change(imus[:, _FORCE]) > REST_FORCE or _change(imus[:, _RATE]) > REST_TURN:
                return False
            self._bias = _vector(imus[:, _RATE].mean(0))
            self._gravity = norm(_vector(imus[:, _FORCE].mean(0)))
            self._following, self._velocity, self._moved = FOLLOWING_TIME_S, ZERO, ZERO
            self._imus = []
        self._stand(poses)
        return True

    def _is_moved(self) -> bool:
        """Return whether the vehicle has moved as the step asks and is held still; add the
        movement then."""
        step, poses = self.step, self._recent(self._poses, HOLD_S)
        if poses is None or step is None:
            return False
        end = poses.mean(0)
        way = float(numpy.linalg.norm((end - self._base)[_AT]))
        seen_turn = _turned(_vector(self._base[_TOP]), _vector(end[_TOP]))
        if _scatter(poses[:, _TOP]) > STILL_TILT:
            return False
        felt, felt_turn, headings = None, None, (float(self._base[_HEADING]), 0.0)
        if step is HandStep.DIP:
            felt_turn = self._felt_turn()
            if norm(seen_turn if felt_turn is None else felt_turn) < LEAST_DIP:
                return False
        else:
            if _scatter(poses[:, _AT]) > STILL_SHARE * way:
                return False
            if self.imu_trouble is None:
                felt, headings = self._felt(end)
            if (way if felt is None else norm(felt)) < LEAST_WAY:
                return False
        seen = _vector((end - self._base)[_AT])
        if step is HandStep.LIFT:
            axis, sign, _ = nearest_axis(seen)
            x, y, z = (sign if i == axis else 0.0 for i in range(3))
            self._up = (x, y, z)
        self.motions.append(HandMotion(step, seen, felt, *headings, seen_turn, felt_turn))
        self._stand(poses)
        return True

    def _stand(self, poses: Array) -> None:
        """Begin the next step where the vehicle stands now."""
        self._base = poses.mean(0)
        self._base[_HEADING] = poses[-1, _HEADING]
        since = float(poses[0, _TIME])
        self._top = self._top_felt()
        self._poses = [row for row in self._poses if row[_TIME] >= since]
        self._imus = [row for row in self._imus if row[_TIME] >= since]

    def _top_felt(self) -> Vec3 | None:
        """Return the vertical in the body by the accelerometer while the vehicle is held still."""
        imus = self._recent(self._imus, HOLD_S)
        return None if imus is None else _vector(imus[:, _FORCE].mean(0))

    def _felt_turn(self) -> Vec3 | None:
        """Return by how much the vertical in the body has turned, by the accelerometer."""
        if self.imu_trouble is not None or self._top is None:
            return None
        top = self._top_felt()
        return None if top is None else _turned(self._top, top)

    def _felt(self, end: Array) -> tuple[Vec3 | None, tuple[float, float]]:
        """Return the movement that ended at a mean pose by the IMU, and the headings before by the
        poses and by the IMU. The movement is None if poses or samples are missing or if it took too
        long."""
        poses, imus = numpy.array(self._poses), numpy.array(self._imus)
        offset, way = (end - self._base)[_AT], float(numpy.linalg.norm((end - self._base)[_AT]))
        unknown = None, (float(self._base[_HEADING]), 0.0)
        if not way or len(imus) < 4:
            return unknown
        near = DEPARTED_SHARE * way
        away = numpy.linalg.norm(poses[:, _AT] - self._base[_AT], axis=1) > near
        short = numpy.linalg.norm(poses[:, _AT] - end[_AT], axis=1) > near
        begins = int(numpy.flatnonzero(~away & short).max(initial=0))
        ends = min(int(numpy.flatnonzero(short).max(initial=begins)) + 1, len(poses) - 1)
        since, until = poses[begins, _TIME], poses[ends, _TIME]
        margin = 0.6 * (until - since) + 0.1
        times = poses[:, _TIME]
        is_inside = (times >= since - margin) & (times <= until + margin)
        times = times[is_inside]
        inside = imus[(imus[:, _TIME] >= times[0] - 0.1) & (imus[:, _TIME] <= times[-1] + 0.1)]
        if until - since > LONGEST_MOVEMENT_S or not _is_dense(inside):
            return unknown
        fit = numpy.vander(times - times.mean(), 3)
        curves = [poses[is_inside][:, _AT] @ (offset / way**2)]
        curves += [numpy.interp(times, inside[:, _TIME], x) for x in inside[:, _MOVED].T]
        bends = numpy.column_stack(curves)
        bends -= fit @ numpy.linalg.lstsq(fit, bends, rcond=None)[0]
        pattern = bends[:, 0]
        if float((pattern**2).mean()) < LEAST_PATTERN**2:
            return unknown
        felt = _vector(pattern @ bends[:, 1:] / (pattern @ pattern))
        first = min(int(numpy.searchsorted(inside[:, _TIME], since)), len(inside) - 1)
        return felt, (float(poses[begins, _HEADING]), float(inside[first, _HEADING]))


def _trouble(imus: Array | None) -> str | None:
    """Return why an IMU can't be used, from its samples at rest; None if it can."""
    if imus is None:
        return "no IMU is heard"
    rate = (len(imus) - 1) / max(float(imus[-1, _TIME] - imus[0, _TIME]), 1e-6)
    weight = float(numpy.linalg.norm(imus[:, _FORCE].mean(0)))
    if rate < LEAST_IMU_RATE:
        return f"the IMU is heard at {rate:.0f} Hz only, {LEAST_IMU_RATE:.0f} Hz are needed"
    if abs(weight - GRAVITY) > MAX_IMU_ERROR:
        return f"the IMU at rest shows {weight:.1f} m/s^2 instead of {GRAVITY}"
    return None


def _is_dense(rows: Array) -> bool:
    """Return whether no samples are missing among the rows."""
    return len(rows) > 1 and float(numpy.diff(rows[:, _TIME]).max()) <= MAX_IMU_GAP_S


def _change(rows: Array) -> float:
    """Return the distance between the means of the two halves of the rows."""
    half = len(rows) // 2
    return float(numpy.linalg.norm(rows[:half].mean(0) - rows[half:].mean(0)))


def _scatter(rows: Array) -> float:
    """Return the root mean square distance of the rows from their mean."""
    return float(numpy.sqrt(((rows - rows.mean(0)) ** 2).sum(1).mean()))


def _turned(before: Vec3, after: Vec3) -> Vec3:
    """Return the rotation vector, in body axes, of a body in which a direction of the world changes
    from `before` to `after`."""
    axis = cross(after, before)
    n = norm(axis)
    return ZERO if not n else scale(axis, atan2(n, dot(before, after)) / n)


def _vector(array: Any) -> Vec3:
    x, y, z = array.tolist()
    return (x, y, z)
