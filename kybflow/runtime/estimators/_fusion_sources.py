"""Converts measurements to fixes of the fusion: position, attitude and covariance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy

from kybflow.core.geometry import Vec3, add, conjugate, integrate, multiply, norm, scale, sub
from kybflow.core.signals import NS, Frame, Measurement, Pose, Position, Time
from kybflow.flight.fusion.covariance import Matrix
from kybflow.flight.fusion.params import FilterParams
from kybflow.flight.fusion.replay import Belief, Fix
from kybflow.flight.pose_gate import REACH_STEP, REACH_TURN
from kybflow.world.cameras import CalibrationErrors
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    from kybflow.vision.locating.locator import Prediction, Sighting

AVERAGING_S = 0.25
MAX_GAP_NS = NS // 20
"""The longest time between two successive poses, ns."""


class Jitter:
    """Measures the noise of poses by how far each is off the line through the two poses before it.

    With e the difference between a pose and its extrapolation from the last two, s the seconds
    between these, t the seconds after them, r = t / s, and white noise of each pose,

        var(e) = (1 + (1 + r)^2 + r^2) noise^2

    at any velocity; an acceleration a adds a t (t + s) / 2, less than 1 mm at 120 Hz. The variance
    is averaged over `AVERAGING_S`. A difference that no flight explains is a jump, not noise. After
    a gap, the measurement restarts. Motion capture doesn't report its noise (for noise learnt from
    innovations: R. Mehra, "Approaches to adaptive filtering", IEEE TAC 1972).

    position, attitude: the variances along and about each axis, m^2 and rad^2.
    """

    def __init__(self) -> None:
        self.position = self.attitude = 0.0
        self._last: Pose | None = None
        self._since: Time = 0
        self._moved: tuple[Vec3, Vec3] | None = None

    def see(self, pose: Pose) -> None:
        """Process a pose. A pose that isn't newer than the last is ignored."""
        last, before = self._last, self._moved
        since = 0 if last is None else pose.time - last.time
        if last is not None and since <= 0:
            return
        self._last, self._moved = pose, None
        if last is None or since > MAX_GAP_NS:
            return
        w, x, y, z = multiply(conjugate(last.attitude), pose.attitude)
        turned = scale((x, y, z), 2.0 if w >= 0.0 else -2.0)  # the short way round
        self._moved = moved, _ = sub(pose.position, last.position), turned
        if before is not None:
            r, dt = since / self._since, since / NS
            off, twist = sub(moved, scale(before[0], r)), sub(turned, scale(before[1], r))
            share = dt / ((AVERAGING_S + dt) * (1.0 + (1.0 + r) * (1.0 + r) + r * r))
            if norm(off) < REACH_STEP and norm(twist) < REACH_TURN:
                self.position += share * _mean_square(off) - dt / (AVERAGING_S + dt) * self.position
                self.attitude += (
                    share * _mean_square(twist) - dt / (AVERAGING_S + dt) * self.attitude
                )
        self._since = since


def _mean_square(v: Vec3) -> float:
    x, y, z = v
    return (x * x + y * y + z * z) / 3.0


MAX_POSITION = 1e5
"""Distance (m) from the origin beyond which a position is invalid."""

VARIANCE_RATIO = 4.0
"""Least ratio of the measured variance to the declared one at which the measured one is used."""

Read = Callable[[Sequence[Measurement]], list[Fix]]
Believed = Callable[[Time], Belief | None]
"""Returns the estimated state at a given time, or None if it is unknown."""
Saw = Callable[["Sighting | None"], None]


def source(
    params: FilterParams,
    errors: CalibrationErrors,
    context: VehicleContext,
    believed: Believed,
    saw: Saw,
) -> Read:
    """Return the function that reads the requested source's fixes and ignores other and invalid
    measurements.

    errors: the calibration errors of cameras and tags.
    believed: returns the estimated state at a given time.
    saw: is called with the sighting in each set of camera frames.
    """
    noises = [params.position_noise] * 3 + [params.attitude_noise] * 3
    noise: Matrix = numpy.diag(numpy.square(noises))
    if params.source == "tags":
        return _Tags(context, believed, noise, errors, saw).read
    read = _Poses(noise).read if params.source == "mocap" else partial(_position, noise[:3, :3])
    return lambda measured: [fix for m in measured if (fix := read(m)) is not None]


class _Poses:
    """Reads poses. Their covariance is the declared one, or the measured one if that is clearly
    larger."""

    def __init__(self, noise: Matrix) -> None:
        self._noise, self._jitter = noise, Jitter()
        self._position, self._attitude = VARIANCE_RATIO * noise[0, 0], VARIANCE_RATIO * noise[3, 3]

    def read(self, measured: Measurement) -> Fix | None:
        if not isinstance(measured, Pose):
            return None
        w, x, y, z = measured.attitude
        square = w * w + x * x + y * y + z * z
        if not 0.9 < square < 1.1 or not norm(measured.position) < MAX_POSITION:
            return None
        n = square**-0.5
        pose = Pose(measured.time, measured.position, (w * n, x * n, y * n, z * n))
        self._jitter.see(pose)
        noise, position, attitude = self._noise, self._jitter.position, self._jitter.attitude
        if position > self._position or attitude > self._attitude:
            found = numpy.repeat((position, attitude), 3)
            noise = numpy.diag(numpy.maximum(noise.diagonal(), found))
        return Fix(*pose, noise)


def _position(noise: Matrix, measured: Measurement) -> Fix | None:
    if not isinstance(measured, Position) or not norm(measured.spread) < MAX_POSITION:
        return None
    own: Matrix = numpy.diag(numpy.square(measured.spread))
    return _checked(Fix(measured.time, measured.position, None, own + noise))


class _Tags:
    """Reads camera frames. The frames of all cameras at one time give one pose together."""

    def __init__(
        self,
        context: VehicleContext,
        believed: Believed,
        noise: Matrix,
        errors: CalibrationErrors,
        saw: Saw,
    ) -> None:
        from kybflow.vision.locating.locator import Locator

        self._locator = Locator(context.tags, context.cameras, errors.survey_error)
        self._cameras = tuple(context.cameras)
        self._believed, self._noise, self._errors, self._saw = believed, noise, errors, saw
        self._slopes: Matrix | None = None

    def read(self, measured: Sequence[Measurement]) -> list[Fix]:
        frames = [frame for frame in measured if isinstance(frame, Frame)]
        times = dict.fromkeys(frame.time for frame in frames)
        fixes = (self._fix([f for f in frames if f.time == time], time) for time in times)
        return [fix for fix in fixes if fix is not None]

    def _fix(self, frames: Sequence[Frame], time: Time) -> Fix | None:
        from kybflow.vision.locating.locate import AT_REST
        from kybflow.vision.locating.systematic import systematic

        belief = self._believed(time)
        prediction = None if belief is None else self._predicted(belief)
        seen = self._locator.locate(frames, prediction)
        self._saw(self._locator.sighting)
        if seen is None:
            return None
        motion = AT_REST if prediction is None else prediction.motion
        self._slopes, extent = systematic(seen, self._cameras, motion, self._errors)
        noise = seen.covariance + self._noise
        return _checked(Fix(time, seen.position, seen.attitude, noise, self._slopes, extent))

    def _predicted(self, belief: Belief) -> Prediction:
        """Return the pose that is expected to be measured, including the systematic error of the
        last one."""
        from kybflow.vision.locating.locate import BodyMotion
        from kybflow.vision.locating.locator import Prediction

        where, rates, spread, turned, errs = belief
        position, attitude = where.position, where.attitude
        if self._slopes is not None:
            x, y, z, *turn = (self._slopes @ errs).tolist()
            position = add(position, (x, y, z))
            attitude = integrate(attitude, (turn[0], turn[1], turn[2]), 1.0)
        motion = BodyMotion(where.velocity, rates)
        return Prediction(position, attitude, motion, spread, turned)


def _checked(fix: Fix) -> Fix | None:
    return fix if norm(fix.position) < MAX_POSITION else None
