"""A node to one typed value in SI: what a parameter's `Field` says it must be."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

from kybflow.core.errors import UnitError
from kybflow.core.params import Field
from kybflow.core.units import Dimension, article, format_quantity, parse_quantity
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, did_you_mean
from kybflow.dsl.reading.attachments import file_of
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence, describe
from kybflow.dsl.reading.source import PREFIX

CODES = {
    "KYB104": "A value of another type, a quantity of another dimension or without its unit.",
    "KYB105": "A value outside its bounds.",
    "KYB109": "A value that is none of the choices.",
}
_LONGEST = 100
_POINT = re.compile(r"(?:world\.)?points?\.([A-Za-z_]\w*)\Z", re.ASCII)
_BARE = re.compile(r"[-+.\deE]+\Z", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d+\Z", re.ASCII)
_TRUTHS = {"true": True, "True": True, "false": False, "False": False}
_SHAPES = {
    "vector": "three numbers in a list, `[x, y, z]`",
    "path": "a list of points, `[[x, y, z], ...]`",
    "integer": "a whole number",
    "integers": "a list of whole numbers, `[1, 2]`",
    "boolean": "`true` or `false`",
    "file": "the name of a file",
    "file path": "the name of a file",
}


def quantity_field(name: str, dimension: Dimension, shape: str = "scalar", **bounds: Any) -> Field:
    """A required field of `dimension` that no part declares: a key of the language, a mission's
    parameter."""
    limits = {k: bounds.get(k) for k in ("above", "at_least", "below", "at_most")}
    return Field(
        name=name, shape=shape, dimension=dimension, choices=(), optional=False, required=True,
        default=None, help="", read_only=False, **limits,
    )  # fmt: skip


def decode(node: Node, field: Field, found: list[Diagnostic]) -> Any:
    """The value of `node`; None, and a finding, when it is none."""
    if field.shape == "vector":
        return _vector(node, field, found)
    if field.shape == "path":
        return _path(node, field, found)
    if field.shape == "integers":
        return _integers(node, field, found)
    if not isinstance(node, Scalar):
        found.append(_wrong(node, field))
        return None
    if len(node.text) > _LONGEST and field.shape not in ("text", "file", "file path"):
        found.append(
            Diagnostic("KYB104", f"`{node.text[:20]}...` is too long to be a value", node.span)
        )
        return None
    if field.shape == "scalar":
        return _quantity(node, field, found)
    if field.shape in ("file", "file path"):
        return file_of(node, field, found)
    return _plain(node, field, found)


def _quantity(node: Scalar, field: Field, found: list[Diagnostic]) -> float | None:
    assert field.dimension is not None
    try:
        value = parse_quantity(node.text, field.dimension)
    except UnitError as error:
        found.append(
            Diagnostic("KYB104", str(error), node.span, notes=origin(node), help=error.hint)
        )
        return None
    return value if _inside(value, node, field, found) else None


def _inside(value: float, node: Scalar, field: Field, found: list[Diagnostic]) -> bool:
    if field.outside(value) is None:
        return True
    message, hint = f"`{field.name}` must be {bounds_of(field)}", _way_inside(value, node, field)
    found.append(Diagnostic("KYB105", message, node.span, f"`{node.text}`", origin(node), hint))
    return False


def _way_inside(value: float, node: Scalar, field: Field) -> str:
    """The hint for a bare number that is inside of the bounds in a smaller unit, and for nothing,
    or less, where there must be something."""
    dimension, bare = field.dimension, node.text.strip()
    if dimension is None or not dimension.units:
        return ""
    for unit, factor in sorted(dimension.units.items(), key=lambda item: -item[1]):
        if _BARE.match(bare) and factor < 1.0 and field.outside(value * factor) is None:
            return f"did you mean `{bare} {unit}`?"
    fits = field.outside(parse_quantity(dimension.example, dimension)) is None
    return f"write it like `{dimension.example}`" if value <= 0.0 and fits else ""


def bounds_of(field: Field) -> str:
    """The bounds in words, in units: `above 0 m and at most 3 m`; empty when there are none."""
    words = {
        "above": field.above,
        "at least": field.at_least,
        "below": field.below,
        "at most": field.at_most,
    }
    return " and ".join(
        f"{word} {_shown(bound, field.dimension)}"
        for word, bound in words.items()
        if bound is not None
    )


def _shown(value: float, dimension: Dimension | None) -> str:
    return f"{value:g}" if dimension is None else format_quantity(value, dimension)


def origin(node: Scalar) -> tuple[str, ...]:
    """The note that says what stands for a parameter, where the report is not at that value."""
    shown = node.parameter and node.span.value is None
    return (f"`${node.parameter}` is `{node.text}`",) if shown else ()


def _vector(node: Node, field: Field, found: list[Diagnostic]) -> Any:
    if not isinstance(node, Sequence) or len(node.items) != 3:
        found.append(_wrong(node, field))
        return None
    numbers = [_number_of(item, field, found) for item in node.items]
    return None if None in numbers else tuple(numbers)


def _number_of(item: Node, field: Field, found: list[Diagnostic]) -> float | None:
    if isinstance(item, Scalar) and len(item.text) <= _LONGEST:
        return _quantity(item, field, found)
    found.append(
        Diagnostic("KYB104", f"a number is needed, but this is {describe(item)}", item.span)
    )
    return None


def _path(node: Node, field: Field, found: list[Diagnostic]) -> Any:
    if not isinstance(node, Sequence) or not node.items:
        found.append(_wrong(node, field))
        return None
    points = [_vector(item, field, found) for item in node.items]
    return None if None in points else tuple(points)


def _integers(node: Node, field: Field, found: list[Diagnostic]) -> Any:
    if not isinstance(node, Sequence):
        found.append(_wrong(node, field))
        return None
    one = replace(field, shape="integer")
    numbers = [decode(item, one, found) for item in node.items]
    return None if None in numbers else tuple(numbers)


def _plain(node: Scalar, field: Field, found: list[Diagnostic]) -> Any:
    text = node.text
    if field.shape == "text":
        return text
    if field.shape == "choice":
        if text in field.choices:
            return text
        found.append(
            Diagnostic(
                "KYB109",
                f"`{text}` is no choice for `{field.name}`",
                node.span,
                notes=origin(node),
                help=did_you_mean(text, field.choices),
            )
        )
        return None
    if field.shape == "boolean" and text in _TRUTHS:
        return _TRUTHS[text]
    if field.shape == "integer" and _INTEGER.match(text):
        value = int(text)
        return value if _inside(value, node, field, found) else None
    found.append(_wrong(node, field))
    return None


def _wrong(node: Node, field: Field) -> Diagnostic:
    dimension = field.dimension
    needed = _SHAPES.get(field.shape) or (article(dimension.name) if dimension else "one value")
    size = f" of {len(node.items)}" if isinstance(node, Sequence) else ""
    text = f" `{node.text[:_LONGEST]}`" if isinstance(node, Scalar) else ""
    message = f"`{field.name}` must be {needed}, but this is {describe(node)}{size}{text}"
    hint = "" if isinstance(node, Mapping) or dimension is None else _example(field, dimension)
    point = _POINT.match(node.text) if isinstance(node, Scalar) else None
    if point is not None and field.shape == "vector":
        hint = f"did you mean `{PREFIX}{point[1]}`?"
    return Diagnostic("KYB104", message, node.span, help=hint)


def _example(field: Field, dimension: Dimension) -> str:
    shape = {"vector": "[{0}, {0}, {0}]", "path": "[[{0}, {0}, {0}], ...]"}
    return f"write it like `{shape.get(field.shape, '{0}').format(dimension.example)}`"


def shown_value(value: Any, field: Field) -> str:
    """`value` (SI) as a person would write it; `none` for an optional one that is not set."""
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return f"[{', '.join(shown_value(item, field) for item in value)}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return _shown(value, field.dimension) if isinstance(value, float) else str(value)
