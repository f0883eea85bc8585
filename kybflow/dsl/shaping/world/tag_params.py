"""What a mission says of printed tags, and the tags that it means.

A grid's columns go along its x, its rows along its y, the numbers along the columns first. `facing`
turns a grid or a tag to where its printed side looks: up with the upper edge to the north, or
upright to a side; then `heading` turns it about the world's z.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from typing import TYPE_CHECKING, Literal

from kybflow.core.files import File
from kybflow.core.geometry import (
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    add,
    from_axes,
    from_heading,
    multiply,
    rotate,
)
from kybflow.core.params import declared, param
from kybflow.core.units import Angle, Length, Position
from kybflow.dsl.shaping.world.tag_table import LARGEST, read_tags
from kybflow.vision.families import FAMILIES
from kybflow.world.tags import Tag

if TYPE_CHECKING:
    Family = str
else:
    Family = Literal[tuple(FAMILIES)]

Facing = Literal["up", "down", "east", "north", "west", "south"]
_NORTH: Vec3 = (0.0, 1.0, 0.0)
_UP: Vec3 = (0.0, 0.0, 1.0)
_EASTWARD = from_axes(_NORTH, _UP, (1.0, 0.0, 0.0))
_FACING: dict[str, Quat] = {
    "up": LEVEL,
    "down": from_axes((-1.0, 0.0, 0.0), _NORTH, (0.0, 0.0, -1.0)),
    "east": _EASTWARD,
    "north": multiply(from_heading(pi / 2), _EASTWARD),
    "west": multiply(from_heading(pi), _EASTWARD),
    "south": multiply(from_heading(-pi / 2), _EASTWARD),
}
"""Attitude of a tag with heading 0 whose printed side looks there."""
_HEADING = "Turned about the vertical by this, counter-clockwise from above."
_FACES = "Where the printed side looks; `up` has the upper edge to the north."


@declared
class GridParams:
    family: Family = param("Family of the tags.")
    count: tuple[int, ...] = param("How many: [columns, rows].", at_least=1)
    size: Length = param("Side of a tag's black square.", above=0.0, at_most=LARGEST)
    spacing: Length = param("Gap between the black squares.", at_least=0.0)
    first: int = param("Number of the first tag.", default=0, at_least=0)
    at: Position = param("Centre of the first tag, world frame.", default=ZERO)
    heading: Angle = param(_HEADING, default=0.0)
    facing: Facing = param(_FACES, default="up")
    rows: Literal["up", "down"] = param(
        "Where the rows go from the first tag: `up` to the tags' upper edges, or `down`.",
        default="up",
    )
    leave_out: tuple[int, ...] = param("Numbers that are missing on the floor.", default=())


@declared
class TagParams:
    family: Family = param("Family of the tag.")
    id: int = param("Its number.", at_least=0)
    size: Length = param("Side of its black square.", above=0.0, at_most=LARGEST)
    at: Position = param("Its centre, world frame.")
    heading: Angle = param(_HEADING, default=0.0)
    facing: Facing = param(_FACES, default="up")


@declared
class TagFile:
    file: File = param(
        "A table of tags: `family, id, size, x, y, z, heading [deg]`, a row a tag.",
        reads=read_tags,
    )


def tag_of(tag: TagParams) -> Tag:
    return Tag(tag.family, tag.id, tag.size, tag.at, _attitude(tag))


def tags_of(grid: GridParams) -> Iterator[Tag]:
    """The tags of a grid whose `count` has two numbers, those left out not among them."""
    (columns, rows), pitch = grid.count, grid.size + grid.spacing
    down = -pitch if grid.rows == "down" else pitch
    attitude, missing = _attitude(grid), frozenset(grid.leave_out)
    for row in range(rows):
        for column in range(columns):
            number = grid.first + row * columns + column
            if number not in missing:
                at = add(grid.at, rotate(attitude, (column * pitch, row * down, 0.0)))
                yield Tag(grid.family, number, grid.size, at, attitude)


def _attitude(params: GridParams | TagParams) -> Quat:
    return multiply(from_heading(params.heading), _FACING[params.facing])
