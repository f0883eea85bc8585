"""State from motion capture: pose by pose, velocities by a filtered derivative, predicted to now.

The filter is `kybflow.flight.tracked_pose`.

A pose whose stamp is not newer than the last one's is dropped, and so is one that is none (a lost
body: not finite, or no rotation). After a gap longer than `gap` the filter starts again, and until
`samples` poses have come there is no estimate. spread: running standard deviation of the innovation
along an axis, metres.

A pose that no flight explains is dropped as well (two bodies exchanged, a reflection taken for a
marker), so that the estimate ages and stops being healthy. Where the vehicle can have got to such
poses, and they agree for 0.3 s, they are right and what was believed is wrong, and the filter
starts again from them (`kybflow.flight.pose_gate`).
"""

from __future__ import annotations

from collections.abc import Sequence

from kybflow.core.geometry import ZERO, Vec3, add, distance, integrate, scale
from kybflow.core.signals import NS, Estimate, Measurement, Pose, Time
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
from kybflow.flight.tracked_pose import TrackedParams, TrackedPose
from kybflow.parts import Estimator, param, params
from kybflow.world.vehicle_context import VehicleContext


@params
class MocapParams(TrackedParams):
    gate: Length = param(
        "How far a pose may be from the predicted one, beside four times the spread and what an "
        "unknown acceleration explains.",
        default=0.1, above=0.0, tightens="down",
    )  # fmt: skip
    widest_gate: Length = param(
        "How far it may be at most, however long the last pose was ago.",
        default=0.5, above=0.0, tightens="down",
    )  # fmt: skip
    settled: Duration = param(
        "How long poses must have been consistent elsewhere, nothing else being flown on, before "
        "the vehicle counts as carried there; longer than any landing.",
        default=20.0, above=0.0,
    )  # fmt: skip


class Mocap(Estimator[MocapParams]):
    needs = frozenset({Pose})

    def __init__(self, params: MocapParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._track = TrackedPose(params, context.airframe.drag)
        self._gate = PoseGate()
        self._known = False

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for pose in measurements:
            if isinstance(pose, Pose) and _is_sound(pose):
                self._take(pose)
        estimate = self._track.estimate(now, "mocap")
        self._known = self._known or estimate is not None
        return estimate

    def anchor(self, estimate: Estimate) -> None:
        self._gate.flown = estimate

    def _take(self, pose: Pose) -> None:
        track, gate, time = self._track, self._gate, pose.time
        dt = (time - track.stamp) / NS
        if track.count > 0 and dt <= 0.0:
            return
        flown = gate.current(time)
        velocity = ZERO if flown is None else flown.velocity
        if track.count == 0 or (flown is None and self._is_near(pose, dt)):
            track.take(pose, velocity)
            if gate.refusal is not None:
                gate.passed(time)
        else:
            self._judge(pose, dt, flown, velocity)
        self.refusal = gate.refusal

    def _judge(self, pose: Pose, dt: float, flown: Estimate | None, velocity: Vec3) -> None:
        """Take a pose that is the vehicle; begin at it where nobody knew one yet, and where the
        gate opens for it."""
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
            track.count, velocity = 0, begun
        track.take(pose, velocity)

    def _is_near(self, pose: Pose, dt: float) -> bool:
        """Whether a pose is where it is predicted; decides nearly every pose at little cost."""
        track = self._track
        (x, y, z), (vx, vy, vz) = track.position, track.velocity
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
    (px, py, pz), (w, x, y, z) = pose.position, pose.attitude
    total = px + py + pz
    return total - total == 0.0 and 0.9 < w * w + x * x + y * y + z * z < 1.1
