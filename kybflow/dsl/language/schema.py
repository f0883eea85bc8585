"""Declarations to JSON Schema: every record of the language, and the parameters of a part, alone.
`x-dimension` names the dimension of a quantity, so that a finding can say which was needed.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from kybflow.core.params import (
    BOOLEAN,
    INTEGER,
    Choice,
    Field,
    ListOf,
    MappingOf,
    Numbers,
    RecordOf,
    ValueType,
    fields_of,
    is_needed,
)
from kybflow.core.units import Dimension, article
from kybflow.dsl.language.types import (
    EVENT_FIELD,
    PHASE,
    REQUEST,
    SCALARS,
    SENSORS,
    TITLE,
    VERSION,
    AnyOf,
    PartOf,
    UsesOf,
)
from kybflow.dsl.reading.values import bounds_of, shown_value
from kybflow.parts.events import AWAITED_EVENTS

Schema = dict[str, Any]
_NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
_PARAMETER = r"\$[A-Za-z_]\w*"
_PLACE = rf"^{_PARAMETER}$|^world\.points\.[A-Za-z_]\w*$"
PARAMETER, PLACE = re.compile(rf"^{_PARAMETER}$"), re.compile(_PLACE)
"""A text that stands for a value until parameters, and the world's points, are known."""
NAME = r"^[A-Za-z_][A-Za-z0-9_]*(?!\n)$"
"""Python's `$` alone would let a line break end the name."""
DOTTED = r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*(?!\n)$"
NAMES = {"name": re.compile(NAME), "dotted": re.compile(DOTTED), "any": re.compile("")}
TITLE_LENGTH = 60
BOUNDS = {
    "exclusiveMinimum": "above",
    "minimum": "at_least",
    "exclusiveMaximum": "below",
    "maximum": "at_most",
}
"""The bounds of a schema, and what a field calls them."""
_ALIAS = "A name of its own, when the same part is used twice."


def record_schema(cls: Any, help: str = "") -> Schema:
    """The schema of the mapping of a record; `help` is what it is where it stands."""
    properties: Schema = {"like": text(cls.like)} if getattr(cls, "like", "") else {}
    part: PartOf | None = None
    for field in fields_of(cls):
        kind = field.type
        if isinstance(kind, RecordOf) and kind.flat:
            properties |= params_schema(fields_of(kind.cls), "")["properties"]
        elif isinstance(kind, PartOf) and kind.word == field.key:
            part = kind
            properties[field.key] = text(field.help)
            properties |= {"as": text(_ALIAS)} if part.word == "use" else {}
        else:
            properties[field.key] = field_schema(field)
    whole: Schema = {
        "title": cls.title,
        "description": help or " ".join(cls.__doc__.partition("\n\n")[0].split()),
        "type": ["string", "object"] if part and part.word == "use" else "object",
        "properties": properties,
        **({"minProperties": cls.least} if getattr(cls, "least", 0) else {}),
        **_others(getattr(cls, "others", None), properties, is_open=part is not None),
    }
    needed = [
        field.key
        for field in fields_of(cls)
        if is_needed(cls, field) and not (field.type is part and part and not part.is_needed)
    ]
    if needed and "like" in properties:
        alone = dict.fromkeys(properties, True)
        either = {"title": cls.title, "properties": alone, "required": needed}
        return {**whole, "if": {"required": ["like"]}, "else": either}
    return {**whole, "required": needed} if needed else whole


def _others(others: ValueType | None, properties: Schema, is_open: bool) -> Schema:
    """What keys that are none of the record's own may be; those of events join `properties`."""
    if others is EVENT_FIELD:
        kinds = list(SCALARS)
        for name in event_fields():
            about = f"Only when the event's `{name}` is this."
            properties.setdefault(name, {"description": about, "type": kinds})
    elif others is not None:
        names = {"propertyNames": {"pattern": NAME}} if isinstance(others, RecordOf) else {}
        return {**names, "additionalProperties": field_schema(Field(type=others))}
    return {} if is_open else {"additionalProperties": False}


@functools.cache
def event_fields() -> tuple[str, ...]:
    """The names of the fields that an event may have."""
    return tuple(sorted({name for event in AWAITED_EVENTS.values() for name in event.fields}))


def params_schema(fields: tuple[Field, ...], title: str) -> Schema:
    """The schema of the parameters of one part, alone."""
    return {
        "title": title,
        "type": "object",
        "properties": {field.key: field_schema(field) for field in fields},
        "required": [field.key for field in fields if field.required],
        "additionalProperties": False,
    }


def text(help: str) -> Schema:
    return {"description": help, "type": "string"}


def field_schema(field: Field) -> Schema:
    """The schema of the value of one key."""
    make = _ALONE.get(field.type) or _MAKERS.get(type(field.type), _text)
    whole = make(field.type, field)
    return {**whole, "examples": list(field.examples)} if field.examples else whole


def _text(_: Any, field: Field) -> Schema:
    return text(_help(field))


def _scalar(kind: Any, field: Field) -> Schema:
    """A whole number, or a boolean."""
    either = {"type": [kind.shape, "string"], "pattern": f"^{_PARAMETER}$"}
    return {"description": _help(field), **either, **_bounds(field)}


def _choice(kind: Any, field: Field) -> Schema:
    choices = [{"enum": list(kind.words)}, {"pattern": f"^{_PARAMETER}$"}]
    return {"description": _help(field), "type": "string", "anyOf": choices}


def _uses(kind: Any, field: Field) -> Schema:
    return {"description": field.help, "type": "array", "items": _use_or_stack(kind.item)}


def _sensors(_: Any, field: Field) -> Schema:
    one = use_schema("sensors", field.help)
    return {**one, "type": ["string", "object", "array"], "items": one, "minItems": 1}


def _list(kind: Any, field: Field) -> Schema:
    about = field.each or ("" if isinstance(kind.item, RecordOf) else "One of them.")
    item = replace(
        field, type=kind.item, help=about, required=True, examples=field.each_examples
    )  # fmt: skip
    least = {"minItems": field.least} if field.least else {}
    return {"description": _help(field), "type": "array", "items": field_schema(item), **least}


def _mapping(kind: Any, field: Field) -> Schema:
    item = Field(field.each, name=field.name, type=kind.item, required=True,
                 examples=field.each_examples)  # fmt: skip
    whole: Schema = {"description": field.help, "type": "object"}
    if field.names_like != "any":
        whole["propertyNames"] = {"pattern": DOTTED if field.names_like == "dotted" else NAME}
    whole["additionalProperties"] = field_schema(item)
    return {**whole, "minProperties": field.least} if field.least else whole


def _record(kind: Any, field: Field) -> Schema:
    whole = record_schema(kind.cls, field.help)
    return {**whole, "type": ["string", "object"]} if kind.or_name else whole


def _use(kind: Any, field: Field) -> Schema:
    whole = use_schema(kind.kind, field.help)
    return whole if kind.is_needed else {**whole, "required": []}


def _any_of(kind: Any, field: Field) -> Schema:
    kinds = list(kind.kinds) if len(kind.kinds) > 1 else kind.kinds[0]
    return {**({"description": field.help} if field.help else {}), "type": kinds}


def _either(about: str, inside: Schema) -> Schema:
    """A name, or a mapping with one."""
    return {"description": about, "type": ["string", "object"], "minProperties": 1,
            "additionalProperties": inside}  # fmt: skip


def _request(_: Any, field: Field) -> Schema:
    about = f"{field.help}, or it with values: `{{goto: {{position: [1, 0, 1]}}}}`."
    values = "Values of its parameters in place of its own."
    inside = {"description": values, "type": ["object", *SCALARS, "array"]}
    return _either(about, inside)


def _phase(_: Any, field: Field) -> Schema:
    return _either(field.help, text(field.each))


def _version(_: Any, field: Field) -> Schema:
    return {"description": field.help, "const": 1}


def _title(_: Any, field: Field) -> Schema:
    return {**text(field.help), "pattern": NAME, "maxLength": TITLE_LENGTH}


def use_schema(kind: str, help: str, more: Schema | None = None) -> Schema:
    """A part by its bare name, or a mapping with `use` and its parameters."""
    properties = {"use": text("Name of the part."), "as": text(_ALIAS), **(more or {})}
    return {"title": kind[:-1], "description": help, "type": ["string", "object"],
            "properties": properties, "required": ["use"]}  # fmt: skip


def _use_or_stack(item: ValueType) -> Schema:
    """A part, a record of one, or a stack of them."""
    stack = text("A stack: its parts for this list stand here.")
    part = (
        use_schema(item.kind, "One of them.")
        if isinstance(item, PartOf)
        else record_schema(item.cls if isinstance(item, RecordOf) else None)
    )
    properties = {**part["properties"], "stack": stack}
    alone = {"title": "stack's place", "description": "A stack.", "type": "object",
             "properties": {"stack": stack}, "additionalProperties": False}  # fmt: skip
    either = {"title": part["title"], "properties": properties, "required": part.pop("required")}
    when = {"type": "object", "required": ["stack"]}
    return {**part, "properties": properties, "if": when, "then": alone, "else": either}


def _numbers(kind: Any, field: Field) -> Schema:
    """A number with a unit, a bare number where the dimension allows it, or `$name`; lists of
    them."""
    return _sized(kind.dimension, kind.size, field, _help(field))


def _sized(dimension: Dimension, size: tuple[int | None, ...], field: Field, about: str) -> Schema:
    if not size:
        units = "|".join(unit.replace("^", r"\^") for unit in dimension.units)
        unit = rf"[ \t]*({units}){'?' if dimension.bare_allowed else ''}" if units else ""
        return {
            "description": _described(about, dimension),
            "type": ["number", "string"] if dimension.bare_allowed else "string",
            "pattern": rf"^[ \t]*{_NUMBER}{unit}[ \t]*$|^{_PARAMETER}$",
            "x-dimension": dimension.name,
            **_bounds(field),
        }
    is_row, least = len(size) == 1, size[0] or 1
    return {
        "description": _described(about, dimension) if is_row else about,
        "type": ["array", "string"],
        "pattern": _PLACE if size == (3,) and field.shape != "matrix" else f"^{_PARAMETER}$",
        "items": _sized(dimension, size[1:], field, "One number." if is_row else about),
        "minItems": least,
        **({"maxItems": least} if size[0] else {}),
        **({"x-dimension": dimension.name} if is_row else {}),
    }


def _described(help: str, dimension: Dimension) -> str:
    si = f" [{dimension.si}]" if dimension.si else ""
    what = article(dimension.name).capitalize()
    return f"{help} {what}{si}, like `{dimension.example}`."


def _bounds(field: Field) -> dict[str, float]:
    bounds = (field.above, field.at_least, field.below, field.at_most)
    return {key: bound for key, bound in zip(BOUNDS, bounds, strict=True) if bound is not None}


def _help(field: Field) -> str:
    """The description that an editor shows of a key: its help, default and bounds."""
    is_plain = isinstance(field.type, Numbers | Choice) or field.type.shape in _PLAIN
    has_default = is_plain and not field.required and field.default not in (None, (), "")
    default = f" Default: {shown_value(field.default, field)}." if has_default else ""
    bounds = bounds_of(field)
    return f"{field.help}{default}" + (f" {bounds[0].upper()}{bounds[1:]}." if bounds else "")


_PLAIN = ("integer", "boolean", "text", "file", "file path", "integers", "names")
_Maker = Callable[[Any, Field], Schema]
_ALONE: dict[ValueType, _Maker] = {
    INTEGER: _scalar, BOOLEAN: _scalar, SENSORS: _sensors, REQUEST: _request, PHASE: _phase,
    VERSION: _version, TITLE: _title,
}  # fmt: skip
_MAKERS: dict[type[ValueType], _Maker] = {
    Numbers: _numbers, Choice: _choice, UsesOf: _uses, ListOf: _list, MappingOf: _mapping,
    RecordOf: _record, PartOf: _use, AnyOf: _any_of,
}  # fmt: skip
"""What makes the schema of a value, by its type; any other is a text."""


def nullable(schema: Any) -> Any:
    """The schema with `null` allowed wherever a key may be left out: it is the same as not
    written."""
    if isinstance(schema, list):
        return [nullable(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    new, needed = dict(schema), schema.get("required", ())
    if isinstance(schema.get("properties"), dict):
        new["properties"] = {
            name: inner if name in needed else _with_null(inner)
            for name, inner in schema["properties"].items()
        }
    if isinstance(schema.get("additionalProperties"), dict):
        new["additionalProperties"] = _with_null(schema["additionalProperties"])
    return {key: nullable(value) for key, value in new.items()}


def _with_null(schema: Any) -> Any:
    if not isinstance(schema, dict) or "type" not in schema:
        return schema
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    either = {"anyOf": [*schema["anyOf"], {"type": "null"}]} if "anyOf" in schema else {}
    return {**schema, "type": [*kinds, "null"], **either}
