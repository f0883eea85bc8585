"""State from motion capture: pose by pose, velocities by a filtered derivative, predicted to now.

The filter is `kybflow.flight.tracked_pose`.

A pose is dropped if its stamp is not newer than the last one's, or if it is invalid, like that of a
lost body (not finite, or not a rotation). After a gap longer than `gap` the filter starts again,
and there is no estimate until `samples` poses have arrived. spread: running standard deviation of
the innovation along an axis, metres.

A pose that the vehicle can't have reached by flight is dropped as well (two bodies were exchanged,
or a reflection was mistaken for a marker), so that the estimate ages and is no longer healthy. If
the vehicle can have reached such poses, and they agree for 0.3 s, the poses are right and the state
is wrong: the filter starts again from them (`kybflow.flight.pose_gate`).

If IMU samples arrive at 125 Hz or more, which a tracker may request, they are used to estimate how
the body of motion capture is rotated relative to the vehicle, which disturbance accelerates the
vehicle (`_felt_force`), and how late poses are stamped (`_stamp_offset`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf

from kybflow.core.geometry import ZERO, Vec3, add, distance, integrate, multiply, scale
from kybflow.core.signals import NS, Estimate, Imu, Measurement, Pose, Time
from kybflow.core.units import Duration, Length
from kybflow.flight.pose_gate import (
    LOOK_AHEAD,
    UNKNOWN_PACE,
    Bounds,
    PoseGate,
    Reference,
    is_same,
    seen_from,
)
from kybflow.flight.tracked_pose import NO_PUSH, TrackedParams, TrackedPose
from kybflow.parts import Estimator, Objection, param, params
from kybflow.runtime.estimators._mocap_imu import FeltForce, ImuSums, StampOffset
from kybflow.world.vehicle_context import VehicleContext

MAX_SAMPLE_S = 0.0125
"""Longest interval (s) of usable IMU samples. Autopilots send instantaneous samples, 25 times a
second unless a tracker requests more, and their integral is late by half of that interval."""


@params
class MocapParams(TrackedParams):
    gate: Length = param(
        "Allowed distance of a pose from the predicted one, in addition to four times the spread "
        "and the effect of an unknown acceleration.",
        default=0.1, above=0.0, tightens="down",
    )  # fmt: skip
    widest_gate: Length = param(
        "Largest allowed distance, however old the last pose is.",
        default=0.5, above=0.0, tightens="down",
    )  # fmt: skip
    settled: Duration = param(
        "Time for which poses must agree on another place, without any other estimate in use, "
        "before the vehicle counts as carried there; longer than any landing.",
        default=20.0, above=0.0,
    )  # fmt: skip
    levelling: Duration = param(
        "Time constant of levelling the attitude by the accelerometer, if there is one; 0 to "
        "disable it.",
        default=5.0, at_least=0.0, read_only=True,
    )  # fmt: skip
    clock_memory: Duration = param(
        "Time constant of estimating the offset of the time stamps from the gyroscope, if there "
        "is one; 0 to disable it.",
        default=20.0, at_least=0.0, read_only=True,
    )  # fmt: skip


class Mocap(Estimator[MocapParams]):
    needs = frozenset({Pose})

    @classmethod
    def least_spread(cls, params: MocapParams, error: float) -> float:
        return error

    @classmethod
    def objections(cls, params: MocapParams, context: VehicleContext) -> Iterator[Objection]:
        gate = min(params.gate, params.widest_gate)
        others = (start for name, start in context.starts.items() if name != context.vehicle)
        near = min((distance(start, context.start) for start in others), default=inf)
        if gate >= near >= context.airframe.diameter:
            reason = f"lets the poses of another vehicle pass, which starts {near:.3g} m away"
            yield Objection("gate", reason, "write `gate: 10 cm`", is_doubt=True)

    def __init__(self, params: MocapParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._track = TrackedPose(params, context.airframe.drag)
        self._gate = PoseGate()
        loop, memory = context.loop, params.clock_memory
        self._sums = sums = ImuSums(loop.imu_delay if loop else 0.0)
        self._force = FeltForce(params.levelling, sums) if params.levelling else None
        self._clock = StampOffset(memory, sums) if memory else None
        self._known = False

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for measurement in measurements:
            if isinstance(measurement, Pose):
                if _is_sound(measurement):
                    self._take(measurement)
            elif isinstance(measurement, Imu) and measurement.dt <= MAX_SAMPLE_S:
                self._sums.take(measurement)
        estimate = self._track.estimate(now, "mocap")
        self._known = self._known or estimate is not None
        return estimate

    def anchor(self, estimate: Estimate) -> None:
        self._gate.flown = estimate

    def _take(self, pose: Pose) -> None:
        pose = self._corrected(pose)
        track, gate, time, force = self._track, self._gate, pose.time, self._force
        dt = (time - track.stamp) / NS
        if track.count > 0 and dt <= 0.0:
            return
        flown = gate.current(time)
        velocity = ZERO if flown is None else flown.velocity
        pushed = NO_PUSH if force is None else force.pushed
        if track.count == 0 or (flown is None and self._is_near(pose, dt)):
            track.take(pose, velocity, pushed)
            if gate.refusal is not None:
                gate.passed(time)
        else:
            self._judge(pose, dt, flown, velocity, pushed)
        if force is not None and track.stamp == time:
            force.look(time, track.velocity, track.attitude, track.rates, track.slope)
        self.refusal = gate.refusal

    def _corrected(self, pose: Pose) -> Pose:
        """Return a pose with its time and attitude corrected by the IMU."""
        force, clock = self._force, self._clock
        time, position, attitude = pose
        if clock is not None:
            clock.look(time, attitude)
            time -= round(clock.seconds * NS)
        if force is not None:
            attitude = multiply(attitude, force.turned)
        return Pose(time, position, attitude)

    def _judge(
        self,
        pose: Pose,
        dt: float,
        flown: Estimate | None,
        velocity: Vec3,
        pushed: tuple[float, float],
    ) -> None:
        """Process a pose that passes the gate. Restart the filter if the pose is the first one, or
        if the gate opens for it; drop it otherwise."""
        track, gate, p = self._track, self._gate, self.params
        bounds = Bounds(p.gate, p.widest_gate, p.settled)
        own = self._believed(dt)
        reference = own if flown is None else seen_from(flown, pose.time)
        if gate.passes(pose, reference, bounds):
            if gate.refusal is not None:
                gate.passed(pose.time)
        else:
            begun = gate.opened(pose, reference, own, bounds) if self._known else velocity
            if begun is None:
                return
            track.restart()
            velocity = begun
        track.take(pose, velocity, pushed)

    def _is_near(self, pose: Pose, dt: float) -> bool:
        """Return whether a pose is close to its prediction. This cheap test suffices for nearly
        every pose."""
        track = self._track
        x, y, z = track.position
        vx, vy, vz = track.velocity
        off = distance(pose.position, (x + dt * vx, y + dt * vy, z + dt * vz))
        return off < self.params.gate and dt < LOOK_AHEAD and is_same(pose.attitude, track.attitude)

    def _believed(self, dt: float) -> Reference:
        track = self._track
        ahead = min(dt, LOOK_AHEAD)
        return Reference(
            track.stamp,
            add(track.position, scale(track.velocity, ahead)),
            integrate(track.attitude, track.rates, ahead),
            track.spread,
            UNKNOWN_PACE if track.count < self.params.samples else 0.0,
        )


def _is_sound(pose: Pose) -> bool:
    px, py, pz = pose.position
    w, x, y, z = pose.attitude
    total = px + py + pz
    return total - total == 0.0 and 0.9 < w * w + x * x + y * y + z * z < 1.1
