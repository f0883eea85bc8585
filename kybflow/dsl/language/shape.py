"""Check whether a file has the shape that the records declare, before `$name` and `like` are
resolved and parts are looked up. If it hasn't, `jsonschema` explains the errors with the schema of
the same records (ADR 22)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeGuard

from kybflow.core.errors import UnitError
from kybflow.core.params import (
    BOOLEAN,
    FILE,
    FILE_PATH,
    INTEGER,
    TEXT,
    Choice,
    Field,
    ListOf,
    MappingOf,
    Numbers,
    RecordOf,
    ValueType,
)
from kybflow.core.units import parse_quantity
from kybflow.dsl.language.schema import NAMES, PARAMETER, PLACE, TITLE_LENGTH
from kybflow.dsl.language.types import (
    CONDITION,
    EVENT,
    PHASE,
    REQUEST,
    SENSORS,
    STATE,
    TITLE,
    VERSION,
    AnyOf,
    PartOf,
    RecordLayout,
    UsesOf,
    layout_of,
    part_layout,
)
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence, entries_of, is_null, to_json

_JSON = {str: "string", bool: "boolean", int: "number", float: "number", type(None): "null"}


def has_shape(node: Node, cls: Any) -> bool:
    """Return whether a tree has the shape of a record."""
    return _is_laid_out(node, layout_of(cls))


def _is_laid_out(node: Node, layout: RecordLayout) -> bool:
    """Return whether a tree has the keys of a layout, with values of the right types."""
    if not isinstance(node, Mapping):
        return layout.part is not None and layout.part.word == "use" and _is_text(node)
    entries, keys = node.entries, layout.keys
    if len(entries) < layout.least:
        return False
    if "like" not in entries or "like" not in keys:
        lacking = (key not in entries or is_null(entries[key].value) for key in layout.needed)
        if any(lacking):
            return False
    for key, entry in entries.items():
        field, others = keys.get(key), layout.others
        if field is None:
            if layout.part is not None:
                continue
            if others is None or (isinstance(others, RecordOf) and not NAMES["name"].match(key)):
                return False
            field = Field(type=others)
        if not (is_null(entry.value) or _fits(entry.value, field.type, field)):
            return False
    return True


def _fits(node: Node, kind: ValueType, field: Field) -> bool:
    """Return whether a value has the type `kind`. field: has the bounds of the value."""
    judge = _ALONE.get(kind) or _JUDGES[type(kind)]
    return judge(node, kind, field)


def _is_text(node: Node, *_: Any) -> TypeGuard[Scalar]:
    return isinstance(node, Scalar) and isinstance(to_json(node), str)


def _is_parameter(node: Node) -> bool:
    return isinstance(node, Scalar) and PARAMETER.match(node.text) is not None


def _is_title(node: Node, *_: Any) -> bool:
    if not _is_text(node):
        return False
    return len(node.text) <= TITLE_LENGTH and NAMES["name"].match(node.text) is not None


def _is_phase(node: Node, *_: Any) -> bool:
    inside = [entry.value for entry in entries_of(node).values()]
    return _is_text(node) or (bool(inside) and all(is_null(n) or _is_text(n) for n in inside))


def _is_any_of(node: Node, kind: Any, _: Field) -> bool:
    if isinstance(node, Scalar):
        return _JSON[type(to_json(node))] in kind.kinds
    return ("object" if isinstance(node, Mapping) else "array") in kind.kinds


def _is_mapping(node: Node, kind: Any, field: Field) -> bool:
    if not isinstance(node, Mapping) or len(node.entries) < field.least:
        return False
    pattern = NAMES[field.names_like]
    return all(
        pattern.match(name) and (is_null(entry.value) or _fits(entry.value, kind.item, field))
        for name, entry in node.entries.items()
    )


def _is_list(node: Node, kind: Any, field: Field) -> bool:
    if not isinstance(node, Sequence) or len(node.items) < field.least:
        return False
    return all(_fits(item, kind.item, field) for item in node.items)


def _is_sensors(node: Node, kind: Any, field: Field) -> bool:
    if isinstance(node, Sequence):
        return bool(node.items) and _is_list(node, kind, field)
    return _fits(node, kind.item, field)


def _are_uses(node: Node, kind: Any, field: Field) -> bool:
    """Return whether each item is a use of a part, or only a stack."""
    if not isinstance(node, Sequence):
        return False
    for item in node.items:
        if isinstance(item, Mapping) and "stack" in item.entries:
            stack = item.entries["stack"].value
            if len(item.entries) > 1 or not (is_null(stack) or _is_text(stack)):
                return False
        elif not _fits(item, kind.item, field):
            return False
    return True


def _are_sized(node: Node, kind: Numbers, size: tuple[int | None, ...], field: Field) -> bool:
    if isinstance(node, Scalar):
        is_place = size == (3,) and field.shape != "matrix"
        if (PLACE if is_place else PARAMETER).match(node.text):
            return True
        return not size and _is_quantity(node, kind, field)
    if not size or not isinstance(node, Sequence) or not node.items:
        return False
    if size[0] not in (None, len(node.items)):
        return False
    return all(_are_sized(item, kind, size[1:], field) for item in node.items)


def _is_quantity(node: Scalar, kind: Numbers, field: Field) -> bool:
    """Return whether the node is a quantity. The bounds are checked only for a number without a
    unit."""
    if is_null(node) or isinstance(value := to_json(node), bool):
        return False
    try:
        number = parse_quantity(node.text, kind.dimension)
    except UnitError:
        return False
    return isinstance(value, str) or field.is_within(number)


def _is_whole(node: Node, _: Any, field: Field) -> bool:
    value = to_json(node)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return _is_parameter(node)
    return value == int(value) and field.is_within(value)


_Judge = Callable[[Node, Any, Field], bool]
_ALONE: dict[ValueType, _Judge] = {
    TEXT: _is_text, CONDITION: _is_text, EVENT: _is_text, STATE: _is_text, FILE: _is_text,
    FILE_PATH: _is_text, TITLE: _is_title, PHASE: _is_phase, SENSORS: _is_sensors,
    VERSION: lambda node, *_: (value := to_json(node)) == 1 and not isinstance(value, bool),
    REQUEST: lambda node, *_: bool(entries_of(node)) or _is_text(node),
    INTEGER: _is_whole,
    BOOLEAN: lambda node, *_: isinstance(to_json(node), bool) or _is_parameter(node),
}  # fmt: skip
_JUDGES: dict[type[ValueType], _Judge] = {
    Numbers: lambda node, kind, field: _are_sized(node, kind, kind.size, field),
    Choice: lambda node, kind, _: _is_text(node) and (
        node.text in kind.words or _is_parameter(node)
    ),
    ListOf: _is_list, MappingOf: _is_mapping,
    RecordOf: lambda node, kind, _: (kind.or_name and _is_text(node)) or has_shape(node, kind.cls),
    PartOf: lambda node, kind, _: _is_laid_out(node, part_layout(kind)),
    UsesOf: _are_uses, AnyOf: _is_any_of,
}  # fmt: skip
"""The function that checks a value of each type."""
