"""Tags as they are looked for in an image: points of them in the world, and which are in view."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray

from kybflow.vision.families import pattern
from kybflow.vision.locating.sight import Start
from kybflow.vision.projection import project
from kybflow.world.cameras import Camera
from kybflow.world.tags import Key, Tag

Array = NDArray[Any]

_MOST = 48
"""Tags at most that are looked for, the largest first; more make the pose no better."""
_MARGIN = 3.0
"""Pixels from the image's edge."""
_SMALLEST = 2.0
"""Pixels that a cell must have."""
_PLENTY, _CORNERS = 6, 2
_REMEMBERED = 2000
PROFILES = 12
ALONG = (numpy.arange(PROFILES) + 1.0) / (PROFILES + 1.0)
"""Where on a side its profiles are, in parts of its length."""
SHARE = numpy.concatenate(((0.0,), ALONG, (1.0,)))[:, None]


class Shape(NamedTuple):
    """A tag in the world. size: cells along a side. sides: (4, profiles + 2, 3) from corner to
    corner. cells: (k, 3), their centres. weights: (k, 4), how much of each corner's shift a cell
    shares. bits: (k,), the pattern with mean 0."""

    size: int
    sides: Array
    cells: Array
    weights: Array
    bits: Array


class Shapes:
    """The shapes of tags; remembers those that it was asked for."""

    def __init__(self) -> None:
        self._shapes: dict[Key, Shape] = {}

    def in_view(
        self, camera: Camera, pose: Start, tags: Iterable[Tag]
    ) -> tuple[list[Tag], list[Shape]]:
        """Those of `tags` that are wholly in the image, seen from the front, and large enough;
        where these are few, also those of which two corners are in it."""
        if len(self._shapes) > _REMEMBERED:
            self._shapes.clear()
        near = list(tags)
        shapes = [self._shape(tag) for tag in near]
        chosen = _largest(camera, pose, shapes) if near else ()
        return [near[i] for i in chosen], [shapes[i] for i in chosen]

    def _shape(self, tag: Tag) -> Shape:
        key = tag.key
        shape = self._shapes.get(key)
        if shape is None:
            shape = self._shapes[key] = _shaped(tag)
        return shape


def _shaped(tag: Tag) -> Shape:
    corners = numpy.array(tag.corners())
    sides = corners[:, None] * (1.0 - SHARE) + numpy.roll(corners, -1, axis=0)[:, None] * SHARE
    bits = pattern(tag.family, tag.id).astype(float)
    at = (numpy.arange(len(bits)) + 0.5) / len(bits)
    down, right = (grid.ravel() for grid in numpy.meshgrid(at, at, indexing="ij"))
    weights = numpy.stack(
        ((1 - right) * (1 - down), right * (1 - down), right * down, (1 - right) * down), axis=-1
    )
    return Shape(len(bits), sides, weights @ corners, weights, bits.ravel() - bits.mean())


def _largest(camera: Camera, pose: Start, shapes: Sequence[Shape]) -> Sequence[int]:
    corners = numpy.array([shape.sides[:, 0] for shape in shapes])
    pixels, visible = project(camera, *pose, corners)
    inside = visible & within(camera, pixels)
    (ax, ay), (bx, by) = (pixels[:, 2] - pixels[:, 0]).T, (pixels[:, 3] - pixels[:, 1]).T
    area = 0.5 * (ax * by - ay * bx)
    least = numpy.array([(shape.size * _SMALLEST) ** 2 for shape in shapes])
    large = visible.all(axis=1) & (area > least)
    whole = large & inside.all(axis=1)
    good = numpy.flatnonzero(
        whole if whole.sum() >= _PLENTY else large & (inside.sum(axis=1) >= _CORNERS)
    )
    largest = good[numpy.argsort(-area[good], kind="stable")][:_MOST]
    chosen: list[int] = largest.tolist()
    return chosen


def within(camera: Camera, pixels: Array) -> Array:
    """Which pixels (..., 2) are in the image, and not at its edge."""
    edge = (camera.lens.width - 1.0 - _MARGIN, camera.lens.height - 1.0 - _MARGIN)
    inside: Array = ((pixels >= _MARGIN) & (pixels <= edge)).min(axis=-1)
    return inside


def cell_sizes(sides: Array, shapes: Sequence[Shape]) -> Array:
    """The least size of a cell of each tag, pixels."""
    along = sides[:, :, -1] - sides[:, :, 0]
    least = numpy.hypot(along[..., 0], along[..., 1]).min(axis=1)
    size: Array = least / numpy.array([shape.size for shape in shapes])
    return size
