"""`world.tags` to the printed tags that it means."""

from __future__ import annotations

from typing import TypeVar

from kybflow.core.files import File
from kybflow.core.params import fields_of
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic
from kybflow.dsl.document import TagsUse
from kybflow.dsl.reading.nodes import Entry, Mapping, Node, entries_of
from kybflow.dsl.reading.source import Span
from kybflow.dsl.reading.values import decode
from kybflow.dsl.shaping.uses import params_of
from kybflow.dsl.shaping.world.tag_params import GridParams, TagFile, TagParams, tag_of, tags_of
from kybflow.dsl.shaping.world.tag_table import read_tags
from kybflow.vision.families import FAMILIES

P = TypeVar("P")

CODES = {
    "KYB380": "An entry of `tags` that is no grid, no tag and no file, or several of them.",
    "KYB381": "A number of a tag that its family doesn't have.",
    "KYB382": "A grid of tags that is none: its `count` is not two numbers, or it leaves out what "
    "it doesn't have, or everything.",
}


def tags_in(node: Node | None) -> Diagnosed[tuple[TagsUse, ...]]:
    """The entries of `world.tags`; one with errors is left out."""
    uses: list[TagsUse] = []
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


def _grid(entry: Entry, own: Entry) -> Diagnosed[TagsUse | None]:
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
    return TagsUse(entry.key.as_text, grid, tuple(tags_of(grid)), entry.key.span)


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


def _tag(entry: Entry, own: Entry) -> Diagnosed[TagsUse | None]:
    tag = yield from _decoded(TagParams, own)
    if tag is None or not isinstance(own.value, Mapping):
        return None
    if not (yield from _has(tag.family, tag.id, own.value.entries["id"].value.span)):
        return None
    return TagsUse(entry.key.as_text, tag, (tag_of(tag),), entry.key.span)


def _file(entry: Entry, own: Entry) -> Diagnosed[TagsUse | None]:
    file: File | None = yield from decode(own.value, fields_of(TagFile)[0])
    if file is None:
        return None
    rows = read_tags(file)
    tags, lines = tuple(row.tag for row in rows), tuple(row.line for row in rows)
    return TagsUse(entry.key.as_text, TagFile(file=file), tags, own.value.span, lines)


def _has(family: str, number: int, span: Span) -> Diagnosed[bool]:
    most = FAMILIES[family][1] - 1
    if number > most:
        message, hint = f"{family} has no tag {number}", f"its tags are 0 to {most}"
        yield Diagnostic("KYB381", message, span, help=hint)
    return number <= most


def _decoded(cls: type[P], own: Entry) -> Diagnosed[P | None]:
    if not isinstance(own.value, Mapping):
        return None
    return (yield from params_of(cls, own.value, own.key.text, own.key.span))


_KINDS = {"grid": _grid, "tag": _tag, "file": _file}
