"""Measures the noise of poses: how far each is off the line through the two before it.

With e the difference of a pose from where the last two lead, t and s the seconds after and between
these, r = t / s, and the noise of each pose white,

    var(e) = (1 + (1 + r)^2 + r^2) noise^2

at any velocity; an acceleration a adds a t (t + s) / 2, at 120 Hz less than 1 mm. It is averaged
over `TIME`. A difference that no flight explains is a jump and no noise; after a gap the poses
begin anew. Motion capture does not report its noise (for noise learnt from innovations: R. Mehra,
"Approaches to adaptive filtering", IEEE TAC 1972).
"""

from __future__ import annotations

from kybflow.core.geometry import Quat, Vec3, conjugate, multiply, norm, scale, sub
from kybflow.core.signals import NS, Pose, Time
from kybflow.flight.pose_track import STEP, TURN

TIME = 0.25
GAP = NS // 20
"""The longest time between two successive poses."""


class Jitter:
    """position, attitude: the variances of poses along and about each axis, m^2 and rad^2."""

    def __init__(self) -> None:
        self.position = self.attitude = 0.0
        self._last: Pose | None = None
        self._since: Time = 0
        self._moved: tuple[Vec3, Vec3] | None = None

    def see(self, pose: Pose) -> None:
        """Process a pose; one that is not newer than the last is ignored."""
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
    """The rotation vector from `a` to `b`, which is short."""
    w, x, y, z = multiply(conjugate(a), b)
    return scale((x, y, z), 2.0 if w >= 0.0 else -2.0)
