"""The body's pose from a start: Gauss-Newton with iterated weights, a weight a tag.

With e the root mean square of a tag's residuals and s their median over the tags, the weight is
Huber's min(1, 2 s / e) at first, then Tukey's (1 - (e / 4 s)^2)^2, which leaves out a tag that is
wrong in the map (Huber and Ronchetti, "Robust Statistics", 2009, ch. 7).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.core.geometry import Quat, Vec3, from_axes
from kybflow.vision.locating.sight import NONE, Sight, TagView
from kybflow.world.tags import Key

Array = NDArray[Any]

_STEPS, _CONVEX = 12, 2
"""Iterations at most, and how many of them with Huber's weights."""
_DONE = 1e-5
"""Metres and radians."""
CALM, WILD = 0.1, 3.0
"""Pixels: the least error that corners are believed to have, and the largest with which they tell a
pose."""
_PRIOR, _PRIOR_WEIGHT = 0.3, 8.0
"""The error of a corner's coordinate, pixels, that is believed before any was seen, and how many
coordinates that counts for."""
_MAJORITY = 0.5


class Located(NamedTuple):
    """A body's pose. covariance: (6, 6), of the position in the world (m^2), then of the rotation
    in the body (rad^2). used: the tags that it rests on. error: of their corners' coordinates,
    root mean square, pixels. views: what it was made of, tags that were left out included."""

    position: Vec3
    attitude: Quat
    covariance: Array
    used: tuple[Key, ...]
    error: float
    views: Sequence[TagView]


class Fit(NamedTuple):
    """at, body: the pose. errors: of each tag, pixels. weights, counts: of each, and how many
    coordinates it has. normal: J^T W J of the pose, and of the rates where they were in doubt."""

    at: Array
    body: Array
    errors: Array
    weights: Array
    counts: Array
    normal: Array

    @property
    def is_sound(self) -> bool:
        held = self.weights > 0.0
        return bool(
            held.mean() > _MAJORITY
            and numpy.median(self.errors) < WILD
            and numpy.isfinite(self.at).all()
            and numpy.linalg.cond(self.normal) < 1e12
        )

    def located(self, views: Sequence[TagView]) -> Located:
        keys = [tag.key for view in views for tag in view.tags]
        shares = self.weights * self.counts
        total, square = float(shares.sum()), float(shares @ self.errors**2)
        free = total - min(6.0, 0.75 * total)
        variance = (square + _PRIOR_WEIGHT * _PRIOR**2) / (free + _PRIOR_WEIGHT)
        x, y, z = self.body.T.tolist()
        used = tuple(key for key, weight in zip(keys, self.weights, strict=True) if weight > 0.0)
        covariance = variance * numpy.linalg.inv(self.normal)[:6, :6]
        ax, ay, az = self.at.tolist()
        attitude = from_axes(tuple(x), tuple(y), tuple(z))
        error = (square / total) ** 0.5
        return Located((ax, ay, az), attitude, covariance, used, error, views)


def refined(sights: Sequence[Sight], at: Array, body: Array) -> Fit:
    """Gauss-Newton from a start."""
    prior, counts = _prior(sights), counted(sights)
    size = len(prior)
    step, more = numpy.full(size, numpy.inf), NONE
    for i in range(_STEPS):
        parts = [sight.residuals(at, body, more) for sight in sights]
        residuals = numpy.concatenate([part[0] for part in parts])
        errors = numpy.sqrt(mean_squares(counts, residuals))
        weights = _weights(errors, convex=i < _CONVEX)
        slopes = [_slopes(s, body, b, c, size) for s, (_, b, c) in zip(sights, parts, strict=True)]
        jacobian = numpy.concatenate(slopes).reshape(-1, size)
        weighted = jacobian * numpy.repeat(weights, 8)[:, None]
        normal = weighted.T @ jacobian + numpy.diag(prior)
        if i >= _CONVEX and numpy.abs(step[:6]).max() < _DONE:
            break
        slope = weighted.T @ residuals.ravel()
        slope[6:] += prior[6:] * more[: size - 6]
        step = _step(normal, slope)
        at = at + step[:3]
        body = body @ cv2.Rodrigues(step[3:6])[0]
        more = more + step[6:] if size > 6 else more
    return Fit(at, body, errors, weights, counts, normal)


def _prior(sights: Sequence[Sight]) -> Array:
    """What is known beforehand of what is solved for, 1 / variance in squared pixels: nothing of
    the pose, and something of the rates where those are in doubt."""
    doubt = max(sight.doubt for sight in sights)
    known = [(_PRIOR / doubt) ** 2] * 3 if doubt > 0.0 else []
    return numpy.array([0.0] * 6 + known)


def _slopes(sight: Sight, body: Array, b: Array, c: Array, size: int) -> Array:
    """The derivatives after all that is solved for; a global shutter's not after the rates."""
    slopes = sight.slopes(body, b, c)
    if slopes.shape[2] == size:
        return slopes
    return numpy.pad(slopes, ((0, 0), (0, 0), (0, size - slopes.shape[2])))


def counted(sights: Sequence[Sight]) -> Array:
    """How many coordinates of each tag were seen."""
    counts: Array = 2.0 * numpy.concatenate([sight.valid.sum(axis=1) for sight in sights])
    return counts


def mean_squares(counts: Array, residuals: Array) -> Array:
    """The mean square of each tag's residuals."""
    squares: Array = (residuals.reshape(-1, 8) ** 2).sum(axis=1) / numpy.maximum(counts, 1.0)
    return squares


def _step(normal: Array, slope: Array) -> Array:
    """normal step = -slope; metres and radians are near enough to each other for one damping."""
    damped = normal + numpy.eye(len(normal)) * (1e-9 * float(numpy.trace(normal)) + 1e-9)
    step: Array = numpy.linalg.solve(damped, -slope)
    return step


def _weights(errors: Array, convex: bool) -> Array:
    scale = max(float(numpy.median(errors)), CALM)
    if convex:
        return numpy.minimum(1.0, 2.0 * scale / numpy.maximum(errors, scale))
    return numpy.maximum(1.0 - (errors / (4.0 * scale)) ** 2, 0.0) ** 2
