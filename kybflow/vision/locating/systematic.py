"""Systematic errors of a pose from tags, due to errors of the lens, mount, map and time stamps.

The pose solves J^T W r = 0, so an error c that moves the corners by K dc moves the pose by

    dx = (J^T W J)^-1 J^T W K dc

(consider parameters; Bierman, "Factorization Methods for Discrete Sequential Estimation", 1977,
ch. VIII). Averaging over frames doesn't remove this error, because it is the same in the next
frame. The derivatives K are as follows, with u the corner relative to the image's centre in pixels,
n = u / f, and J_p the derivatives with respect to the position:

    focal length     u           first radial term   u |n|^2
    tag's position  -J_p         tag's heading      -J_p (z x its corner from its centre)

If the lens is displaced by dm on the body and its attitude is exp([r]x) times the assumed one, the
pose is off by R (dm + t x r) and the rotation r, with R the body's attitude and t the assumed
position of the lens. Frames that are stamped o too late give an earlier pose, off by -o v and -o w
with the velocity v and the body rates w.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray

from kybflow.flight.fusion.covariance import WANDERERS
from kybflow.vision.locating.locate import BodyMotion, Located, Sight, TagView
from kybflow.vision.projection import rotation
from kybflow.world.cameras import CalibrationErrors, share_of

Array = NDArray[Any]

_OF_CAMERA = 8
_NEAREST = 0.02
_ROUNDING = 1e-15


class Systematic(NamedTuple):
    """The effect of each error source on a pose. slopes: (6, 6 + 8 cameras + 1), errors of the pose
    in the order of its covariance, per standard deviation of each source: a square root of the
    covariance due to the map, then the focal length, radial term, position (3) and attitude (3) of
    each camera, then the time stamps. extent: distance after which the body sees other tags,
    metres."""

    slopes: Array
    extent: float


def systematic(
    located: Located, cameras: Sequence[str], motion: BodyMotion, errors: CalibrationErrors
) -> Systematic:
    """Return the systematic errors of a pose. cameras: the names of all the body's cameras."""
    at, body = numpy.array(located.position), rotation(located.attitude)
    used = frozenset(located.used)
    views: list[TagView] = []
    for view in located.views:
        held = [i for i, tag in enumerate(view.tags) if tag.key in used]
        if held:
            tags = [view.tags[i] for i in held]
            views.append(view._replace(tags=tags, corners=view.corners[held]))
    sights = [Sight(view, motion, errors.survey_error) for view in views]
    normal = numpy.zeros((6, 6))
    shares: list[tuple[TagView, Array, Array, Array]] = []
    for view, sight in zip(views, sights, strict=True):
        _, b, c = sight.residuals(at, body)
        jacobian = sight.slopes(body, b, c).reshape(-1, 8, 6)
        weighted = (jacobian / sight.slack(c)[:, None, None] ** 2).swapaxes(1, 2)
        normal += (weighted @ jacobian).sum(axis=0)
        shares.append((view, jacobian, weighted, c))
    pose_of = numpy.linalg.inv(normal)
    slopes = numpy.zeros((6, WANDERERS + _OF_CAMERA * len(cameras) + 1))
    of_map = [_of_map(*share[:3], errors) for share in shares]
    wide = pose_of @ numpy.concatenate(of_map, axis=1)
    slopes[:, :WANDERERS] = numpy.linalg.cholesky(wide @ wide.T + _ROUNDING * numpy.eye(6))
    for sight, (view, jacobian, weighted, c) in zip(sights, shares, strict=True):
        first = WANDERERS + _OF_CAMERA * cameras.index(view.camera.name)
        pulled = numpy.hstack(
            (
                _of_lens(sight, weighted, c, errors),
                (weighted @ jacobian).sum(axis=0) @ _of_mount(view, body, errors),
            )
        )
        slopes[:, first : first + _OF_CAMERA] += pose_of @ pulled
    slopes[:, -1] = -errors.stamp_error * numpy.array((*motion.velocity, *motion.rates))
    places = numpy.array([tag.position[:2] for view in views for tag in view.tags])
    return Systematic(slopes, max(_NEAREST, sqrt(float(places.var(axis=0).sum()))))


def _of_lens(sight: Sight, weighted: Array, c: Array, errors: CalibrationErrors) -> Array:
    flat = c[:, :2] / numpy.maximum(c[:, 2:], 1e-3)
    seen = flat * sight.focal * errors.focal_error
    bent = flat * sight.focal * (flat**2).sum(axis=1, keepdims=True) * errors.k1_error
    moved = numpy.stack((seen.reshape(-1, 8), bent.reshape(-1, 8)), axis=-1)
    pulled: Array = (weighted @ moved).sum(axis=0)
    return pulled


def _of_mount(view: TagView, body: Array, errors: CalibrationErrors) -> Array:
    """Return the error (6, 6) of a pose from this camera alone, per standard deviation of the
    position and attitude of its mount."""
    x, y, z = view.camera.position
    off = numpy.zeros((6, 6))
    off[:3, :3] = errors.mount_error * body
    off[:3, 3:] = errors.mount_misalignment * body @ ((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))
    off[3:, 3:] = errors.mount_misalignment * numpy.eye(3)
    return off


def _of_map(view: TagView, jacobian: Array, weighted: Array, errors: CalibrationErrors) -> Array:
    """Return the effect J^T W K of each tag's errors (position and heading), (6, 4 tags), per
    standard deviation."""
    share = numpy.array([share_of(tag.size) for tag in view.tags])[:, None]
    places = share * (errors.survey_error, errors.survey_error, errors.height_error)
    corners = numpy.array([tag.corners() for tag in view.tags])
    arms = corners - corners.mean(axis=1, keepdims=True)
    sideways = numpy.stack((-arms[..., 1], arms[..., 0], 0.0 * arms[..., 0]), axis=-1)
    moved = numpy.zeros((len(share), 8, 4))
    moved[:, :, :3] = -jacobian[:, :, :3] * places[:, None]
    by_place = jacobian[:, :, :3].reshape(-1, 4, 2, 3)
    turned = -(by_place @ sideways[..., None])[..., 0] * errors.survey_turn
    moved[:, :, 3] = turned.reshape(-1, 8)
    pulled: Array = (weighted @ moved).swapaxes(0, 1).reshape(6, -1)
    return pulled
