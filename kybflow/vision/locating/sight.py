"""Observations of tags, and the equation that relates them to the body's pose.

A corner X of the world lies at b = R^T (X - p) in the body and at c = C^T (b - t) in the optical
frame, with p, R the body's pose and t, C the camera's mounting. Its pixel is
u = f (c_x / c_z, c_y / c_z). With R <- R exp([d]x), the derivatives of u with respect to p and d
are -G R^T and the rows g x b, where G = f/c_z [1, 0, -c_x/c_z; 0, 1, -c_y/c_z] C^T and g its rows.

A rolling shutter reads row y at dt = (y - (height - 1) / 2) row_time after the middle row. At that
time, with the body's velocity v and body rates w, b = exp(-[w dt]x) R^T (X - v dt - p), and the
derivatives with respect to w are the rows dt g x b. An error of 1 rad/s stretches the image by 1 %,
which looks like a tilt of many degrees; uncertain rates are therefore solved for as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray

from kybflow.core.geometry import ZERO, Quat, Vec3
from kybflow.vision.projection import rotation, undistort
from kybflow.world.calibration_errors import share_of
from kybflow.world.cameras import Camera
from kybflow.world.tags import Tag

Array = NDArray[Any]

Start = tuple[Vec3, Quat]
"""Position and attitude of the body."""


class BodyMotion(NamedTuple):
    """The motion of a body. velocity: in the world, m/s. rates: in the body, rad/s. doubt: standard
    deviation of the rates, rad/s; 0 if they are exact."""

    velocity: Vec3 = ZERO
    rates: Vec3 = ZERO
    doubt: float = 0.0


_SHARP = 1.0
AT_REST = BodyMotion()
NONE: Array = numpy.zeros(3)


class TagView(NamedTuple):
    """The tags that one camera saw. corners: (n, 4, 2) pixels in the order of `Tag.corners`; NaN
    for a corner outside the image."""

    camera: Camera
    tags: Sequence[Tag]
    corners: Array


class Sight:
    """A view, prepared for the equation.

    survey: standard deviation of a full-sized tag's position, metres. valid: (n, 4), which corners
    were seen. known: `valid` as numbers, (4 n, 1). world: (4 n, 3), positions of the corners,
    shifted against the body's motion since the middle row. flat: (4 n, 2), the observed corners,
    undistorted. late: (4 n, 1), seconds from the middle row to each corner's row.
    """

    def __init__(self, view: TagView, motion: BodyMotion, survey: float = 0.0) -> None:
        lens = view.camera.lens
        self.valid: Array = numpy.isfinite(view.corners).min(axis=2)
        self.known = self.valid.reshape(-1, 1).astype(float)
        corners = numpy.where(self.valid[..., None], view.corners, 0.0)
        rows = corners.reshape(-1, 2)[:, 1:]
        self.late = (rows - 0.5 * (lens.height - 1)) * view.camera.row_time
        self.world = numpy.array([tag.corners() for tag in view.tags]).reshape(-1, 3)
        self.world = self.world - self.late * motion.velocity
        self.rates = numpy.array(motion.rates)
        self.doubt = motion.doubt if view.camera.row_time > 0.0 else 0.0
        self.flat = undistort(lens, corners).reshape(-1, 2)
        self.focal = numpy.array((lens.fx, lens.fy))
        self._survey = survey * numpy.array([share_of(tag.size) for tag in view.tags])
        self.turn = rotation(view.camera.attitude)
        self.offset = numpy.array(view.camera.position)

    def residuals(self, at: Array, body: Array, more: Array = NONE) -> tuple[Array, Array, Array]:
        """Return the residuals (m, 2) in pixels, and the corners b and c (m, 3) in the body and the
        optical frame, from which `slopes` computes the derivatives. more: corrections of the
        expected rates."""
        b = (self.world - at) @ body
        rates = self.rates + more
        if rates.any():
            b = b - _cross(self.late * rates, b)
        c = (b - self.offset) @ self.turn
        depth = numpy.maximum(c[:, 2:], 1e-3)
        return (c[:, :2] / depth - self.flat) * (self.focal * self.known), b, c

    def slack(self, c: Array) -> Array:
        """Return each tag's uncertainty, (n,), in units of `_SHARP` pixels: the root sum of squares
        of its survey error and `_SHARP`."""
        depth = numpy.maximum(c[:, 2].reshape(-1, 4).mean(axis=1), 1e-3)
        slack: Array = numpy.hypot(1.0, self.focal[0] / _SHARP * self._survey / depth)
        return slack

    def slopes(self, body: Array, b: Array, c: Array) -> Array:
        """Return the derivatives of the residuals with respect to the pose, (m, 2, 6), or to pose
        and rates, (m, 2, 9), if the rates are uncertain."""
        depth = numpy.maximum(c[:, 2], 1e-3)
        g = numpy.zeros((len(c), 2, 3))
        g[:, 0, 0], g[:, 1, 1] = self.focal[0] / depth, self.focal[1] / depth
        g[:, :, 2] = -g[:, (0, 1), (0, 1)] * c[:, :2] / depth[:, None]
        g = g @ self.turn.T
        turned = _cross(g, b[:, None])
        parts = [-(g @ body.T), turned]
        if self.doubt > 0.0:
            parts.append(self.late[:, None] * turned)
        jacobian = numpy.concatenate(parts, axis=-1)
        jacobian *= self.known[:, None]
        return jacobian


def _cross(a: Array, b: Array) -> Array:
    """Return numpy.cross(a, b), five times as fast."""
    (ax, ay, az), (bx, by, bz) = numpy.moveaxis(a, -1, 0), numpy.moveaxis(b, -1, 0)
    return numpy.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-1)
