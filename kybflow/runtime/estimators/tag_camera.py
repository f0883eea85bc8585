"""State from printed tags in camera images, frame by frame, predicted to now.

Each frame gives the pose of the body (`kybflow.vision.locating.locator`). Tags are searched for
where the last poses predict them, at first where the vehicle starts. The poses give the motion
(`kybflow.flight.tracked_pose`), whose acceleration changes with the attitude until now. The rate at
which the body turns while a rolling shutter reads a frame is estimated together with the pose,
because the poses reveal it too late. Frames of several cameras with the same stamp give one pose
together. A frame that is not newer than the last frame with a pose is dropped.

A pose is accepted if it is where the motion predicts it, within

    gate + 4 spread + a t^2 / 2,   a = 5 m/s^2

after t seconds without another pose, and 45 degrees. Otherwise, if three tags or more agree on the
pose, the vehicle was carried there, and the filter starts again from it. With fewer tags the pose
is dropped, until such poses agree for 0.3 s at a position where the vehicle can be
(`kybflow.flight.pose_gate`). After `gap` seconds without a pose the filter starts again. There is
no estimate until `samples` poses have arrived.

age: the time since the newest frame with a pose was taken. spread, metres: the larger of the
running standard deviation of the innovation along an axis and the standard deviation of the last
pose. The latter includes the errors of lens, mount, map and stamps
(`kybflow.vision.locating.systematic`), which averaging over frames does not reduce.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from math import inf, sqrt
from operator import attrgetter
from typing import TYPE_CHECKING

from kybflow.core.geometry import ZERO, Vec3, from_heading
from kybflow.core.signals import NS, Estimate, Frame, Measurement, Pose, Time
from kybflow.core.units import Length
from kybflow.flight.pose_gate import ACCELERATION, LOOK_AHEAD, Bounds, PoseGate, Reference
from kybflow.flight.tracked_pose import TrackedParams, TrackedPose
from kybflow.parts import Estimator, param, params
from kybflow.vision import OPENCV
from kybflow.world.cameras import CalibrationErrors
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    from kybflow.vision.locating.locate import Located
    from kybflow.vision.locating.locator import Prediction

AGREEING_TAGS = 3
"""Number of tags that must agree on a pose for it to need no other evidence."""
POSITION_SPREAD, ATTITUDE_SPREAD, UNKNOWN_RATE = 0.01, 0.01, 0.5
"""Initial standard deviations of a prediction's position (m) and attitude (rad), and the standard
deviation of its rates (rad/s), with which that of the attitude grows."""
START_PLACE, START_TURN = 0.05, 0.05
"""Standard deviations of the declared start's position (m) and attitude (rad)."""


@params
class TagCameraParams(CalibrationErrors, TrackedParams):
    gate: Length = param(
        "Allowed distance of a pose from the predicted one, in addition to four times the spread "
        "and the effect of an unknown acceleration.",
        default=0.1, above=0.0, tightens="down",
    )  # fmt: skip


class TagCamera(Estimator[TagCameraParams]):
    needs = frozenset({Frame})
    needs_tags = True
    packages = OPENCV

    def __init__(self, params: TagCameraParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._track = TrackedPose(params, context.airframe.drag)
        self._gate = PoseGate()
        self._cameras = context.cameras
        self._start = (context.start, from_heading(context.heading))
        self._spread = 0.0
        if context.cameras:
            from kybflow.vision.locating.locator import Locator

            self._locator = Locator(context.tags, context.cameras, params.survey_error)

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        frames = [measured for measured in measurements if isinstance(measured, Frame)]
        for time, taken in groupby(frames, attrgetter("time")):
            if self._track.count == 0 or time > self._track.stamp:
                self._take(list(taken), time)
        estimate = self._track.estimate(now, "tag_camera")
        if estimate is None:
            return None
        return self._track.bent(estimate)._replace(spread=max(estimate.spread, self._spread))

    def _take(self, frames: Sequence[Frame], time: Time) -> None:
        for frame in frames:
            if frame.camera not in self._cameras:
                raise ValueError(f"the airframe has no camera `{frame.camera}`")
        t = (time - self._track.stamp) / NS
        prediction = self._predicted(time, t)
        located = self._locator.locate(frames, prediction)
        self.sighting = self._locator.sighting
        if located is None:
            return
        pose = Pose(time, located.position, located.attitude)
        velocity = self._velocity(pose, t, len(located.used) >= AGREEING_TAGS)
        self.refusal = self._gate.refusal
        if velocity is not None:
            self._spread = self._spread_of(located, prediction)
            self._track.take(pose, velocity)

    def _spread_of(self, located: Located, prediction: Prediction | None) -> float:
        """Return the standard deviation (m) of a pose's position along an axis."""
        from kybflow.vision.locating.locate import AT_REST
        from kybflow.vision.locating.systematic import systematic

        motion = AT_REST if prediction is None else prediction.motion
        slopes = systematic(located, tuple(self._cameras), motion, self.params).slopes[:3]
        variance = float(located.covariance[:3, :3].trace() + (slopes**2).sum())
        return sqrt(variance / 3.0)

    def _velocity(self, pose: Pose, t: float, is_sure: bool) -> Vec3 | None:
        """Return the velocity with which the filter starts if it starts at this pose, or None if
        the pose must be dropped. t: seconds since the last pose. is_sure: whether enough tags agree
        on the pose."""
        track, gate = self._track, self._gate
        if track.count == 0:
            return ZERO
        believed = track.predicted(track.stamp + round(min(t, LOOK_AHEAD) * NS), "")
        reference = Reference(track.stamp, believed.position, believed.attitude, track.spread, 0.0)
        bounds = Bounds(self.params.gate, inf, inf)
        if gate.passes(pose, reference, bounds):
            gate.passed(pose.time)
            return ZERO
        velocity = ZERO if is_sure else gate.opened(pose, reference, reference, bounds)
        if velocity is not None:
            track.restart()
        return velocity

    def _predicted(self, time: Time, t: float) -> Prediction | None:
        """Return the predicted pose of the vehicle when a frame is taken: the declared start before
        the first pose, None once the pose is unknown. t: seconds since the last pose."""
        from kybflow.vision.locating.locate import BodyMotion
        from kybflow.vision.locating.locator import Prediction

        track = self._track
        if track.count == 0:
            return Prediction(*self._start, BodyMotion(), START_PLACE, START_TURN)
        if t > self.params.gap:
            return None
        motion = track.bent(track.predicted(time, ""))
        return Prediction(
            motion.position,
            motion.attitude,
            BodyMotion(motion.velocity, motion.angular_velocity, UNKNOWN_RATE),
            POSITION_SPREAD + track.spread + 0.5 * ACCELERATION * t * t,
            ATTITUDE_SPREAD + UNKNOWN_RATE * t,
        )
