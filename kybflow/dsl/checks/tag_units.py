"""Printed tags whose numbers can hardly be metres: KYB386."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.units import LENGTH, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.document import TagsUse
from kybflow.world.shapes import Box
from kybflow.world.tags import Tag

_LARGE = 2.0
"""Side of a black square, metres, that hardly anybody prints."""


def in_another_unit(case: Case) -> Iterator[Diagnostic]:
    """KYB386: tags that are larger than 2 m, or that lie further from the fence than it is long, as
    those do whose numbers are centimetres and have no unit (a warning)."""
    fence = case.document.fence
    for use in case.document.tags:
        index = next((i for i, tag in enumerate(use.tags) if tag.size > _LARGE), None)
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


def _strange(use: TagsUse, index: int, what: str, column: str) -> Diagnostic:
    tag = use.tags[index]
    hint = "give the number its unit, like `19.5 cm`, if it is no metres"
    if use.lines:
        hint = f"name the unit in the table's first line, like `{column} [cm]`, if it is no metres"
    return Diagnostic(
        "KYB386",
        f"tag {tag.id} of `{use.name.text}` {what}",
        use.span,
        label=f"in line {use.lines[index]} of it" if use.lines else "",
        help=hint,
        severity=Severity.WARNING,
    )
