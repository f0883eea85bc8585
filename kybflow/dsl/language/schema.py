"""Declarations to JSON Schema: every record of the language, and the parameters of a part, alone.
`x-dimension` names the dimension of a quantity, so that a finding can say which was needed.
"""

from __future__ import annotations

import functools
import re
from typing import Any

from kybflow.core.params import (
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
    needed, word = [], ""
    least = {"minProperties": cls.least} if getattr(cls, "least", 0) else {}
    for field in fields_of(cls):
        kind = field.type
        if isinstance(kind, RecordOf) and kind.flat:
            properties |= params_schema(fields_of(kind.cls), "")["properties"]
            continue
        if isinstance(kind, PartOf) and kind.word == field.key:
            word = kind.word if kind.is_needed else "?"
            properties[field.key] = text(field.help)
            if word == "use":
                properties["as"] = text(_ALIAS)
        else:
            properties[field.key] = field_schema(field)
        if is_needed(cls, field) and (
            word != "?" or field.key in needed or not isinstance(kind, PartOf)
        ):
            needed.append(field.key)
    whole: Schema = {
        "title": cls.title,
        "description": help or _doc(cls),
        "type": ["string", "object"] if word == "use" else "object",
        "properties": properties,
        **least,
    }
    others = getattr(cls, "others", None)
    if others is EVENT_FIELD:
        for name in event_fields():
            help = f"Only when the event's `{name}` is this."
            properties.setdefault(name, {"description": help, "type": list(SCALARS)})
        whole["additionalProperties"] = False
    elif others is not None:
        whole |= {"propertyNames": {"pattern": NAME}} if isinstance(others, RecordOf) else {}
        whole["additionalProperties"] = field_schema(Field(type=others))
    elif not word:
        whole["additionalProperties"] = False
    if needed and properties.get("like"):
        alone = {
            "title": cls.title,
            "properties": dict.fromkeys(properties, True),
            "required": needed,
        }
        return {**whole, "if": {"required": ["like"]}, "else": alone}
    return {**whole, "required": needed} if needed else whole


@functools.cache
def event_fields() -> tuple[str, ...]:
    """The names of the fields that an event may have."""
    return tuple(sorted({name for event in AWAITED_EVENTS.values() for name in event.fields}))


def _doc(cls: Any) -> str:
    """The first paragraph of a record's docstring: what it is, for authors."""
    return " ".join((cls.__doc__ or "").partition("\n\n")[0].split())


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
    whole = _value(field.type, field)
    if field.examples:
        whole = {**whole, "examples": list(field.examples)}
    return whole


def _value(kind: ValueType, field: Field) -> Schema:
    help = _help(field)
    if isinstance(kind, Numbers):
        return _numbers(kind, field, help)
    if isinstance(kind, Choice):
        choices = [{"enum": list(kind.words)}, {"pattern": f"^{_PARAMETER}$"}]
        return {"description": help, "type": "string", "anyOf": choices}
    if isinstance(kind, UsesOf):
        return {"description": help, "type": "array", "items": _use_or_stack(kind.item)}
    if kind is SENSORS:
        one = use_schema("sensors", help)
        return {**one, "type": ["string", "object", "array"], "items": one, "minItems": 1}
    if isinstance(kind, ListOf):
        what = field.each or ("" if isinstance(kind.item, RecordOf) else "One of them.")
        item = Field(field.name, kind.item, help=what, required=True, examples=field.each_examples,
                     above=field.above, at_least=field.at_least, below=field.below,
                     at_most=field.at_most)  # fmt: skip
        items = {"type": "string"} if field.name == "expect" else field_schema(item)
        least = {"minItems": field.least} if field.least else {}
        return {"description": help, "type": "array", "items": items, **least}
    if isinstance(kind, MappingOf):
        return _mapping(kind, field)
    if isinstance(kind, RecordOf):
        whole = params_schema(fields_of(kind.cls), kind.cls.__name__.lower())
        if hasattr(kind.cls, "title"):
            whole = record_schema(kind.cls, field.help)
        return {**whole, "type": ["string", "object"]} if kind.or_name else whole
    return _other(kind, field, help)


def _other(kind: ValueType, field: Field, help: str) -> Schema:
    if isinstance(kind, PartOf):
        whole = use_schema(kind.kind, help)
        return whole if kind.is_needed else {**whole, "required": []}
    if isinstance(kind, AnyOf):
        kinds = list(kind.kinds)
        what = {"description": help} if field.help else {}
        return {**what, "type": kinds if len(kinds) > 1 else kinds[0]}
    if kind is REQUEST:
        values = {"description": "Values of its parameters in place of its own.",
                  "type": ["object", *SCALARS, "array"]}  # fmt: skip
        help = f"{field.help}, or it with values: `{{goto: {{position: [1, 0, 1]}}}}`."
        return {"description": help, "type": ["string", "object"], "minProperties": 1,
                "additionalProperties": values}  # fmt: skip
    if kind is PHASE:
        return {"description": help, "type": ["string", "object"], "minProperties": 1,
                "additionalProperties": text(field.each)}  # fmt: skip
    if kind is VERSION:
        return {"description": help, "const": 1}
    if kind is TITLE:
        return {**text(help), "pattern": NAME, "maxLength": TITLE_LENGTH}
    if kind.shape in ("integer", "boolean"):
        bounds = _bounds(field)
        return {"description": help, "type": [kind.shape, "string"],
                "pattern": f"^{_PARAMETER}$", **bounds}  # fmt: skip
    return text(help)


def _mapping(kind: MappingOf, field: Field) -> Schema:
    item = Field(field.name, kind.item, help=field.each, required=True,
                 examples=field.each_examples)  # fmt: skip
    whole: Schema = {"description": field.help, "type": "object"}
    if field.names_like != "any":
        whole["propertyNames"] = {"pattern": DOTTED if field.names_like == "dotted" else NAME}
    whole["additionalProperties"] = field_schema(item)
    return {**whole, "minProperties": field.least} if field.least else whole


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


def _numbers(kind: Numbers, field: Field, help: str) -> Schema:
    """A number with a unit, a bare number where the dimension allows it, or `$name`; lists of
    them."""
    dimension, bounds = kind.dimension, _bounds(field)
    if not kind.size:
        units = "|".join(unit.replace("^", r"\^") for unit in dimension.units)
        unit = rf"[ \t]*({units}){'?' if dimension.bare_allowed else ''}" if units else ""
        return {
            "description": _described(help, dimension),
            "type": ["number", "string"] if dimension.bare_allowed else "string",
            "pattern": rf"^[ \t]*{_NUMBER}{unit}[ \t]*$|^{_PARAMETER}$",
            "x-dimension": dimension.name,
            **bounds,
        }
    inner = Numbers("", False, dimension, kind.size[1:])
    item_help = "One number." if len(kind.size) == 1 else help
    least = kind.size[0] or 1
    whole: Schema = {
        "description": _described(help, dimension) if len(kind.size) == 1 else help,
        "type": ["array", "string"],
        "pattern": _PLACE if kind.size == (3,) else f"^{_PARAMETER}$",
        "items": _numbers(inner, field, item_help),
        "minItems": least,
    }
    if kind.size[0]:
        whole["maxItems"] = least
    return {**whole, "x-dimension": dimension.name} if len(kind.size) == 1 else whole


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
