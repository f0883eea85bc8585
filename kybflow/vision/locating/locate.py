"""The body's pose from all tag corners that its cameras saw at one time.

A corner X of the world lies at b = R^T (X - p) in the body and at c = C^T (b - t) in the optical
frame, with p, R the body's pose and t, C the camera's mounting. Its pixel is
u = f (c_x / c_z, c_y / c_z). With R <- R exp([d]x), the derivatives of u with respect to p and d
are -G R^T and the rows g x b, where G = f/c_z [1, 0, -c_x/c_z; 0, 1, -c_y/c_z] C^T and g its rows.

A rolling shutter reads row y at dt = (y - (height - 1) / 2) row_time after the middle row. At that
time, with the body's velocity v and body rates w, b = exp(-[w dt]x) R^T (X - v dt - p), and the
derivatives with respect to w are the rows dt g x b. An error of 1 rad/s stretches the image by 1 %,
which looks like a tilt of many degrees; uncertain rates are therefore solved for as well.

This equation is solved from a start pose by Gauss-Newton with iterative reweighting, with one
weight per tag. Without a start pose, or if most tags don't fit the result, pairs of tags give start
poses (SQPnP; Terzakis and Lourakis, ECCV 2020), and the one that fits most tags is refined
(RANSAC). A single distant tag has two solutions (IPPE; Collins and Bartoli, IJCV 2014): the one
nearer to the start pose is used or, without a start pose, the more upright one if both fit.

With e the root mean square of a tag's residuals and s their median over the tags, the weight is
Huber's min(1, 2 s / e) at first, then Tukey's (1 - (e / 4 s)^2)^2, which rejects a tag whose
position in the map is wrong (Huber and Ronchetti, "Robust Statistics", 2009, ch. 7).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any, NamedTuple

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.core.geometry import ZERO, Quat, Vec3, from_axes
from kybflow.vision.projection import rotation, undistort
from kybflow.world.cameras import Camera, share_of
from kybflow.world.tags import Key, Tag

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

    def slopes(self, body: Array, b: Array, c: Array, size: int = 6) -> Array:
        """Return the derivatives of the residuals with respect to the pose, (m, 2, 6), or to pose
        and rates, (m, 2, 9). size: the number of unknowns, 6 or 9."""
        depth = numpy.maximum(c[:, 2], 1e-3)
        g = numpy.zeros((len(c), 2, 3))
        g[:, 0, 0], g[:, 1, 1] = self.focal[0] / depth, self.focal[1] / depth
        g[:, :, 2] = -g[:, (0, 1), (0, 1)] * c[:, :2] / depth[:, None]
        g = g @ self.turn.T
        turned = _cross(g, b[:, None])
        parts = [-(g @ body.T), turned]
        if size > 6:
            parts.append(self.late[:, None] * turned)
        jacobian = numpy.concatenate(parts, axis=-1)
        jacobian *= self.known[:, None]
        return jacobian


def _cross(a: Array, b: Array) -> Array:
    """Return numpy.cross(a, b), five times as fast."""
    (ax, ay, az), (bx, by, bz) = numpy.moveaxis(a, -1, 0), numpy.moveaxis(b, -1, 0)
    return numpy.stack((ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx), axis=-1)


_STEPS, _HUBER_STEPS = 12, 2
"""Largest number of iterations, and how many of them use Huber's weights."""
_MIN_STEP = 1e-5
"""Step below which the iteration stops, metres and radians."""
LEAST_ERROR, MOST_ERROR = 0.1, 3.0
"""Smallest assumed error of corners, and largest median error of a valid pose, pixels."""
_PRIOR, _PRIOR_WEIGHT = 0.3, 8.0
"""Prior error of a corner's coordinate, pixels, and the number of observed coordinates that the
prior counts for."""
_MAJORITY = 0.5


class Located(NamedTuple):
    """A body's pose. covariance: (6, 6), of the position in the world (m^2), then of the rotation
    in the body (rad^2). used: the tags with a positive weight. error: root mean square of their
    corners' residuals in pixels, divided by their slack (`Sight.slack`). views: all observations,
    including rejected tags."""

    position: Vec3
    attitude: Quat
    covariance: Array
    used: tuple[Key, ...]
    error: float
    views: Sequence[TagView]


class Fit(NamedTuple):
    """A solution. at, body: position, and rotation matrix from body to world. errors: root mean
    square residual of each tag in pixels, divided by its slack. weights: weight of each tag.
    counts: number of each tag's observed coordinates. normal: J^T W J of the pose, and of the body
    rates if they were solved for."""

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
            and numpy.median(self.errors) < MOST_ERROR
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
    """Return the solution by Gauss-Newton from a start pose. at: position. body: rotation matrix
    from body to world."""
    doubt, counts = max(sight.doubt for sight in sights), counted(sights)
    # (_PRIOR / standard deviation)^2 of the pose and, if they are solved for, of the body rates
    prior = numpy.array([0.0] * 6 + ([(_PRIOR / doubt) ** 2] * 3 if doubt > 0.0 else []))
    size = len(prior)
    step, more = numpy.full(size, numpy.inf), NONE
    for i in range(_STEPS):
        parts = [sight.residuals(at, body, more) for sight in sights]
        residuals = numpy.concatenate([part[0] for part in parts])
        slack = numpy.concatenate([s.slack(c) for s, (_, _, c) in zip(sights, parts, strict=True)])
        errors = numpy.sqrt(mean_squares(counts, residuals)) / slack
        weights = _weights(errors, convex=i < _HUBER_STEPS)
        slopes = [s.slopes(body, b, c, size) for s, (_, b, c) in zip(sights, parts, strict=True)]
        jacobian = numpy.concatenate(slopes).reshape(-1, size)
        weighted = jacobian * numpy.repeat(weights / slack**2, 8)[:, None]
        normal = weighted.T @ jacobian + numpy.diag(prior)
        if i >= _HUBER_STEPS and numpy.abs(step[:6]).max() < _MIN_STEP:
            break
        slope = weighted.T @ residuals.ravel()
        slope[6:] += prior[6:] * more[: size - 6]
        # a single damping suits metres and radians
        damped = normal + numpy.eye(size) * (1e-9 * float(numpy.trace(normal)) + 1e-9)
        step = numpy.linalg.solve(damped, -slope)
        at = at + step[:3]
        body = body @ cv2.Rodrigues(step[3:6])[0]
        more = more + step[6:] if size > 6 else more
    return Fit(at, body, errors, weights, counts, normal)


def counted(sights: Sequence[Sight]) -> Array:
    """Return the number of observed coordinates of each tag."""
    counts: Array = 2.0 * numpy.concatenate([sight.valid.sum(axis=1) for sight in sights])
    return counts


def mean_squares(counts: Array, residuals: Array) -> Array:
    """Return the mean square of each tag's residuals."""
    squares: Array = (residuals.reshape(-1, 8) ** 2).sum(axis=1) / numpy.maximum(counts, 1.0)
    return squares


def _weights(errors: Array, convex: bool) -> Array:
    scale = max(float(numpy.median(errors)), LEAST_ERROR)
    if convex:
        return numpy.minimum(1.0, 2.0 * scale / numpy.maximum(errors, scale))
    return numpy.maximum(1.0 - (errors / (4.0 * scale)) ** 2, 0.0) ** 2


_PAIRS = 24
_RIVAL = 2.0
"""A second pose of a single tag counts as equally good if its error is within this factor."""


def locate(
    views: Sequence[TagView],
    start: Start | None = None,
    motion: BodyMotion = AT_REST,
    survey: float = 0.0,
) -> Located | None:
    """Return the body's pose from views of one time; None if the tags don't determine it. start,
    motion: the expected pose and motion. survey: standard deviation of a full-sized tag's position,
    metres."""
    sights = [Sight(view, motion, survey) for view in views if len(view.tags)]
    if not sights:
        return None
    if start is not None:
        fit = refined(sights, numpy.array(start[0]), rotation(start[1]))
        if fit.is_sound and not _is_single_tag(sights):
            return fit.located(views)
    best = acquire(sights, start)
    return best.located(views) if best is not None and best.is_sound else None


def acquire(sights: Sequence[Sight], start: Start | None) -> Fit | None:
    """Return the pose that fits most tags, refined; None if no pose is found."""
    if _is_single_tag(sights):
        return _single_tag(sights, start)
    best, least, counts = None, numpy.inf, counted(sights)
    for at, body in _guesses(sights):
        residuals = numpy.concatenate([sight.residuals(at, body)[0] for sight in sights])
        squares = mean_squares(counts, residuals)
        cost = float(numpy.minimum(squares, (4.0 * MOST_ERROR) ** 2).sum())
        if cost < least:
            best, least = (at, body), cost
    return refined(sights, *best) if best is not None else None


def _is_single_tag(sights: Sequence[Sight]) -> bool:
    return len(sights) == 1 and len(sights[0].world) == 4


def _guesses(sights: Sequence[Sight]) -> Iterator[tuple[Array, Array]]:
    for sight in sights:
        tags = numpy.arange(len(sight.world)).reshape(-1, 4)
        for pair in islice(_pairs(len(tags)), _PAIRS):
            yield from _solved(sight, tags[list(pair)].ravel(), cv2.SOLVEPNP_SQPNP)


def _pairs(n: int) -> Iterator[tuple[int, ...]]:
    """Yield pairs of the indices of n items, starting with those far apart; a single item is
    yielded alone."""
    if n == 1:
        yield (0,)
    for gap in sorted(range(1, n // 2 + 1), key=lambda gap: -(gap % 3) * n - gap):
        yield from ((i, (i + gap) % n) for i in range(n if 2 * gap < n else gap))


def _solved(sight: Sight, chosen: Array, method: int) -> Iterator[tuple[Array, Array]]:
    """Yield the body's possible poses from some corners that one camera saw."""
    chosen = chosen[sight.valid.ravel()[chosen]]
    if len(chosen) < 4:
        return
    world, flat = sight.world[chosen], sight.flat[chosen]
    middle = world.mean(axis=0)
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            world - middle, flat[:, None], numpy.eye(3), None, flags=method
        )
    except cv2.error:  # collinear or too close corners
        return
    for turn, shift in zip(turns, shifts, strict=True):
        body = (sight.turn @ cv2.Rodrigues(turn)[0]).T
        at = middle - body @ (sight.turn @ shift.ravel() + sight.offset)
        if numpy.isfinite(at).all():
            yield at, body


def _single_tag(sights: Sequence[Sight], start: Start | None) -> Fit | None:
    """Return the pose from a single tag, which may have two solutions."""
    guesses = list(_solved(sights[0], numpy.arange(4), cv2.SOLVEPNP_IPPE))
    if start is not None:
        guesses.append((numpy.array(start[0]), rotation(start[1])))
    fits = [fit for fit in (refined(sights, *guess) for guess in guesses) if fit.is_sound]
    if not fits:
        return None
    least = min(float(fit.errors[0]) for fit in fits)
    rivals = [fit for fit in fits if fit.errors[0] <= _RIVAL * max(least, LEAST_ERROR)]
    if start is None:
        return max(rivals, key=lambda fit: float(fit.body[2, 2]))
    before = rotation(start[1])
    return max(rivals, key=lambda fit: float((fit.body * before).sum()))
