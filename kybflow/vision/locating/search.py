"""Search for tags where a pose predicts them, with corners accurate to a tenth of a pixel.

Profiles cross each side of a predicted tag from its black border outwards. First, all profiles of a
side together locate it, at the shift with the steepest step from dark to light. The shift is within
the prediction's error and at most 1.4 cells, where there is no other such edge: the border's inner
edge and the edge of the next tag are steps from light to dark. Then each profile locates the side
by the centroid of its steep part. A line is fitted to these positions (least squares, reweighted
once with Tukey's weights), and two lines intersect in a corner, so that a partly covered side does
no harm. All positions are measured as shifts from the prediction, which includes the lens's
distortion.

A tag is found if the correlation coefficient between its pattern and the grey levels of its cells,
sampled between these corners, is at least 0.8. Two tags of 36h11 correlate by 0.65 at most, in any
orientation; in the large ArUco families some correlate by up to 0.89, and only their positions
distinguish them.

There are no loops over tags: about 50 calls of NumPy and OpenCV handle any number of tags.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.vision.locating.locate import Start, TagView
from kybflow.vision.projection import project
from kybflow.vision.tags import pattern
from kybflow.world.cameras import Camera
from kybflow.world.tags import Key, Tag

Array = NDArray[Any]

_MOST_TAGS = 48
"""Largest number of tags to search for, the largest ones first; more don't improve the pose."""
_MARGIN = 3.0
"""Smallest distance of points from the image's edge, pixels."""
_MIN_CELL = 2.0
"""Smallest size of a cell, pixels."""
_PLENTY, _CORNERS = 6, 2
_REMEMBERED_TAGS = 2000
PROFILES = 12
ALONG = (numpy.arange(PROFILES) + 1.0) / (PROFILES + 1.0)
"""Positions of the profiles along a side, as fractions of its length."""
SHARE = numpy.concatenate(((0.0,), ALONG, (1.0,)))[:, None]


class Shape(NamedTuple):
    """The geometry of a tag, in the world frame. size: cells along a side. sides: points on
    each side from corner to corner, (4, profiles + 2, 3). cells: the cells' centres, (k, 3).
    weights: the effect of each corner's shift on each cell, (k, 4). bits: the pattern with mean 0,
    (k,)."""

    size: int
    sides: Array
    cells: Array
    weights: Array
    bits: Array


class Shapes:
    """The shapes of tags, cached by tag."""

    def __init__(self) -> None:
        self._shapes: dict[Key, Shape] = {}

    def in_view(
        self, camera: Camera, pose: Start, tags: Iterable[Tag]
    ) -> tuple[list[Tag], list[Shape]]:
        """Return the tags that are entirely in the image, seen from the front and large enough,
        with their shapes. If these are few, tags with only two corners in the image are returned as
        well."""
        if len(self._shapes) > _REMEMBERED_TAGS:
            self._shapes.clear()
        near = list(tags)
        if not near:
            return [], []
        shapes = [self._shape(tag) for tag in near]
        pixels, visible = project(
            camera, *pose, numpy.array([shape.sides[:, 0] for shape in shapes])
        )
        inside = visible & within(camera, pixels)
        ax, ay = (pixels[:, 2] - pixels[:, 0]).T
        bx, by = (pixels[:, 3] - pixels[:, 1]).T
        area = 0.5 * (ax * by - ay * bx)
        least = numpy.array([(shape.size * _MIN_CELL) ** 2 for shape in shapes])
        large = visible.all(axis=1) & (area > least)
        whole = large & inside.all(axis=1)
        good = numpy.flatnonzero(
            whole if whole.sum() >= _PLENTY else large & (inside.sum(axis=1) >= _CORNERS)
        )
        largest = good[numpy.argsort(-area[good], kind="stable")][:_MOST_TAGS]
        return [near[i] for i in largest], [shapes[i] for i in largest]

    def _shape(self, tag: Tag) -> Shape:
        shape = self._shapes.get(tag.key)
        if shape is not None:
            return shape
        corners = numpy.array(tag.corners())
        sides = corners[:, None] * (1.0 - SHARE) + numpy.roll(corners, -1, axis=0)[:, None] * SHARE
        bits = pattern(tag.family, tag.id).astype(float)
        at = (numpy.arange(len(bits)) + 0.5) / len(bits)
        down, right = (grid.ravel() for grid in numpy.meshgrid(at, at, indexing="ij"))
        up, left = 1.0 - down, 1.0 - right
        weights = numpy.stack((left * up, right * up, right * down, left * down), axis=-1)
        shape = Shape(len(bits), sides, weights @ corners, weights, bits.ravel() - bits.mean())
        self._shapes[tag.key] = shape
        return shape


def within(camera: Camera, pixels: Array) -> Array:
    """Return which pixels (..., 2) are in the image and not too near to its edge, (...)."""
    edge = (camera.lens.width - 1.0 - _MARGIN, camera.lens.height - 1.0 - _MARGIN)
    inside: Array = ((pixels >= _MARGIN) & (pixels <= edge)).min(axis=-1)
    return inside


def cell_sizes(sides: Array, shapes: Sequence[Shape]) -> Array:
    """Return the smallest size of a cell of each tag, pixels."""
    along = sides[:, :, -1] - sides[:, :, 0]
    least = numpy.hypot(along[..., 0], along[..., 1]).min(axis=1)
    size: Array = least / numpy.array([shape.size for shape in shapes])
    return size


_MAX_SHIFT = 1.4
"""Largest shift of a side, cells."""
_STEPS = 8
"""Samples of a profile to either side."""
_FINE_LENGTH, _FINE_LEAST, _FINE_MOST = 0.45, 1.5, 3.5
"""Half the length of a fine profile, cells; its limits, pixels."""
_ALIKE = 0.8
_LEAST_CORNERS, _LEAST_PROFILES, _LEAST_SHARE = 2, 4, 0.3
"""What must be visible of a tag that is partly outside the image: the number of its corners, the
number of profiles of each side at these corners, and the share of its cells."""
_MAX_GROWTH = 0.6
"""Largest difference between a tag's size and its prediction, cells."""
_ACROSS = numpy.linspace(-1.0, 1.0, 2 * _STEPS + 1)


class Search:
    """Searches for tags near their predicted positions."""

    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes

    def find(
        self, image: Array, camera: Camera, pose: Start, tags: Iterable[Tag], off: float
    ) -> tuple[TagView, int]:
        """Return the tags found in a grey image, seen from a body near `pose`, and how many should
        be visible. off: largest error of the prediction, pixels."""
        chosen, shapes = self._shapes.in_view(camera, pose, tags)
        if not chosen:
            return TagView(camera, (), numpy.empty((0, 4, 2))), 0
        sides = project(camera, *pose, numpy.stack([shape.sides for shape in shapes]))[0]
        cell = cell_sizes(sides, shapes)
        inside = within(camera, sides)
        shown = inside[:, :, 1:-1].sum(axis=2) >= _LEAST_PROFILES
        valid = inside[:, :, 0] & shown & numpy.roll(shown, 1, axis=1)
        profiles = inside[:, :, 1:-1].astype(numpy.float32)
        corners = _coarse(image, sides, profiles, numpy.minimum(off + 2.0, _MAX_SHIFT * cell))
        reach = numpy.clip(_FINE_LENGTH * cell, _FINE_LEAST, _FINE_MOST)
        shifts, grown = _fine(image, sides, profiles, _held(corners, valid), reach)
        alike = _likeness(image, camera, pose, shapes, _held(shifts, valid))
        grown[~valid.all(axis=1)] = 0.0
        good = (
            (alike >= _ALIKE) & (grown < _MAX_GROWTH * cell) & (valid.sum(axis=1) >= _LEAST_CORNERS)
        )
        seen = numpy.flatnonzero(good)
        found = numpy.where(valid[..., None], sides[:, :, 0] + shifts, numpy.nan)
        return TagView(camera, [chosen[i] for i in seen], found[seen]), len(chosen)


def _held(shifts: Array, valid: Array) -> Array:
    """Return the corners' shifts; an invisible corner gets the mean shift of its tag."""
    if valid.all():
        return shifts
    share = valid / numpy.maximum(valid.sum(axis=1, keepdims=True), 1)
    others = (shifts * share[..., None]).sum(axis=1, keepdims=True)
    return numpy.where(valid[..., None], shifts, others)


def _outward(sides: Array) -> Array:
    """Return the outward unit normals of the sides at the profiles, (n, 4, profiles, 2). Corners
    are clockwise in the image."""
    along = sides[:, :, 2:] - sides[:, :, :-2]
    normal = numpy.stack((along[..., 1], -along[..., 0]), axis=-1)
    unit: Array = normal / numpy.maximum(numpy.hypot(along[..., 0], along[..., 1]), 1e-9)[..., None]
    return unit


def _steps(image: Array, sides: Array, normals: Array, reach: Array) -> Array:
    """Return the slopes of the grey level along the profiles, (n, 4, profiles, samples - 2)."""
    across = (_ACROSS * reach[:, None])[:, None, None].astype(numpy.float32)
    at, out = sides[:, :, 1:-1].astype(numpy.float32), normals.astype(numpy.float32)
    x, y = (at[..., i, None] + out[..., i, None] * across for i in (0, 1))
    levels = _sampled(image, x.reshape(-1, x.shape[-1]), y.reshape(-1, x.shape[-1]))
    levels = levels.astype(numpy.float32).reshape(x.shape)
    slopes: Array = levels[..., 2:] - levels[..., :-2]
    return slopes


def _sampled(image: Array, x: Array, y: Array) -> Array:
    """Return interpolated grey levels at x, y, (m, k) float32; the image's edge is repeated
    outside."""
    levels: Array = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return levels


def _coarse(image: Array, sides: Array, profiles: Array, reach: Array) -> Array:
    """Return the corners' shifts, (n, 4, 2), from the shift of each side as a whole."""
    normals = _outward(sides)
    slopes = (_steps(image, sides, normals, reach) * profiles[..., None]).sum(axis=2)
    shift = _ACROSS[1:-1][slopes.argmax(axis=-1)] * reach[:, None] * profiles.any(axis=2)
    return _crossed(normals, shift, shift)


def _fine(
    image: Array, sides: Array, profiles: Array, corners: Array, reach: Array
) -> tuple[Array, Array]:
    """Return the corners' refined shifts, (n, 4, 2), and how much each tag's size differs from the
    prediction, (n,), pixels."""
    after = numpy.roll(corners, -1, axis=1)
    moved = sides + corners[:, :, None] * (1.0 - SHARE) + after[:, :, None] * SHARE
    normals = _outward(moved)
    slopes = _steps(image, moved, normals, reach)
    steep = numpy.maximum(slopes - 0.4 * slopes.max(axis=-1, keepdims=True), 0.0)
    mass = steep.sum(axis=-1) * profiles
    centroid = (steep @ _ACROSS[1:-1].astype(numpy.float32)) / numpy.maximum(mass, 1e-9)
    begin, end = _lines(centroid * reach[:, None, None], mass)
    shifts: Array = corners + _crossed(normals, begin, end)
    outward = ((shifts + numpy.roll(shifts, -1, axis=1)) * normals.mean(axis=2)).sum(axis=-1)
    grown = 0.5 * numpy.abs(outward[:, :2] + outward[:, 2:]).max(axis=1)
    return shifts, grown


def _lines(shift: Array, mass: Array) -> tuple[Array, Array]:
    """Fit a line to the shifts of an edge along each side of a tag, one shift for each profile of
    brightness across the side, and return the line's values at both ends of the side."""
    weights = mass / numpy.maximum(mass.max(axis=-1, keepdims=True), 1e-9)
    for again in (True, False):
        s0, s1, s2 = (weights @ ALONG**k for k in (0, 1, 2))
        t0, t1 = (weights * shift).sum(axis=-1), (weights * shift) @ ALONG
        determinant = numpy.maximum(s0 * s2 - s1 * s1, 1e-9)
        at_zero = (s2 * t0 - s1 * t1) / determinant
        slope = (s0 * t1 - s1 * t0) / determinant
        if again:
            errors = numpy.abs(shift - at_zero[..., None] - slope[..., None] * ALONG)
            scale = numpy.maximum(numpy.median(errors, axis=-1, keepdims=True), 0.05)
            weights = weights * numpy.maximum(1.0 - (errors / (4.5 * scale)) ** 2, 0.0) ** 2
    return at_zero, at_zero + slope


def _crossed(normals: Array, begin: Array, end: Array) -> Array:
    """Return the corners' shifts, at the intersections of the shifted sides. begin, end: the shift
    of each side at its ends, along its normal."""
    first, before = normals[:, :, 0], numpy.roll(normals[:, :, -1], 1, axis=1)
    a, b = begin, numpy.roll(end, 1, axis=1)
    determinant = first[..., 0] * before[..., 1] - first[..., 1] * before[..., 0]
    safe = numpy.where(numpy.abs(determinant) < 0.05, 1.0, determinant)
    x = (a * before[..., 1] - b * first[..., 1]) / safe
    y = (b * first[..., 0] - a * before[..., 0]) / safe
    return numpy.stack((x, y), axis=-1)


def _likeness(
    image: Array, camera: Camera, pose: Start, shapes: Sequence[Shape], shifts: Array
) -> Array:
    """Return the correlation between each tag's cells and its pattern, (n,); 0 if too few of its
    cells are in the image."""
    sizes = [len(shape.bits) for shape in shapes]
    starts = numpy.concatenate(((0,), numpy.cumsum(sizes)[:-1]))
    owner = numpy.repeat(numpy.arange(len(shapes)), sizes)
    pixels, _ = project(camera, *pose, numpy.concatenate([shape.cells for shape in shapes]))
    weights = numpy.concatenate([shape.weights for shape in shapes])
    at = (pixels + (weights[:, None] @ shifts[owner])[:, 0]).astype(numpy.float32)
    soft = cv2.blur(image, (3, 3))
    levels = _sampled(soft, at[:, :1].copy(), at[:, 1:].copy()).ravel().astype(float)
    inside = within(camera, at).astype(float)
    count = numpy.add.reduceat(inside, starts)
    both = [numpy.concatenate([shape.bits for shape in shapes]), levels]
    for i, values in enumerate(both):
        mean = numpy.add.reduceat(values * inside, starts) / numpy.maximum(count, 1.0)
        both[i] = (values - mean[owner]) * inside
    cross, bits, greys = (
        numpy.add.reduceat(a * b, starts) for a, b in (both, both[:1] * 2, both[1:] * 2)
    )
    alike: Array = cross / numpy.sqrt(numpy.maximum(bits * greys, 1e-9))
    return numpy.where(count >= _LEAST_SHARE * numpy.array(sizes), alike, 0.0)
