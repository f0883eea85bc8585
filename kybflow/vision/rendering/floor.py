"""The floor in front of a simulated camera: its pattern, the tags on it, and the objects that cover
tags."""

from __future__ import annotations

import functools
import random
from math import sqrt
from typing import NamedTuple

import cv2
import numpy

from kybflow.core.geometry import add, rotate
from kybflow.vision.projection import Array, rotation
from kybflow.vision.rendering.shot import FLOOR, NO_MAP, ProjectionPlane
from kybflow.vision.tags import cells, pattern
from kybflow.world.tags import Key, Tag, TagMap

PAPER, INK = 255, 20
"""Grey levels of a print before the exposure."""
QUIET_ZONE = 1
"""Width of the white zone around the black square, cells."""
TEXEL = 0.004
"""The size of a cell of the floor's pattern, metres."""
_TEXELS = 1024
_GRAIN = 2.0
_FLUSH, _BUMP = 1e-9, 0.02
_RING = ((-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0))


class Cover(NamedTuple):
    """A round object on a tag. x, y: its centre from the tag's upper left corner, and radius: all
    as fractions of the tag's side. grey: its grey level."""

    x: float
    y: float
    radius: float
    grey: int


class Sheet:
    """The print of a tag.

    reach: radius of its paper, metres. outline: eight points around the paper in the world, (8, 3).
    on_floor: whether it lies on the floor, within `_BUMP`. plane: its plane, FLOOR if it is flush
    with the floor. to_cells: (2, 3), transforms points on that plane to cells right and down of the
    black square's upper left corner. draws: two random numbers in [0, 1): the tag is missing if the
    first is below the share of missing tags, and covered if the second is below the share of
    covered tags.
    """

    def __init__(self, tag: Tag, seed: int) -> None:
        chance = random.Random(f"{seed}/{tag.family}/{tag.id}")
        self.tag = tag
        self.cells = cells(tag.family)
        half = tag.size * (0.5 + QUIET_ZONE / self.cells)
        self.reach = half * sqrt(2.0)
        self.outline = numpy.array(
            [add(tag.position, rotate(tag.attitude, (half * x, half * y, 0.0))) for x, y in _RING]
        )
        axes = rotation(tag.attitude).T
        centre = numpy.array(tag.position)
        self.normal = axes[2]
        off = float(abs(self.outline[:, 2]).max())
        self.on_floor = bool(off < _BUMP and axes[2, 2] > 0.0)
        self.plane = FLOOR if self.on_floor and off < _FLUSH else ProjectionPlane(centre, axes)
        across = (
            axes[:2] @ self.plane.axes[:2].T * ((self.cells / tag.size,), (-self.cells / tag.size,))
        )
        shift = 0.5 * self.cells - across @ self.plane.axes[:2] @ (centre - self.plane.centre)
        self.to_cells = numpy.column_stack((across, shift))
        self.draws = (chance.random(), chance.random())
        place = (chance.uniform(0.25, 0.75), chance.uniform(0.25, 0.75))
        self.cover = Cover(*place, chance.uniform(0.2, 0.4), chance.randrange(40, 230))

    def faces(self, place: Array) -> bool:
        """Return whether the printed side is visible from a point."""
        return bool(self.normal @ (place - self.tag.position) > 0.0)

    def picture(self, texels: int, covered: bool) -> Array:
        """Return the black square with `texels` per cell, in a white frame of one texel."""
        return _picture(self.tag.family, self.tag.id, texels, self.cover if covered else None)


@functools.lru_cache(maxsize=128)
def _picture(family: str, id: int, texels: int, cover: Cover | None) -> Array:
    drawn = numpy.where(pattern(family, id) > 0, PAPER, INK).astype(numpy.uint8)
    side = len(drawn) * texels
    drawn = numpy.kron(drawn, numpy.ones((texels, texels), numpy.uint8))
    if cover is not None:
        centre = (round(cover.x * side), round(cover.y * side))
        cv2.circle(drawn, centre, round(cover.radius * side), cover.grey, cv2.FILLED)
    return numpy.pad(drawn, 1, constant_values=PAPER)


def swapped(tags: TagMap, share: float, seed: int) -> TagMap:
    """Return the map with a share of the tags of each size misplaced. The seed selects these tags;
    each takes the pose of the next one."""
    chance = random.Random(f"{seed}/misplaced")
    laid = {tag.key: tag for tag in tags}
    for size in sorted({tag.size for tag in tags}):
        same = [tag for tag in tags if tag.size == size]
        wrong = chance.sample(same, round(share * len(same)))
        for tag, other in zip(wrong, wrong[1:] + wrong[:1], strict=True):
            laid[tag.key] = tag._replace(position=other.position, attitude=other.attitude)
    return TagMap(laid.values())


class Floor:
    """The tags of a map and the floor below them. The same seed gives the same floor. Memory grows
    with the tags that have been in view, not with those of the map."""

    def __init__(
        self, tags: TagMap, seed: int, grey: float = 128.0, deviation: float = 5.0
    ) -> None:
        self._tags = tags
        self._seed = seed
        self._sheets: dict[Key, Sheet] = {}
        self._pattern = _pattern(seed, grey, deviation)

    def sheets(self, x: float, y: float, radius: float) -> list[Sheet]:
        """Return at least every tag whose centre is within `radius` of (x, y)."""
        near = list(self._tags.near(x, y, radius))
        for tag in near:
            if tag.key not in self._sheets:
                self._sheets[tag.key] = Sheet(tag, self._seed)
        return [self._sheets[tag.key] for tag in near]

    def image(self, places: Array, begin: Array) -> Array:
        """Return the grey levels of the bare floor at points, uint8. places: (height, width, 2),
        metres. begin: (2,), their smallest coordinates."""
        # the pattern is stored twice in each direction, so that most views fit without wrapping
        shift = -_TEXELS * numpy.floor(begin / TEXEL / _TEXELS)
        at = numpy.array(((1.0 / TEXEL, 0.0, shift[0]), (0.0, 1.0 / TEXEL, shift[1])))
        texels = cv2.transform(places, at)
        return cv2.remap(
            self._pattern, texels, NO_MAP, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
        )


def _pattern(seed: int, grey: float, deviation: float) -> Array:
    """Return periodic smooth noise, tiled 2 x 2."""
    noise = numpy.random.default_rng(seed).standard_normal((_TEXELS, _TEXELS))
    rim = 8 * round(_GRAIN)
    smooth = cv2.GaussianBlur(numpy.pad(noise, rim, mode="wrap"), (0, 0), _GRAIN)
    smooth = smooth[rim:-rim, rim:-rim]
    drawn = numpy.clip(grey + deviation * smooth / smooth.std(), 0.0, 255.0)
    return numpy.tile(drawn.round().astype(numpy.uint8), (2, 2))
