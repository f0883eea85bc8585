"""The filter's history: a late measurement is inserted at its time, and the IMU is replayed to now.

The covariance is predicted, and the state kept, every 40 ms and at every measurement; the nominal
state is predicted with every IMU sample. A late measurement is inserted into the list of
measurements, and everything after the last state before it is repeated, gate included, so that the
result is identical bit for bit in whatever order measurements arrive (Solà 2017, sec. 5-6, gives
the steps; the delay is handled by reprocessing, as in Bar-Shalom, Li and Kirubarajan, "Estimation
with Applications to Tracking and Navigation", 2001, sec. 6).

The IMU's noise is the declared one, or the one that its samples show (`vibration`). The gate
refuses a measurement if its innovation is larger than a share `refused` of true ones allows
(chi-square, ibid. sec. 5.4), if it is further from the predicted position than `widest` plus four
of its standard deviations, or more than 45 degrees from the predicted attitude.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Sequence
from math import exp, sqrt
from typing import NamedTuple

import numpy

from kybflow.core.geometry import ZERO, Quat, Vec3, add, distance, integrate, scale, sub
from kybflow.core.signals import IMU_TIMEOUT, NS, Imu, Time
from kybflow.flight.fusion.covariance import (
    STATES,
    WANDERERS,
    ImuNoise,
    Matrix,
    Nominal,
    Vibration,
    chi_square_bound,
    correction,
    predicted,
    reset,
    seen_with,
    widened,
)
from kybflow.flight.pose_gate import is_same

VIBRATION_PERIOD_NS = NS // 25
UNKNOWN_ACCELERATION, UNKNOWN_TURN = 3.0, 1.0
"""Standard deviations of the vehicle's unknown motion during a gap in the IMU samples, m/s^2 and
rad/s."""


class Fix(NamedTuple):
    """An external measurement of a position or a pose. noise: covariance of the position (3 x 3) or
    of the pose (6 x 6: position in the world, then rotation in the body). slopes: the systematic
    errors of a pose per unit of each cause (6 x m), None if there are none. extent: the distance
    over which the body moves until the varying causes have changed, metres."""

    time: Time
    position: Vec3
    attitude: Quat | None
    noise: Matrix
    slopes: Matrix | None = None
    extent: float = 1.0

    @property
    def deviation(self) -> float:
        """Standard deviation of the position along the worst axis, metres."""
        variance = self.noise if self.slopes is None else self.noise + self.slopes @ self.slopes.T
        return sqrt(max(variance.item(0, 0), variance.item(1, 1), variance.item(2, 2)))

    def innovation(self, nominal: Nominal, systematic: Matrix) -> list[float]:
        """Return the measured minus the predicted values, corrected by the estimated systematic
        errors. That of the attitude is the rotation vector in the body, as twice the tangent of
        half the angle, which `integrate` inverts exactly."""
        (mx, my, mz), (px, py, pz) = self.position, nominal.position
        moved = [mx - px, my - py, mz - pz]
        if self.attitude is None:
            return moved
        (w, x, y, z), (mw, nx, ny, nz) = nominal.attitude, self.attitude
        turned = w * mw + x * nx + y * ny + z * nz
        two = 2.0 / (turned if abs(turned) > 0.1 else 0.1)
        innovation = [
            *moved,
            two * (w * nx - x * mw - y * nz + z * ny),
            two * (w * ny + x * nz - y * mw - z * nx),
            two * (w * nz - x * ny + y * nx - z * mw),
        ]
        if self.slopes is None:
            return innovation
        off: list[float] = (self.slopes @ systematic).tolist()
        return [told - o for told, o in zip(innovation, off, strict=True)]


NOTHING: Matrix = numpy.zeros(0)


class FilterState(NamedTuple):
    """The filter at one time. fused: the time of the newest measurement in it. passed: the number
    of measurements that have passed since it began. doubted: the time since which every measurement
    has been refused, None if the last one passed. missed: the prediction for the last refused
    measurement. off: the distance of that measurement from its prediction, metres. systematic: the
    estimated causes of systematic errors, (m,). extent: that of the newest measurement."""

    nominal: Nominal
    covariance: Matrix
    fused: Time
    passed: int = 1
    doubted: Time | None = None
    missed: Nominal | None = None
    off: float = 0.0
    systematic: Matrix = NOTHING
    extent: float = 1.0

    @property
    def deviation(self) -> float:
        """Standard deviation of the position along the worst axis, metres."""
        variance = self.covariance.item
        return sqrt(max(variance(0, 0), variance(1, 1), variance(2, 2)))


class Belief(NamedTuple):
    """The predicted state at a time. rates: body rates, rad/s. spread, turned: standard deviations
    of position (m) and attitude (rad) along the worst axis. systematic: the estimated causes of
    systematic errors, (m,)."""

    nominal: Nominal
    rates: Vec3
    spread: float
    turned: float
    systematic: Matrix


class _Sample(NamedTuple):
    since: Time
    time: Time
    force: Vec3
    turn: Vec3
    noise: Matrix


class Replay:
    """The filter with its history.

    nominal: the newest nominal state. state: the state at the newest covariance. Both are None
    before `begin`. IMU samples must come in order; fixes may come in any order, up to the time of
    the newest sample.
    """

    def __init__(self, noise: ImuNoise, refused: float, widest: float, memory: Time) -> None:
        self.nominal: Nominal | None = None
        self.state: FilterState | None = None
        self._noise, self._widest, self._memory = noise.variances(), widest, memory
        self._vibration, self._felt = Vibration(noise), self._noise
        self._bounds = {size: chi_square_bound(refused, size) for size in (3, 6)}
        self._samples: list[_Sample] = []
        self._fixes: list[Fix] = []
        self._states: list[FilterState] = []

    def covers(self, time: Time) -> bool:
        """Return whether the IMU samples from `time` on are known."""
        return bool(self._samples) and self._samples[0].since <= time <= self._samples[-1].time

    def lacks(self, time: Time) -> bool:
        """Return whether IMU samples up to `time` have not arrived yet."""
        return not self._samples or time > self._samples[-1].time

    def add_imu(self, imu: Imu) -> None:
        """Predict by an IMU sample. A sample that isn't newer than the last is ignored."""
        samples = self._samples
        since = samples[-1].time if samples else imu.time - round(imu.dt * NS)
        if imu.time <= since:
            return
        self._vibration.add_imu(imu.specific_force, imu.angular_velocity, imu.dt)
        if since // VIBRATION_PERIOD_NS != imu.time // VIBRATION_PERIOD_NS:
            self._felt = self._vibration.noise.variances()
        sample = _Sample(since, imu.time, imu.specific_force, imu.angular_velocity, self._felt)
        samples.append(sample)
        if self.nominal is not None:
            self._advance(sample, ())
        if since // VIBRATION_PERIOD_NS != imu.time // VIBRATION_PERIOD_NS:
            self._forget(imu.time - self._memory)

    def begin(self, state: FilterState) -> None:
        """Start from `state`, at a time within the history, and discard the history before it."""
        self._states, self._fixes = [state], []
        self._replay(state)

    def add(self, fix: Fix) -> bool:
        """Insert a measurement. Return False if it is too old or already known."""
        assert self._states
        if fix.time <= self._states[0].nominal.time or not self.covers(fix.time):
            return False
        at = _key(fix)
        place = bisect_right(self._fixes, at, key=_key)
        if place and _key(self._fixes[place - 1]) == at:
            return False
        insort(self._fixes, fix, key=_key)
        while self._states[-1].nominal.time >= fix.time:
            self._states.pop()
        self._replay(self._states[-1])
        return True

    def at(self, time: Time) -> Belief | None:
        """Return the state at `time`, predicted from the last one before it; None before
        `begin`."""
        states, samples = self._states, self._samples
        if not states:
            return None
        place = bisect_right(states, time, key=lambda state: state.nominal.time)
        state = states[max(place - 1, 0)]
        nominal, turn = state.nominal, ZERO
        for sample in samples[bisect_right(samples, nominal.time, key=_time) :]:
            turn = sample.turn
            if sample.time >= time:
                break
            nominal = nominal.moved(sample.force, turn, sample.time)
        ahead = (time - nominal.time) / NS
        nominal = nominal._replace(
            time=time,
            position=add(nominal.position, scale(nominal.velocity, ahead)),
            attitude=integrate(nominal.attitude, sub(turn, nominal.gyro_bias), ahead),
        )
        turned = sqrt(float(state.covariance.diagonal()[6:9].max()))
        return Belief(
            nominal, sub(turn, nominal.gyro_bias), state.deviation, turned, state.systematic
        )

    def _replay(self, state: FilterState) -> None:
        self.state, self.nominal = state, state.nominal
        begin = state.nominal.time
        fixes = self._fixes[bisect_right(self._fixes, begin, key=_time) :]
        for sample in self._samples[bisect_right(self._samples, begin, key=_time) :]:
            count = bisect_right(fixes, sample.time, key=_time)
            self._advance(sample, fixes[:count])
            fixes = fixes[count:]

    def _advance(self, sample: _Sample, fixes: Sequence[Fix]) -> None:
        """Predict through an IMU sample, and fuse the fixes within its time."""
        self._noise = sample.noise
        for fix in fixes:
            self._move(sample, fix.time)
            self._settle()
            self._states.append(self._fuse(fix))
        self._move(sample, sample.time)
        if sample.since // VIBRATION_PERIOD_NS != sample.time // VIBRATION_PERIOD_NS:
            self._states.append(self._settle())

    def _move(self, sample: _Sample, time: Time) -> None:
        before = self.nominal
        assert before is not None
        if sample.time - sample.since <= IMU_TIMEOUT:
            self.nominal = before.moved(sample.force, sample.turn, time)
            return
        dt = (time - before.time) / NS
        there = add(before.position, scale(before.velocity, dt))
        self.nominal = before._replace(time=time, position=there)
        state, speed = self._settle(), UNKNOWN_ACCELERATION * dt
        covariance = widened(state.covariance, 0.5 * speed * dt, speed, UNKNOWN_TURN * dt)
        self.state = state._replace(covariance=covariance)

    def _settle(self) -> FilterState:
        """Predict the covariance up to the time of the nominal state."""
        state, nominal = self.state, self.nominal
        assert state is not None
        assert nominal is not None
        if nominal.time > state.nominal.time:
            kept = exp(-distance(nominal.position, state.nominal.position) / state.extent)
            covariance = predicted(state.covariance, state.nominal, nominal, self._noise, kept)
            systematic = state.systematic
            if len(systematic):
                systematic = numpy.append(kept * systematic[:WANDERERS], systematic[WANDERERS:])
            state = state._replace(nominal=nominal, covariance=covariance, systematic=systematic)
            self.state = state
        return state

    def _fuse(self, fix: Fix) -> FilterState:
        state = self._settle()
        nominal = state.nominal
        innovation = fix.innovation(nominal, state.systematic)
        sees = None if fix.slopes is None else seen_with(fix.slopes)
        told = correction(state.covariance, innovation, fix.noise, sees)
        off = distance(fix.position, nominal.position)
        if (
            told.distance <= self._bounds[len(innovation)]
            and off <= self._widest + 4.0 * fix.deviation
            and (fix.attitude is None or is_same(fix.attitude, nominal.attitude))
        ):
            self.nominal = nominal.corrected(told.error)
            covariance = reset(told.covariance, told.error)
            systematic = state.systematic + told.error[STATES:]
            state = FilterState(
                self.nominal, covariance, fix.time, state.passed + 1,
                systematic=systematic, extent=fix.extent,
            )  # fmt: skip
        else:
            doubted = fix.time if state.doubted is None else state.doubted
            state = state._replace(doubted=doubted, missed=nominal, off=off)
        self.state = state
        return state

    def _forget(self, before: Time) -> None:
        """Discard the history that no measurement later than `before` needs."""
        states, first = self._states, before
        if states:
            count = bisect_right(states, before, key=lambda state: state.nominal.time)
            del states[: max(count - 1, 0)]
            first = min(before, states[0].nominal.time)
        del self._samples[: bisect_right(self._samples, first, key=_time)]
        del self._fixes[: bisect_right(self._fixes, first, key=_time)]


def _time(event: Fix | _Sample) -> Time:
    return event.time


def _key(fix: Fix) -> tuple[Time, Vec3]:
    return fix.time, fix.position
