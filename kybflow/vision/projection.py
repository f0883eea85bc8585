"""The pinhole camera with OpenCV's distortion: world points to pixels, and pixels to rays.

With (x, y) = (X/Z, Y/Z) in the optical frame and r^2 = x^2 + y^2, the distorted point is
x' = x s + 2 p1 x y + p2 (r^2 + 2 x^2), y' = y s + p1 (r^2 + 2 y^2) + 2 p2 x y, with
s = 1 + k1 r^2 + k2 r^4 + k3 r^6, and the pixel is (fx x' + cx, fy y' + cy) (Brown 1971, in the form
of OpenCV's module calib3d). Points are arrays of shape (..., 3), pixels (..., 2), float64.
"""

from __future__ import annotations

import functools
from math import inf, sqrt
from typing import Any

import numpy
from numpy.typing import NDArray

from kybflow.core.geometry import Quat, Vec3, add, multiply, rotate
from kybflow.world.cameras import Camera, Lens

Array = NDArray[Any]

_MIN_DEPTH = 1e-6
"""Smallest depth of a visible point, metres."""
_ROUNDING = 1e-12
_STEPS = 20


def matrix(lens: Lens) -> Array:
    """Return OpenCV's camera matrix, (3, 3)."""
    return numpy.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])


def coefficients(lens: Lens) -> Array:
    """Return OpenCV's distortion coefficients (k1, k2, p1, p2, k3), (5,)."""
    return numpy.array(lens.distortion)


def rotation(q: Quat) -> Array:
    """Return the rotation matrix of a unit quaternion, (3, 3): `rotation(q) @ v` is `rotate(q,
    v)`."""
    return numpy.array([rotate(q, axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]).T


def optical_pose(camera: Camera, position: Vec3, attitude: Quat) -> tuple[Vec3, Quat]:
    """Return the position of the lens and the attitude of its optical frame in the world, for a
    body at `position` with `attitude`."""
    return add(position, rotate(attitude, camera.position)), multiply(attitude, camera.attitude)


def project(
    camera: Camera, position: Vec3, attitude: Quat, points: Array
) -> tuple[Array, NDArray[numpy.bool_]]:
    """Return the pixels of world points seen from a body at `position` with `attitude`, and which
    of the points the lens can image: those in front of it and within its `reach`. The pixels of the
    other points are meaningless. Pixels may lie outside the image."""
    at, turn = optical_pose(camera, position, attitude)
    local = (numpy.asarray(points, float) - at) @ rotation(turn)
    depth = local[..., 2]
    before = depth > _MIN_DEPTH
    flat = local[..., :2] / numpy.where(before, depth, 1.0)[..., None]
    visible = before & ((flat**2).sum(axis=-1) < reach(camera.lens) ** 2)
    return distort(camera.lens, flat), visible


def distort(lens: Lens, flat: Array) -> Array:
    """Return the pixels of the points (X/Z, Y/Z) of the optical frame."""
    k1, k2, p1, p2, k3 = lens.distortion
    x, y = flat[..., 0], flat[..., 1]
    r2 = x * x + y * y
    s = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * s + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    v = y * s + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return numpy.stack((lens.fx * u + lens.cx, lens.fy * v + lens.cy), axis=-1)


def undistort(lens: Lens, pixels: Array) -> Array:
    """Return the points (X/Z, Y/Z) of the optical frame that pixels show. This inverts `distort` by
    Newton's method, up to rounding. A pixel that no ray reaches gives a point near the lens's
    `reach`."""
    scale, centre = (lens.fx, lens.fy), (lens.cx, lens.cy)
    goal = (numpy.asarray(pixels, float) - centre) / scale
    if not any(lens.distortion):
        return goal
    far = 0.999 * reach(lens)
    x, y = goal[..., 0], goal[..., 1]
    for _ in range(_STEPS):
        error = (distort(lens, numpy.stack((x, y), axis=-1)) - centre) / scale - goal
        if numpy.abs(error).max(initial=0.0) < _ROUNDING:
            break
        (xx, xy), (yx, yy) = slopes(lens, x, y)
        determinant = xx * yy - xy * yx
        dx = (yy * error[..., 0] - xy * error[..., 1]) / determinant
        dy = (xx * error[..., 1] - yx * error[..., 0]) / determinant
        shrink = numpy.minimum(1.0, far / numpy.maximum(numpy.hypot(x - dx, y - dy), _ROUNDING))
        x, y = (x - dx) * shrink, (y - dy) * shrink
    return numpy.stack((x, y), axis=-1)


def slopes(lens: Lens, x: Array, y: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return the derivatives of the distorted point (x', y') with respect to x and y."""
    k1, k2, p1, p2, k3 = lens.distortion
    r2 = x * x + y * y
    s = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    grow = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
    across = x * y * grow + 2.0 * (p1 * x + p2 * y)
    return (
        (s + x * x * grow + 2.0 * p1 * y + 6.0 * p2 * x, across),
        (across, s + y * y * grow + 6.0 * p1 * y + 2.0 * p2 * x),
    )


@functools.lru_cache(maxsize=64)
def reach(lens: Lens) -> float:
    """Return the radius |(X/Z, Y/Z)| up to which the radial distortion r s(r) increases. Beyond it
    the model folds back into the image and is invalid."""
    k1, k2, _, _, k3 = lens.distortion
    roots = numpy.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    folds = [float(root.real) for root in roots if abs(root.imag) < 1e-9 and root.real > 0.0]
    return sqrt(min(folds)) if folds else inf
