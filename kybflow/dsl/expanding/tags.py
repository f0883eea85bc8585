"""`world.tags` to the printed tags that it means."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi

from kybflow.core.geometry import (
    LEVEL,
    UP,
    Quat,
    Vec3,
    add,
    from_axes,
    from_heading,
    multiply,
    rotate,
)
from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.reading.nodes import MappingEntry, entries_of, is_null
from kybflow.dsl.reading.tag_table import read_tags
from kybflow.dsl.world import GridParams, TagParams, Tags
from kybflow.vision.families import FAMILIES
from kybflow.world.tags import Tag

CODES = {
    "KYB380": "An entry of `tags` that is no grid, no tag and no file, or several of them.",
    "KYB381": "A number of a tag that its family doesn't have.",
    "KYB382": "A grid of tags that is none: its `count` is not two numbers, or it leaves out what "
    "it doesn't have, or everything.",
}


_NORTH: Vec3 = (0.0, 1.0, 0.0)
_EASTWARD = from_axes(_NORTH, UP, (1.0, 0.0, 0.0))
_FACING: dict[str, Quat] = {
    "up": LEVEL,
    "down": from_axes((-1.0, 0.0, 0.0), _NORTH, (0.0, 0.0, -1.0)),
    "east": _EASTWARD,
    "north": multiply(from_heading(pi / 2), _EASTWARD),
    "west": multiply(from_heading(pi), _EASTWARD),
    "south": multiply(from_heading(-pi / 2), _EASTWARD),
}
"""Attitude of a tag with heading 0 whose printed side looks there."""


def tags_of_entry(entry: MappingEntry, decoder: Decoder) -> Tags | None:
    """One entry of `world.tags` with the tags that it means; None, and a finding, where something
    is wrong with it."""
    name, found = entry.key, decoder.found
    entries = entries_of(entry.value)
    kinds = [kind for kind, own in entries.items() if kind in _KINDS and not is_null(own.value)]
    if len(kinds) != 1:
        what = " and ".join(f"a {kind}" for kind in kinds) or "nothing"
        hint = "write one of `grid`, `tag` and `file`"
        found.report("KYB380", f"the tags `{name.text}` are {what}", name.span, help=hint)
        return None
    tags: Tags | None = decoder.record(Tags, entry.value, name.span, name=name.text)
    if tags is None:
        return None
    if tags.file is not None:
        rows = read_tags(tags.file)
        lines = tuple(row.line for row in rows)
        span = tags.span_of("file")
        source = tags.source._replace(span=span)
        return tags.but(tags=tuple(r.tag for r in rows), lines=lines, source=source)
    if (grid := tags.grid) is not None and _is_grid(grid, found):
        return tags.but(tags=tuple(tags_of(grid)))
    if (one := tags.tag) is not None and _has(one.family, one.id, one.span_of("id"), found):
        return tags.but(tags=(tag_of(one),))
    return None


def _is_grid(grid: GridParams, found: Findings) -> bool:
    """Whether `count` and `leave_out` fit the grid and its family."""
    if len(grid.count) != 2:
        message = f"`count` must be [columns, rows], but this is a list of {len(grid.count)}"
        found.report("KYB382", message, grid.span_of("count"), help="write it like `[10, 10]`")
        return False
    last = grid.first + grid.count[0] * grid.count[1] - 1
    if not _has(grid.family, last, grid.span_of("count"), found):
        return False
    strange = [number for number in grid.leave_out if not grid.first <= number <= last]
    message = ""
    if strange:
        message = f"the grid has no tag {strange[0]} to leave out"
    elif len(set(grid.leave_out)) > last - grid.first:
        message = "the grid leaves out every tag"
    if message:
        hint = f"its tags are {grid.first} to {last}"
        found.report("KYB382", message, grid.span_of("leave_out"), help=hint)
    return not message


def _has(family: str, number: int, span: Span, found: Findings) -> bool:
    most = FAMILIES[family][1] - 1
    if number > most:
        message, hint = f"{family} has no tag {number}", f"its tags are 0 to {most}"
        found.report("KYB381", message, span, help=hint)
    return number <= most


_KINDS = ("grid", "tag", "file")


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
