"""Which measurements the fusion believes, and when it begins anew; see its part for the rules."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, sqrt
from typing import TYPE_CHECKING

from kybflow.core.geometry import LEVEL, Quat
from kybflow.core.signals import NS, Estimate, Imu, Pose, Time
from kybflow.flight.fusion.covariance import Noise, Nominal
from kybflow.flight.fusion.replay import Replay
from kybflow.flight.fusion.start import Standstill, Unknown, begun
from kybflow.flight.fusion.values import Belief, Fix, State
from kybflow.flight.pose_gate import PoseGate, Reference, seen_from

if TYPE_CHECKING:
    from kybflow.runtime.estimators.fusion import FusionParams

NEAR = 0.2
"""How far from where it is believed a vehicle may be seen at least, metres."""


class Filter:
    """`is_known`: so many measurements fitted one another that there is an estimate."""

    def __init__(self, params: FusionParams, heading: float) -> None:
        p = params
        self._params, self._heading = p, heading
        self._noise = Noise(p.velocity_walk, p.attitude_walk, p.accelerometer_drift, p.gyro_drift)
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
    def state(self) -> State | None:
        return self._replay.state

    @property
    def is_known(self) -> bool:
        state = self._replay.state
        return state is not None and state.passed >= self._params.samples

    @property
    def spread(self) -> float:
        """Standard deviation of the position, metres, with what wanders, and with doubts."""
        state = self._replay.state
        assert state is not None
        return hypot(state.deviation, self._wander, state.off if self._doubts(state) else 0.0)

    def at(self, time: Time) -> Belief | None:
        """What is believed of `time`; None where nothing is."""
        return self._replay.at(time) if self.is_known else None

    def anchor(self, estimate: Estimate) -> None:
        """Another's estimate, on which the vehicle flies."""
        self._gate.flown = estimate

    def feel(self, imu: Imu) -> None:
        """Go on by an IMU sample."""
        self._replay.feel(imu)
        self._still.feel(imu)

    def take(self, fixes: Sequence[Fix], now: Time) -> None:
        """Take what was true before the newest IMU sample; the rest waits for it."""
        fixes, self._waiting = [*self._waiting, *fixes], []
        for fix in fixes:
            if self._replay.covers(fix.time):
                self._fuse(fix, self._gate.current(now))
            elif self._replay.lacks(fix.time) and abs(fix.time - now) <= self._memory:
                self._waiting.append(fix)

    def _fuse(self, fix: Fix, flown: Estimate | None) -> None:
        if flown is not None and not self._is_possible(fix, seen_from(flown, fix.time)):
            return
        if fix.attitude is None:
            self._wander = sqrt(self._params.position_wander) * fix.deviation
        state = self._replay.state
        if state is None:
            self._begin(fix, flown)
        elif self._replay.add(fix):
            state = self._replay.state
            assert state is not None
            if state.missed is not None and state.missed.time == fix.time:
                self._refused(fix, state, state.missed, flown)
            self._was_known = self._was_known or self.is_known

    def _refused(self, fix: Fix, state: State, missed: Nominal, flown: Estimate | None) -> None:
        """The newest measurement was; begin at it where the filter is to blame."""
        has_settled = self._gate.settled(_as_pose(fix, missed.attitude), self._params.settled)
        believed = Reference(state.fused, missed.position, missed.attitude, state.deviation, 0.0)
        may_be = flown is not None or self._is_possible(fix, believed)
        if not self._was_known or has_settled or (self._doubts(state) and may_be):
            self._begin(fix, flown)

    def _doubts(self, state: State) -> bool:
        since, last = state.doubted, state.missed
        return (
            since is not None and last is not None and last.time - since > self._params.doubt * NS
        )

    def _is_possible(self, fix: Fix, where: Reference) -> bool:
        beside, widest = 4.0 * fix.deviation, self._params.widest_gate
        pose = _as_pose(fix, where.attitude)
        return self._gate.passes(pose, where, min(NEAR, widest) + beside, widest + beside)

    def _begin(self, fix: Fix, flown: Estimate | None) -> None:
        nominal = self._replay.nominal
        if flown is not None:
            state = begun(fix, self._unknown, flown.attitude, flown.velocity)
        elif fix.attitude is None and self._still.holds(fix.time):
            state = self._still.begun(fix, self._unknown, self._noise, self._heading)
        elif fix.attitude is not None or nominal is not None:
            attitude = LEVEL if nominal is None else nominal.attitude
            state = begun(fix, self._unknown, attitude, None)
        else:
            return
        self._replay.begin(state)


def _as_pose(fix: Fix, believed: Quat) -> Pose:
    return Pose(fix.time, fix.position, fix.attitude or believed)
