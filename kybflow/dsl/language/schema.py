"""Generate the JSON Schema of the records of the language and of a part's parameters.

`x-dimension` names the dimension of a quantity, for findings. `errorMessage` and `defaultSnippets`
are keywords of the language servers of editors; other validators ignore them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable
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
)
from kybflow.core.units import Dimension, article, format_quantity, parse_quantity
from kybflow.dsl.language.records import (
    PHASE,
    REQUEST,
    SCALARS,
    SENSORS,
    TITLE,
    VERSION,
    AnyOf,
    PartOf,
    RecordLayout,
    UsesOf,
    layout_of,
    part_layout,
)
from kybflow.dsl.reading.values import bounds_of, diagonal, shown_value

Schema = dict[str, Any]
Finish = Callable[[Schema, Field, bool], Schema]
"""A function that completes the schema of a field's value. Its last argument is whether the key may
be missing."""
_NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
_NAME = (
    r"[^\u0000-\u0040\u005b-\u005e\u0060\u007b-\u00a0]"
    r"[^\u0000-\u002f\u003a-\u0040\u005b-\u005e\u0060\u007b-\u00a0]*"
)
"""Matches a name, and more than that beyond ASCII, because editors know no classes of letters; the
reader refuses the rest."""
_PARAMETER = rf"\$(?:{_NAME})"
_PLACE = rf"^{_PARAMETER}$|^world\.points\.{_NAME}$"
_COMPUTED = rf"^[^$\[\]{{}},:]*{_PARAMETER}[^\[\]{{}},:]*$"
PARAMETER, PLACE = re.compile(rf"^{_PARAMETER}$"), re.compile(_PLACE)
COMPUTED = re.compile(_COMPUTED)
"""Match a text that stands for a value until parameters and points of the world are resolved; a
number may be computed, as in `$height + 20 cm`."""
NAME = rf"^{_NAME}(?!\n)$"
"""The pattern of a name. With `$` alone, Python would accept a line break after the name."""
DOTTED = rf"^{_NAME}(\.{_NAME})*(?!\n)$"
NAMES = {"name": re.compile(NAME), "dotted": re.compile(DOTTED), "any": re.compile("")}
TITLE_LENGTH = 60
BOUNDS = {
    "exclusiveMinimum": "above",
    "minimum": "at_least",
    "exclusiveMaximum": "below",
    "maximum": "at_most",
}
"""The name of each JSON Schema bound in `Field`."""
KINDS = {
    "object": "a mapping",
    "array": "a list",
    "string": "text",
    "number": "a number",
    "boolean": "`true` or `false`",
    "integer": "a whole number",
    "null": "nothing",
}
"""The JSON types in words."""
NAMED = "a name may contain letters, digits and `_`, and must not begin with a digit"
_NAMED = f"{NAMED[0].upper()}{NAMED[1:]}."
_PLAIN = ("integer", "boolean", "text", "file", "file path", "integers", "names")


def with_null(schema: Schema, _: Field, may_lack: bool) -> Schema:
    """Return the schema with `null` allowed if the key may be left out; `null` means that the key
    is not written."""
    if not may_lack or "type" not in schema:
        return schema
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    either = {"anyOf": [*schema["anyOf"], {"type": "null"}]} if "anyOf" in schema else {}
    return {**schema, "type": [*kinds, "null"], **either}


def record_schema(cls: Any) -> Schema:
    """Return the schema with which `jsonschema` checks the mapping of a record."""
    return Schemas().record(cls)


class Schemas:
    """Generates the schemas of records and values. finish: completes the schema of each value."""

    def __init__(self, finish: Finish = with_null) -> None:
        self._finish = finish

    def record(self, cls: Any, help: str = "") -> Schema:
        """Return the schema of a record's mapping. help: describes it, in place of its
        docstring."""
        about = help or " ".join(cls.__doc__.partition("\n\n")[0].split())
        return self.mapping(layout_of(cls), cls.title, about)

    def properties(self, fields: Iterable[Field], needed: Container[str] = ()) -> Schema:
        """Return the schemas of the values of several keys. needed: the keys that may not be left
        out."""
        return {field.key: self.value(field, field.key not in needed) for field in fields}

    def value(self, field: Field, may_lack: bool = False) -> Schema:
        """Return the schema of the value of one key."""
        make = _ALONE.get(field.type) or _MAKERS.get(type(field.type))
        about = _help(field)
        whole: Schema = make(self, field.type, field) if make else {"type": "string"}
        if about and "description" not in whole:
            whole = {"description": about, **whole}
        if field.examples:
            whole["examples"] = list(field.examples)
        return self._finish(whole, field, may_lack)

    def mapping(self, layout: RecordLayout, title: str, about: str) -> Schema:
        """Return the schema of a mapping with the keys of a layout."""
        has_like = "like" in layout.keys
        needed = () if has_like else layout.needed
        is_use = layout.part is not None and layout.part.word == "use"
        whole: Schema = {
            "title": title,
            "description": about,
            "type": ["string", "object"] if is_use else "object",
            "properties": self.properties(layout.keys.values(), needed),
        }
        if layout.least:
            whole["minProperties"] = layout.least
        if layout.others is not None:
            if isinstance(layout.others, RecordOf):
                whole["propertyNames"] = _names(NAME)
            whole["additionalProperties"] = self.value(Field(type=layout.others), may_lack=True)
        elif layout.part is None:
            whole["additionalProperties"] = False
        if needed:
            whole["required"] = list(needed)
        if has_like and layout.needed:
            alone = dict.fromkeys(layout.keys, True)
            either = {"title": title, "properties": alone, "required": list(layout.needed)}
            whole["allOf"] = [{"if": {"required": ["like"]}, "else": either}]
        return whole

    def _scalar(self, kind: Any, field: Field) -> Schema:
        """Return the schema of an integer or a boolean."""
        pattern = f"^{_PARAMETER}$" if kind is BOOLEAN else _COMPUTED
        either = {"type": [kind.shape, "string"], "pattern": pattern}
        words = ("true", "false") if kind is BOOLEAN else (_example(field),)
        return {"defaultSnippets": snippets(words), **either, **_bounds(field)}

    def _choice(self, kind: Any, field: Field) -> Schema:
        needed = {"errorMessage": f"One of {', '.join(f'`{w}`' for w in kind.words)} is needed."}
        choices: list[Schema] = [{"enum": list(kind.words)}, {"pattern": f"^{_PARAMETER}$"}]
        return {
            "defaultSnippets": snippets(kind.words),
            "type": "string",
            "anyOf": [{**choice, **needed} for choice in choices],
        }

    def _numbers(self, kind: Any, field: Field) -> Schema:
        """Return the schema of numbers: each with a unit, without one if the dimension allows that,
        or `$name`."""
        whole = numbers_schema(kind.dimension, kind.size, field)
        return {"defaultSnippets": snippets((_example(field),)), **whole}

    def _list(self, kind: Any, field: Field) -> Schema:
        about = field.each or ("" if isinstance(kind.item, RecordOf) else "One of them.")
        examples = field.each_examples
        item = replace(field, type=kind.item, help=about, required=True, examples=examples)
        whole: Schema = {"type": "array", "items": self.value(item)}
        if kind.item is INTEGER:
            whole["defaultSnippets"] = snippets((_example(field),))
        return {**whole, "minItems": field.least} if field.least else whole

    def _uses(self, kind: Any, field: Field) -> Schema:
        """Return the schema of a list of parts, of records of parts, or of stacks."""
        stack = Field("A stack, whose parts for this list are inserted here.", key="stack")
        if isinstance(kind.item, PartOf):
            layout, title, about = part_layout(kind.item), kind.item.kind[:-1], "One of them."
        else:
            cls = kind.item.cls
            layout, title, about = layout_of(cls), cls.title, cls.__doc__.partition("\n\n")[0]
        keys = {**layout.keys, "stack": stack}
        whole = self.mapping(layout._replace(keys=keys, needed=()), title, about)
        alone = {
            "title": "entry with `stack`", "description": "A stack.", "type": "object",
            "properties": {"stack": whole["properties"]["stack"]}, "additionalProperties": False,
        }  # fmt: skip
        named = {**dict.fromkeys(keys, True), **self.properties((layout.keys["use"],), ("use",))}
        either = {"title": title, "properties": named, "required": ["use"]}
        when = {"type": "object", "required": ["stack"]}
        whole["allOf"] = [{"if": when, "then": alone, "else": either}]
        items = self._finish(whole, Field(type=kind.item), False)
        return {"type": "array", "items": items}

    def _mapping(self, kind: Any, field: Field) -> Schema:
        item = Field(field.each, name=field.name, type=kind.item, required=True,
                     examples=field.each_examples)  # fmt: skip
        whole: Schema = {"type": "object"}
        if field.names_like != "any":
            whole["propertyNames"] = _names(DOTTED if field.names_like == "dotted" else NAME)
        whole["additionalProperties"] = self.value(item, may_lack=True)
        return {**whole, "minProperties": field.least} if field.least else whole

    def _use(self, kind: Any, field: Field) -> Schema:
        """Return the schema of a part: its name alone, or a mapping with `use` and its
        parameters."""
        return self.mapping(part_layout(kind), kind.kind[:-1], field.help)

    def _request(self, _: Any, field: Field) -> Schema:
        about = f"{field.help}, also with values: `{{goto: {{position: [1, 0, 1]}}}}`."
        values = AnyOf("value", kinds=("object", *SCALARS, "array"))
        inside = Field("Parameter values that replace those of the behavior.", type=values)
        return self._either(about, inside)

    def _either(self, about: str, inside: Field) -> Schema:
        """Return the schema of a name, or of a mapping whose values are described by `inside`."""
        return {"description": about, "type": ["string", "object"], "minProperties": 1,
                "additionalProperties": self.value(inside, may_lack=True)}  # fmt: skip


_Maker = Callable[[Schemas, Any, Field], Schema]
_ALONE: dict[ValueType, _Maker] = {
    INTEGER: Schemas._scalar, BOOLEAN: Schemas._scalar, REQUEST: Schemas._request,
    PHASE: lambda made, _, field: made._either(field.help, Field(field.each)),
    VERSION: lambda *_: {"const": 1},
    TITLE: lambda *_: {
        "type": "string", "pattern": NAME, "maxLength": TITLE_LENGTH, "errorMessage": _NAMED
    },
    SENSORS: lambda made, kind, field: {
        **made._use(kind.item, field), "type": ["string", "object", "array"],
        "items": made.value(replace(field, type=kind.item)), "minItems": 1,
    },
}  # fmt: skip
_MAKERS: dict[type[ValueType], _Maker] = {
    Numbers: Schemas._numbers, Choice: Schemas._choice, UsesOf: Schemas._uses,
    ListOf: Schemas._list, MappingOf: Schemas._mapping, PartOf: Schemas._use,
    RecordOf: lambda made, kind, field: {
        **made.record(kind.cls, field.help),
        **({"type": ["string", "object"]} if kind.or_name else {}),
    },
    AnyOf: lambda _, kind, __: {
        "type": list(kind.kinds) if len(kind.kinds) > 1 else kind.kinds[0]
    },
}  # fmt: skip
"""The method that makes the schema of each type of value; any other type is a text."""


def numbers_schema(dimension: Dimension, size: tuple[int | None, ...], field: Field) -> Schema:
    """Return the schema of numbers of the given size (as in `Numbers`), within the bounds of the
    field."""
    one = f"{article(dimension.name)}, like `{dimension.example}`"
    if not size:
        units = "|".join(unit.replace("^", r"\^") for unit in dimension.units)
        unit = rf"[ \t]*({units}){'?' if dimension.bare_allowed else ''}" if units else ""
        known = f"; its units are {', '.join(dimension.units)}" if units else ""
        return {
            "type": ["number", "string"] if dimension.bare_allowed else "string",
            "pattern": rf"^[ \t]*{_NUMBER}{unit}[ \t]*$|{_COMPUTED}",
            "x-dimension": dimension.name,
            **_bounds(field),
            "errorMessage": f"{one[:1].upper()}{one[1:]}, is needed{known}.",
        }
    is_matrix, least = field.shape == "matrix", size[0] or 1
    if len(size) == 1:
        needed = f"A row of {least} is needed, `[...]`" if is_matrix else "`[x, y, z]` is needed"
    elif is_matrix:
        needed = f"`[[...], ...]` is needed, {least} rows of {size[1]}"
    else:
        needed = "`[[x, y, z], ...]` is needed"
    return {
        "type": ["array", "string"],
        "pattern": _PLACE if size == (3,) and not is_matrix else f"^{_PARAMETER}$",
        "items": numbers_schema(dimension, size[1:], field),
        "minItems": least,
        **({"maxItems": least} if size[0] else {}),
        **({"x-dimension": dimension.name} if len(size) == 1 else {}),
        "errorMessage": f"{needed}, each {one}.",
    }


def snippets(texts: Iterable[str]) -> list[dict[str, str]]:
    """Return texts in the form in which an editor inserts them."""
    return [{"label": text, "body": text} for text in texts]


def _names(pattern: str) -> Schema:
    return {"pattern": pattern, "patternErrorMessage": _NAMED}


def _bounds(field: Field) -> dict[str, float]:
    bounds = {key: getattr(field, ours) for key, ours in BOUNDS.items()}
    return {key: bound for key, bound in bounds.items() if bound is not None}


def _help(field: Field) -> str:
    """Return the description that an editor shows for a key: its help, default and bounds, and how
    to write a quantity."""
    kind = field.type
    is_plain = isinstance(kind, Numbers | Choice) or kind.shape in _PLAIN
    has_default = is_plain and not field.required and field.default not in (None, (), "")
    default = f" Default: {shown_value(field.default, field)}." if has_default else ""
    bounds = bounds_of(field)
    about = f"{field.help}{default}" + (f" {bounds[0].upper()}{bounds[1:]}." if bounds else "")
    if not isinstance(kind, Numbers):
        return about
    dimension = kind.dimension
    si = f" [{dimension.si}]" if dimension.si else ""
    what = article(dimension.name).capitalize()
    return f"{about} {what}{si}, like `{dimension.example}`."


def _example(field: Field) -> str:
    """Return an initial value for numbers or integers: the default, or else a value within the
    bounds."""
    kind = field.type
    if field.default not in (None, ()):
        return shown_value(field.default, field)
    if not isinstance(kind, Numbers):
        whole = str(max(1, int(field.at_least or 0)))
        return whole if kind is INTEGER else f"[{whole}, {whole}]"
    one, zero = kind.dimension.example, format_quantity(0.0, kind.dimension)
    if not field.is_within(parse_quantity(one, kind.dimension)):
        low = next((b for b in (field.above, field.at_least) if b is not None), 0.0)
        high = next((b for b in (field.below, field.at_most) if b is not None), 2.0 * low + 2.0)
        one = format_quantity(0.5 * (low + high), kind.dimension)
    first = one if not field.is_within(0.0) else zero
    if field.shape == "matrix":
        return diagonal(kind.size, one, first)
    depth = len(kind.size)
    return "[" * depth + f"{first}, {first}, {one}" + "]" * depth if depth else one
