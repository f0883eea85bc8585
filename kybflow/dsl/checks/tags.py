"""Printed tags of the world: KYB383, KYB384 and KYB386."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, conjugate, distance, dot, multiply, rotate, sub
from kybflow.core.units import LENGTH, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Diagnostic, Severity
from kybflow.dsl.world import Tags
from kybflow.world.shapes import Box
from kybflow.world.tags import Key, Tag

_PLANE_DISTANCE = 0.005
"""Tags at most this far apart perpendicular to their faces, m, are in the same plane."""
_PARALLEL_COSINE = 0.999
_ROUNDING = 1e-6
_MOST_SHOWN = 8


class _Floor(NamedTuple):
    """An entry of `tags`: its tags, the side of the largest one, and the range of their centres (x,
    y), m."""

    use: Tags
    tags: list[Tag]
    size: float
    low: tuple[float, float]
    high: tuple[float, float]


def same_tag_twice(case: Case) -> Iterator[Diagnostic]:
    """KYB383: two tags of the world have the same family and number, so a camera can't tell them
    apart."""
    first: dict[Key, tuple[Tags, int]] = {}
    for use in case.plan.world.tags:
        doubled = [i for i, tag in enumerate(use.tags) if tag.key in first]
        for index, tag in enumerate(use.tags):
            first.setdefault(tag.key, (use, index))
        if not doubled:
            continue
        tag = use.tags[doubled[0]]
        other, index = first[tag.key]
        line = f", {_place(other, index)}" if other.lines else ""
        more = f", and {len(doubled) - 1} more" if len(doubled) > 1 else ""
        yield Diagnostic(
            "KYB383",
            f"tag {tag.id} of {tag.family} is in both `{use.name}` and `{other.name}`",
            use.span,
            label=f"{_place(use, doubled[0])}{more}" if use.lines else more.removeprefix(", "),
            notes=(f"first at {other.span.at}{line}",),
            help=_renumbered(use, case.plan.world.tags),
        )


def _place(use: Tags, index: int) -> str:
    return f"in line {use.lines[index]} of the table"


def _renumbered(use: Tags, every: tuple[Tags, ...]) -> str:
    family = use.tags[0].family
    taken = [t.id for other in every if other is not use for t in other.tags if t.family == family]
    free = max(taken) + 1
    if use.grid is not None:
        return f"number it from {free}: `first: {free}`"
    return f"the first free number is {free}"


def tags_that_overlap(case: Case) -> Iterator[Diagnostic]:
    """KYB384: the black squares of two tags overlap, in one plane and facing the same way."""
    floors = list(_floors(case.plan.world.tags))
    for index, under in enumerate(floors):
        for over in floors[index:]:
            pairs = list(_pairs(under, over))
            if pairs:
                yield _overlap(pairs, under.use, over.use)


def _floors(uses: tuple[Tags, ...]) -> Iterator[_Floor]:
    """Yield each entry of `tags` without the tags that an earlier entry also has."""
    known: set[Key] = set()
    for use in uses:
        own = [tag for tag in use.tags if tag.key not in known]
        known |= {tag.key for tag in own}
        if own:
            x, y, _ = zip(*(tag.position for tag in own), strict=True)
            size = max(tag.size for tag in own)
            yield _Floor(use, own, size, (min(x), min(y)), (max(x), max(y)))


def _overlap(pairs: list[tuple[Tag, Tag]], under: Tags, over: Tags) -> Diagnostic:
    a, b = pairs[0]
    covered = sorted({tag.id for tag, _ in pairs})
    more = f"; {len(pairs) - 1} more pairs" if len(pairs) > 1 else ""
    hint = "move one of the two"
    if under.grid is not None and under is not over and len(covered) <= _MOST_SHOWN:
        hint = f"move it, or leave out the covered tags of `{under.name}`: `leave_out: {covered}`"
    return Diagnostic(
        "KYB384",
        f"tag {b.id} of `{over.name}` overlaps tag {a.id} of `{under.name}`",
        over.span,
        label=f"centres {distance(a.position, b.position) * 100:.3g} cm apart{more}",
        notes=(f"`{under.name}` is at {under.span.at}",) if under is not over else (),
        help=hint,
    )


def _pairs(under: _Floor, over: _Floor) -> Iterator[tuple[Tag, Tag]]:
    """Yield the overlapping tags of two entries, or of one entry with itself. The tags of a grid
    never overlap each other. The search is by cells, because there may be thousands of tags."""
    reach = (under.size + over.size) / sqrt(2.0)
    is_one = under is over
    if is_one and under.use.grid is not None:
        return
    if any(low - reach > high for low, high in zip(under.low, over.high, strict=True)):
        return
    if any(low - reach > high for low, high in zip(over.low, under.high, strict=True)):
        return
    cells: dict[tuple[float, float], list[tuple[int, Tag]]] = {}
    for index, tag in enumerate(over.tags):
        cells.setdefault(_cell(tag, reach), []).append((index, tag))
    for first, a in enumerate(under.tags):
        i, j = _cell(a, reach)
        near = (cells.get((i + di, j + dj), ()) for di in (-1, 0, 1) for dj in (-1, 0, 1))
        for index, b in chain.from_iterable(near):
            if (not is_one or index > first) and overlap(a, b):
                yield a, b


def _cell(tag: Tag, side: float) -> tuple[float, float]:
    return tag.position[0] // side, tag.position[1] // side


def overlap(a: Tag, b: Tag) -> bool:
    """Return whether two squares in one plane that face the same way share more than an edge, by
    the separating axis theorem."""
    apart = sub(b.position, a.position)
    if distance(a.position, b.position) >= (a.size + b.size) / sqrt(2.0):
        return False
    turn = multiply(conjugate(a.attitude), b.attitude)
    across, facing = rotate(conjugate(a.attitude), apart), rotate(turn, (0.0, 0.0, 1.0))
    if facing[2] < _PARALLEL_COSINE or abs(across[2]) > _PLANE_DISTANCE:
        return False
    x, y = rotate(turn, (1.0, 0.0, 0.0)), rotate(turn, (0.0, 1.0, 0.0))
    axes: tuple[Vec3, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), x, y)
    return all(
        abs(dot(across, axis))
        < _half(a.size, axis) + _half(b.size, (dot(axis, x), dot(axis, y), 0.0)) - _ROUNDING
        for axis in axes
    )


def _half(size: float, axis: Vec3) -> float:
    """Return how far a square with this side reaches from its centre along `axis`, m."""
    return 0.5 * size * (abs(axis[0]) + abs(axis[1]))


_MAX_PRINT = 2.0
"""The side of a black square, m, above which it is hardly ever printed."""


def in_another_unit(case: Case) -> Iterator[Diagnostic]:
    """KYB386: tags are larger than 2 m, or further from the fence than it is long, probably because
    their numbers are centimetres without a unit (a warning)."""
    fence = case.plan.fence
    for use in case.plan.world.tags:
        index = next((i for i, tag in enumerate(use.tags) if tag.size > _MAX_PRINT), None)
        if index is not None:
            size = format_quantity(use.tags[index].size, LENGTH)
            yield _strange(use, index, f"has a side of {size}", "size")
            continue
        index = next((i for i, tag in enumerate(use.tags) if _is_far(tag, fence)), None)
        if index is not None:
            x, y, z = use.tags[index].position
            yield _strange(use, index, f"is far from the fence, at [{x:g}, {y:g}, {z:g}] m", "x")


def _is_far(tag: Tag, fence: Box | None) -> bool:
    if fence is None:
        return False
    pairs = list(zip(tag.position, fence.low, fence.high, strict=True))
    longest = max(high - low for _, low, high in pairs)
    return any(not low - longest <= at <= high + longest for at, low, high in pairs)


def _strange(use: Tags, index: int, what: str, column: str) -> Diagnostic:
    tag = use.tags[index]
    hint = "write the unit, such as `19.5 cm`, unless it is metres"
    if use.lines:
        hint = f"write the unit in the table's header, such as `{column} [cm]`, unless it is metres"
    return Diagnostic(
        "KYB386",
        f"tag {tag.id} of `{use.name}` {what}",
        use.span,
        label=_place(use, index) if use.lines else "",
        help=hint,
        severity=Severity.WARNING,
    )
