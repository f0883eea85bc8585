"""Measures the noise of poses by how far each is off the line through the two poses before it.

With e the difference between a pose and its extrapolation from the last two, s the seconds between
these, t the seconds after them, r = t / s, and white noise of each pose,

    var(e) = (1 + (1 + r)^2 + r^2) noise^2

at any velocity; an acceleration a adds a t (t + s) / 2, less than 1 mm at 120 Hz. The variance is
averaged over `TIME`. A difference that no flight explains is a jump, not noise. After a gap, the
measurement starts anew. Motion capture doesn't report its noise (for noise learnt from innovations:
R. Mehra, "Approaches to adaptive filtering", IEEE TAC 1972).
"""

from __future__ import annotations

from kybflow.core.geometry import Quat, Vec3, conjugate, multiply, norm, scale, sub
from kybflow.core.signals import NS, Pose, Time
from kybflow.flight.pose_track import STEP, TURN

TIME = 0.25
GAP = NS // 20
"""The longest time between two successive poses, ns."""


class Jitter:
    """Measures the noise of a series of poses. position, attitude: the variances along and about
    each axis, m^2 and rad^2."""

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
        if last is None or since > GAP:
            return
        turned = _turn(last.attitude, pose.attitude)
        self._moved = moved, _ = sub(pose.position, last.position), turned
        if before is not None:
            r, dt = since / self._since, since / NS
            off, twist = sub(moved, scale(before[0], r)), sub(turned, scale(before[1], r))
            share = dt / ((TIME + dt) * (1.0 + (1.0 + r) * (1.0 + r) + r * r))
            if norm(off) < STEP and norm(twist) < TURN:
                self.position += share * _mean_square(off) - dt / (TIME + dt) * self.position
                self.attitude += share * _mean_square(twist) - dt / (TIME + dt) * self.attitude
        self._since = since


def _mean_square(v: Vec3) -> float:
    x, y, z = v
    return (x * x + y * y + z * z) / 3.0


def _turn(a: Quat, b: Quat) -> Vec3:
    """Return the short rotation vector from `a` to `b`."""
    w, x, y, z = multiply(conjugate(a), b)
    return scale((x, y, z), 2.0 if w >= 0.0 else -2.0)
