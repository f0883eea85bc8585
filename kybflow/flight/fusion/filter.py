"""The filter of the estimator `fusion`: initialization, outlier gate and reset. The rules for these
are in `kybflow.runtime.estimators.fusion`.

The filter starts from a pose, or from a position and the IMU's readings at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, hypot, sqrt
from typing import NamedTuple

import numpy

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, Quat, Vec3, from_euler, norm
from kybflow.core.signals import IMU_TIMEOUT, NS, Estimate, Imu, Pose, Time
from kybflow.flight.fusion.covariance import (
    ACCELEROMETER,
    ATTITUDE,
    GYRO,
    POSITION,
    STATES,
    VELOCITY,
    ImuNoise,
    Matrix,
    Nominal,
    correction,
    matrix,
    reset,
    skew,
)
from kybflow.flight.fusion.params import FilterParams
from kybflow.flight.fusion.replay import Belief, FilterState, Fix, Replay
from kybflow.flight.pose_gate import Bounds, PoseGate, Reference, Refusal, seen_from

MIN_GATE = 0.2
"""Least distance from the predicted position that the gate allows, metres."""
VELOCITY_SPREAD = 1.0
"""Standard deviation of an unknown velocity, m/s."""
KEPT_TILT_SPREAD = 0.1
"""Standard deviation about each axis of an attitude that is kept at a new start, rad."""
REST_FORCE, REST_TURN, REST_TIME_S = 0.5, 0.1, 0.5
"""The vehicle is at rest if the specific force is this close to gravity, m/s^2, and the turn rate
this low, rad/s, for so many seconds."""
WRONG_FORCE, WRONG_TURN = 1.0, 0.1
"""Standard deviations of an IMU's biases after they led the filter astray, m/s^2 and rad/s."""
REST_VELOCITY_SPREAD, REST_ACCELERATION_SPREAD = 0.01, 0.01
"""Standard deviations at rest of the velocity, m/s, and of the acceleration, m/s^2."""


class Filter:
    """The filter of one vehicle. is_known: whether enough measurements agree for an estimate."""

    def __init__(self, params: FilterParams, heading: float) -> None:
        p = params
        self._params, self._heading = p, heading
        self._noise = ImuNoise(
            p.velocity_walk, p.attitude_walk, p.accelerometer_drift, p.gyro_drift
        )
        self._unknown = Unknown(p.accelerometer_bias, p.gyro_bias, p.heading_error)
        self._memory = round(p.memory * NS)
        self._replay = Replay(self._noise, p.gate, p.widest_gate, self._memory)
        self._still = Standstill()
        self._gate = PoseGate()
        self._waiting: list[Fix] = []
        self._was_known = False
        self._wander = 0.0

    @property
    def nominal(self) -> Nominal | None:
        return self._replay.nominal

    @property
    def state(self) -> FilterState | None:
        return self._replay.state

    @property
    def is_known(self) -> bool:
        state = self._replay.state
        return state is not None and state.passed >= self._params.samples

    @property
    def refusal(self) -> Refusal | None:
        """Why measurements are refused; None while they pass."""
        return self._gate.refusal

    @property
    def spread(self) -> float:
        """Standard deviation of the position, metres, including systematic errors and the distance
        of refused fixes."""
        state = self._replay.state
        assert state is not None
        return hypot(state.deviation, self._wander, state.off if self._doubts(state) else 0.0)

    def at(self, time: Time) -> Belief | None:
        """Return the state at `time`, or None if it is unknown."""
        return self._replay.at(time) if self.is_known else None

    def anchor(self, estimate: Estimate) -> None:
        """Compare measurements with the estimate of another estimator, on which the vehicle flies,
        from now on."""
        self._gate.flown = estimate

    def add_imu(self, imu: Imu) -> None:
        """Predict by an IMU sample."""
        self._replay.add_imu(imu)
        self._still.add_imu(imu)

    def take(self, fixes: Sequence[Fix], now: Time) -> None:
        """Process the fixes up to the time of the newest IMU sample; later fixes wait for their
        samples."""
        fixes, self._waiting = [*self._waiting, *fixes], []
        for fix in fixes:
            if self._replay.covers(fix.time):
                self._fuse(fix, self._gate.current(now))
            elif self._replay.lacks(fix.time) and abs(fix.time - now) <= self._memory:
                self._waiting.append(fix)

    def _fuse(self, fix: Fix, flown: Estimate | None) -> None:
        gate, state = self._gate, self._replay.state
        seen = None if flown is None else seen_from(flown, fix.time)
        if seen is not None and not gate.passes(
            _as_pose(fix, seen.attitude), seen, self._bounds(fix)
        ):
            belief = self._replay.at(fix.time)
            own = None if state is None or belief is None else _reference(state, belief.nominal)
            self._refuse(fix, seen, own, flown)
            return
        if fix.attitude is None:
            self._wander = sqrt(self._params.position_wander) * fix.deviation
        if state is None:
            self._begin(fix, flown)
        elif self._replay.add(fix):
            state = self._replay.state
            assert state is not None
            if state.missed is None or state.missed.time != fix.time:
                gate.passed(fix.time)
            elif self._was_known:
                believed = _reference(state, state.missed)
                own = believed if seen is None else seen._replace(time=state.fused)
                self._refuse(fix, believed, own, flown)
            else:
                self._begin(fix, flown)
            self._was_known = self._was_known or self.is_known

    def _refuse(
        self, fix: Fix, reference: Reference, own: Reference | None, flown: Estimate | None
    ) -> None:
        """Record a refused measurement, and restart from it if the gate opens."""
        pose = _as_pose(fix, reference.attitude)
        velocity = self._gate.opened(pose, reference, own, self._bounds(fix))
        if velocity is not None:
            self._begin(fix, flown, None if fix.attitude is None else velocity)

    def _doubts(self, state: FilterState) -> bool:
        since, last = state.doubted, state.missed
        return (
            since is not None and last is not None and last.time - since > self._params.doubt * NS
        )

    def _bounds(self, fix: Fix) -> Bounds:
        p, beside = self._params, 4.0 * fix.deviation
        gate = min(MIN_GATE, p.widest_gate) + beside
        return Bounds(gate, p.widest_gate + beside, p.settled, p.doubt)

    def _begin(self, fix: Fix, flown: Estimate | None, velocity: Vec3 | None = None) -> None:
        """Start from a measurement. velocity: the velocity of poses that contradicted the filter's
        state, possibly because of wrong IMU biases; None at other starts."""
        nominal, unknown = self._replay.nominal, self._unknown
        if velocity is not None:
            unknown = unknown._replace(
                accelerometer=max(unknown.accelerometer, WRONG_FORCE),
                gyro=max(unknown.gyro, WRONG_TURN),
            )
        if flown is not None:
            state = begun(fix, unknown, flown.attitude, velocity or flown.velocity)
        elif fix.attitude is None and self._still.holds(fix.time):
            state = self._still.begun(fix, self._unknown, self._noise, self._heading)
        elif fix.attitude is not None or nominal is not None:
            attitude = LEVEL if nominal is None else nominal.attitude
            state = begun(fix, unknown, attitude, velocity)
        else:
            return
        if velocity is not None and self._was_known:
            state = state._replace(passed=max(state.passed, self._params.samples))
        self._replay.begin(state)


def _reference(state: FilterState, nominal: Nominal) -> Reference:
    return Reference(state.fused, nominal.position, nominal.attitude, state.deviation, 0.0)


def _as_pose(fix: Fix, believed: Quat) -> Pose:
    return Pose(fix.time, fix.position, fix.attitude or believed)


class Unknown(NamedTuple):
    """Standard deviations at the start, of the accelerometer's and gyroscope's biases, m/s^2 and
    rad/s, and of the declared heading, rad."""

    accelerometer: float
    gyro: float
    heading: float


def begun(fix: Fix, unknown: Unknown, attitude: Quat, velocity: Vec3 | None) -> FilterState:
    """Return a state that starts at `fix`. attitude: the estimated attitude, used if the fix has
    none. velocity: the estimated velocity, None if unknown. The causes of the fix's systematic
    errors are correlated with the errors of this state, with the opposite sign."""
    slopes = numpy.zeros((6, 0)) if fix.slopes is None else fix.slopes
    count = slopes.shape[1]
    covariance = numpy.zeros((STATES + count, STATES + count))
    covariance[POSITION, POSITION] = fix.noise[:3, :3]
    pace = VELOCITY_SPREAD if velocity is None else 0.3 * VELOCITY_SPREAD
    covariance[VELOCITY, VELOCITY] = numpy.eye(3) * pace**2
    if fix.attitude is not None:
        attitude = fix.attitude
        covariance[ATTITUDE, ATTITUDE] = fix.noise[3:, 3:]
    else:
        covariance[ATTITUDE, ATTITUDE] = numpy.eye(3) * KEPT_TILT_SPREAD**2
    covariance[ACCELEROMETER, ACCELEROMETER] = numpy.eye(3) * unknown.accelerometer**2
    covariance[GYRO, GYRO] = numpy.eye(3) * unknown.gyro**2
    if count:
        sees = numpy.zeros((STATES, count))
        sees[POSITION], sees[ATTITUDE] = slopes[:3], slopes[3:]
        covariance[:STATES, :STATES] += sees @ sees.T
        covariance[:STATES, STATES:], covariance[STATES:, :STATES] = -sees, -sees.T
        covariance[STATES:, STATES:] = numpy.eye(count)
    nominal = Nominal(fix.time, fix.position, ZERO if velocity is None else velocity, attitude)
    return FilterState(
        nominal, covariance, fix.time, systematic=numpy.zeros(count), extent=fix.extent
    )


class Standstill:
    """Averages the IMU's samples while the vehicle is at rest. A sample that isn't newer than the
    last is ignored."""

    def __init__(self) -> None:
        self._since: Time | None = None
        self._time: Time = 0
        self._seconds = 0.0
        self._force, self._turn = ZERO, ZERO

    def add_imu(self, imu: Imu) -> None:
        moves = (
            abs(norm(imu.specific_force) - GRAVITY) > REST_FORCE
            or norm(imu.angular_velocity) > REST_TURN
        )
        if moves:
            self._since = None
            return
        if self._since is None or imu.time - self._time > IMU_TIMEOUT:
            self._since, self._seconds = imu.time, 0.0
            self._force = self._turn = ZERO
        elif imu.time > self._time:
            dt = (imu.time - self._time) / NS
            self._seconds += dt
            share = dt / self._seconds
            self._force = _towards(self._force, imu.specific_force, share)
            self._turn = _towards(self._turn, imu.angular_velocity, share)
        self._time = max(self._time, imu.time)

    def holds(self, time: Time) -> bool:
        """Return whether the vehicle is at rest now and was at `time`."""
        return self._since is not None and self._since <= time and self._seconds >= REST_TIME_S

    def begun(self, fix: Fix, unknown: Unknown, noise: ImuNoise, heading: float) -> FilterState:
        """Return a state that starts at a position, at rest. Tilt and biases come from one
        correction by the averages, f = R' g + b and w = c, so that the tilt's error is correlated
        with the bias's; the heading is the declared one."""
        fx, fy, fz = self._force
        attitude = from_euler(atan2(fy, fz), atan2(-fx, hypot(fy, fz)), heading)
        state = begun(fix._replace(attitude=None), unknown, attitude, ZERO)
        turn = matrix(attitude)
        covariance = state.covariance.copy()
        covariance[VELOCITY, VELOCITY] = numpy.eye(3) * REST_VELOCITY_SPREAD**2
        covariance[ATTITUDE, ATTITUDE] = turn.T @ numpy.diag((1.0, 1.0, unknown.heading**2)) @ turn
        pull: Matrix = turn.T @ numpy.array((0.0, 0.0, GRAVITY))
        px, py, pz = pull.tolist()
        sees = numpy.zeros((6, STATES))
        sees[:3, ATTITUDE] = skew((px, py, pz))
        sees[:3, ACCELEROMETER] = sees[3:, GYRO] = numpy.eye(3)
        told = correction(
            covariance,
            [fx - px, fy - py, fz - pz, *self._turn],
            numpy.diag(
                [noise.velocity**2 / self._seconds + REST_ACCELERATION_SPREAD**2] * 3
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
