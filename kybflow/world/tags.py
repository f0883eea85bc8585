"""Printed tags in the world, and the map of their poses.

A tag's frame has its origin at the centre, x to the right of the printed face, y up and z out of
the paper. A tag on the floor with heading 0 has the attitude LEVEL: its upper edge points north
(world y).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import floor
from typing import NamedTuple

from kybflow.core.geometry import Quat, Vec3, add, rotate

_CELL = 1.0
"""Side of a cell of the spatial index, metres."""

Key = tuple[str, int]
"""A tag's family and id."""


class Tag(NamedTuple):
    """A printed tag. family: its family, such as `36h11` (`kybflow.vision.tags`). size: the
    side of the black square, metres. position, attitude: the pose of its frame in the world."""

    family: str
    id: int
    size: float
    position: Vec3
    attitude: Quat

    @property
    def key(self) -> Key:
        """The family and id, which identify the tag."""
        return self.family, self.id

    def corners(self) -> tuple[Vec3, Vec3, Vec3, Vec3]:
        """Return the corners of the black square in the world, in OpenCV's order: upper left, upper
        right, lower right, lower left."""
        h = 0.5 * self.size
        at, turn = self.position, self.attitude
        return (
            add(at, rotate(turn, (-h, h, 0.0))),
            add(at, rotate(turn, (h, h, 0.0))),
            add(at, rotate(turn, (h, -h, 0.0))),
            add(at, rotate(turn, (-h, -h, 0.0))),
        )


class TagMap:
    """The world's tags in a spatial index, so that distant tags don't slow down a look-up. Raises
    ValueError if two tags have the same family and id."""

    def __init__(self, tags: Iterable[Tag]) -> None:
        self._tags: dict[Key, Tag] = {}
        self._cells: dict[tuple[int, int], list[Tag]] = {}
        for tag in tags:
            if tag.key in self._tags:
                raise ValueError(f"the tag {tag.id} of {tag.family} is listed twice")
            self._tags[tag.key] = tag
            self._cells.setdefault(_cell(tag.position[0], tag.position[1]), []).append(tag)
        self.families = tuple(sorted({tag.family for tag in self._tags.values()}))

    def __len__(self) -> int:
        return len(self._tags)

    def __iter__(self) -> Iterator[Tag]:
        return iter(self._tags.values())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TagMap) and self._tags == other._tags

    def __hash__(self) -> int:
        return hash(frozenset(self._tags))

    def get(self, family: str, id: int) -> Tag | None:
        """Return the tag, or None if the map doesn't contain it."""
        return self._tags.get((family, id))

    def near(self, x: float, y: float, radius: float) -> list[Tag]:
        """Return every tag whose centre is within `radius` (metres, horizontally) of (x, y), and
        possibly others nearby."""
        (left, low), (right, high) = _cell(x - radius, y - radius), _cell(x + radius, y + radius)
        cells = ((i, j) for i in range(left, right + 1) for j in range(low, high + 1))
        return [tag for cell in cells for tag in self._cells.get(cell, ())]


def _cell(x: float, y: float) -> tuple[int, int]:
    return floor(x / _CELL), floor(y / _CELL)
