"""Where the filter begins: from a pose, or from a position and what the IMU feels at rest."""

from __future__ import annotations

from math import atan2, hypot
from typing import NamedTuple

import numpy

from kybflow.core.geometry import GRAVITY, ZERO, Quat, Vec3, from_euler, norm
from kybflow.core.signals import NS, Imu, Time
from kybflow.flight.fusion.covariance import (
    ACCELEROMETER,
    ATTITUDE,
    GYRO,
    POSITION,
    SIZE,
    VELOCITY,
    Matrix,
    Noise,
    Nominal,
    correction,
    matrix,
    reset,
    skew,
)
from kybflow.flight.fusion.values import Fix, State
from kybflow.runtime.estimators.inertial import SILENT

PACE = 1.0
"""Standard deviation of a velocity of which nothing is known, m/s."""
LEANING = 0.1
"""The same of an attitude that the filter goes on with, rad, along each axis."""
REST_FORCE, REST_TURN, REST = 0.5, 0.1, 0.5
"""At rest the specific force is so near to gravity's, m/s^2, and so little is turned, rad/s, for so
many seconds."""
CREEP, SHIVER = 0.01, 0.01
"""Standard deviations at rest: of the velocity, m/s, and of the acceleration, m/s^2."""


class Unknown(NamedTuple):
    """Standard deviations at the start: of the biases, m/s^2 and rad/s, and of the declared
    heading, rad."""

    accelerometer: float
    gyro: float
    heading: float


def begun(fix: Fix, unknown: Unknown, attitude: Quat, velocity: Vec3 | None) -> State:
    """At `fix`. Where it has no attitude, `attitude` is believed. velocity: the believed one."""
    covariance = numpy.zeros((SIZE, SIZE))
    covariance[POSITION, POSITION] = fix.noise[:3, :3]
    pace = PACE if velocity is None else 0.3 * PACE
    covariance[VELOCITY, VELOCITY] = numpy.eye(3) * pace**2
    if fix.attitude is not None:
        attitude = fix.attitude
        covariance[ATTITUDE, ATTITUDE] = fix.noise[3:, 3:]
    else:
        covariance[ATTITUDE, ATTITUDE] = numpy.eye(3) * LEANING**2
    covariance[ACCELEROMETER, ACCELEROMETER] = numpy.eye(3) * unknown.accelerometer**2
    covariance[GYRO, GYRO] = numpy.eye(3) * unknown.gyro**2
    nominal = Nominal(fix.time, fix.position, ZERO if velocity is None else velocity, attitude)
    return State(nominal, covariance, fix.time)


class Standstill:
    """The IMU's averages since the vehicle is at rest."""

    def __init__(self) -> None:
        self._since: Time | None = None
        self._time: Time = 0
        self._seconds = 0.0
        self._force, self._turn = ZERO, ZERO

    def feel(self, imu: Imu) -> None:
        moves = (
            abs(norm(imu.specific_force) - GRAVITY) > REST_FORCE
            or norm(imu.angular_velocity) > REST_TURN
        )
        if moves:
            self._since = None
            return
        if self._since is None or imu.time - self._time > SILENT:
            self._since, self._seconds = imu.time, 0.0
            self._force = self._turn = ZERO
        else:
            dt = (imu.time - self._time) / NS
            self._seconds += dt
            share = dt / self._seconds
            self._force = _towards(self._force, imu.specific_force, share)
            self._turn = _towards(self._turn, imu.angular_velocity, share)
        self._time = imu.time

    def holds(self, time: Time) -> bool:
        """Whether the vehicle is at rest now and was at `time`."""
        return self._since is not None and self._since <= time and self._seconds >= REST

    def begun(self, fix: Fix, unknown: Unknown, noise: Noise, heading: float) -> State:
        """At a position, at rest: tilt and biases by one correction with what was felt, f = R' g +
        b and w = c, so that the tilt's error goes with the bias's; the heading is the declared
        one."""
        fx, fy, fz = self._force
        attitude = from_euler(atan2(fy, fz), atan2(-fx, hypot(fy, fz)), heading)
        state = begun(fix._replace(attitude=None), unknown, attitude, ZERO)
        turn = matrix(attitude)
        covariance = state.covariance.copy()
        covariance[VELOCITY, VELOCITY] = numpy.eye(3) * CREEP**2
        covariance[ATTITUDE, ATTITUDE] = turn.T @ numpy.diag((1.0, 1.0, unknown.heading**2)) @ turn
        pull: Matrix = turn.T @ numpy.array((0.0, 0.0, GRAVITY))
        px, py, pz = pull.tolist()
        sees = numpy.zeros((6, SIZE))
        sees[:3, ATTITUDE] = skew((px, py, pz))
        sees[:3, ACCELEROMETER] = sees[3:, GYRO] = numpy.eye(3)
        told = correction(
            covariance,
            [fx - px, fy - py, fz - pz, *self._turn],
            numpy.diag(
                [noise.velocity**2 / self._seconds + SHIVER**2] * 3
                + [noise.attitude**2 / self._seconds] * 3
            ),
            sees,
        )
        nominal = state.nominal.corrected(told.error)
        return state._replace(nominal=nominal, covariance=reset(told.covariance, told.error))


def _towards(a: Vec3, b: Vec3, share: float) -> Vec3:
    return (
        a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]),
    )  # fmt: skip
