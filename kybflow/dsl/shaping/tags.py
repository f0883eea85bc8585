"""`world.tags` to the printed tags that it means."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi
from typing import TypeVar

from kybflow.core.files import File
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
from kybflow.core.params import fields_of
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.document import TagsEntry
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, entries_of
from kybflow.dsl.reading.tag_table import read_tags
from kybflow.dsl.reading.values import decode
from kybflow.dsl.schema.world import GridParams, TagFile, TagParams
from kybflow.dsl.shaping.parts import params_of
from kybflow.vision.families import FAMILIES
from kybflow.world.tags import Tag

P = TypeVar("P")

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


def tags_in(node: Node | None) -> Diagnosed[tuple[TagsEntry, ...]]:
    """The entries of `world.tags`; one with errors is left out."""
    uses: list[TagsEntry] = []
    for name, entry in entries_of(node).items():
        kinds = {kind: e for kind, e in entries_of(entry.value).items() if kind in _KINDS}
        if len(kinds) != 1:
            what = " and ".join(f"a {kind}" for kind in kinds) or "nothing"
            message, hint = f"the tags `{name}` are {what}", "write one of `grid`, `tag` and `file`"
            yield Diagnostic("KYB380", message, entry.key.span, help=hint)
            continue
        ((kind, own),) = kinds.items()
        use = yield from _KINDS[kind](entry, own)
        if use is not None:
            uses.append(use)
    return tuple(uses)


def _grid(entry: MappingEntry, own: MappingEntry) -> Diagnosed[TagsEntry | None]:
    grid = yield from _decoded(GridParams, own)
    if grid is None or not isinstance(own.value, Mapping):
        return None
    spans = {key: inner.value.span for key, inner in own.value.entries.items()}
    if len(grid.count) != 2:
        message = f"`count` must be [columns, rows], but this is a list of {len(grid.count)}"
        yield Diagnostic("KYB382", message, spans["count"], help="write it like `[10, 10]`")
        return None
    last = grid.first + grid.count[0] * grid.count[1] - 1
    if not (yield from _has(grid.family, last, spans["count"])):
        return None
    if not (yield from _leaves_some(grid, last, spans)):
        return None
    return TagsEntry(entry.key.as_text, grid, tuple(tags_of(grid)), entry.key.span)


def _leaves_some(grid: GridParams, last: int, spans: dict[str, Span]) -> Diagnosed[bool]:
    """Whether what a grid leaves out is of it, and not all of it."""
    strange = [number for number in grid.leave_out if not grid.first <= number <= last]
    message = ""
    if strange:
        message = f"the grid has no tag {strange[0]} to leave out"
    elif len(set(grid.leave_out)) > last - grid.first:
        message = "the grid leaves out every tag"
    if message:
        hint = f"its tags are {grid.first} to {last}"
        yield Diagnostic("KYB382", message, spans["leave_out"], help=hint)
    return not message


def _tag(entry: MappingEntry, own: MappingEntry) -> Diagnosed[TagsEntry | None]:
    tag = yield from _decoded(TagParams, own)
    if tag is None or not isinstance(own.value, Mapping):
        return None
    if not (yield from _has(tag.family, tag.id, own.value.entries["id"].value.span)):
        return None
    return TagsEntry(entry.key.as_text, tag, (tag_of(tag),), entry.key.span)


def _file(entry: MappingEntry, own: MappingEntry) -> Diagnosed[TagsEntry | None]:
    file: File | None = yield from decode(own.value, fields_of(TagFile)[0])
    if file is None:
        return None
    rows = read_tags(file)
    tags, lines = tuple(row.tag for row in rows), tuple(row.line for row in rows)
    return TagsEntry(entry.key.as_text, TagFile(file=file), tags, own.value.span, lines)


def _has(family: str, number: int, span: Span) -> Diagnosed[bool]:
    most = FAMILIES[family][1] - 1
    if number > most:
        message, hint = f"{family} has no tag {number}", f"its tags are 0 to {most}"
        yield Diagnostic("KYB381", message, span, help=hint)
    return number <= most


def _decoded(cls: type[P], own: MappingEntry) -> Diagnosed[P | None]:
    if not isinstance(own.value, Mapping):
        return None
    return (yield from params_of(cls, own.value, own.key.text, own.key.span))


_KINDS = {"grid": _grid, "tag": _tag, "file": _file}


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
