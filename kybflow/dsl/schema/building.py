"""What the schemas are built of: quantities and vectors, a part's parameters from their
declaration, names, mappings, uses of parts.

`x-dimension` names the dimension of a quantity, so that a finding can say which was needed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from kybflow.core.params import ITEMS, Field
from kybflow.core.units import DURATION, Dimension, article
from kybflow.dsl.reading.values import bounds_of, shown_value

Schema = dict[str, Any]
_NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
_PARAMETER = r"\$[A-Za-z_]\w*"
_PLACE = rf"^{_PARAMETER}$|^world\.points\.[A-Za-z_]\w*$"


BOUNDS = {
    "exclusiveMinimum": "above",
    "minimum": "at_least",
    "exclusiveMaximum": "below",
    "maximum": "at_most",
}
"""The bounds of a schema, and what a field calls them."""
LISTS = ("estimators", "processors", "supervisors")
"""The lists of a vehicle in which stacks may stand."""


def quantity(dimension: Dimension, help: str, **bounds: Any) -> Schema:
    """A number with a unit, a bare number where the dimension allows it, or `$name`."""
    units = "|".join(_escaped(unit) for unit in dimension.units)
    optional = "?" if dimension.bare_allowed else ""
    unit = rf"[ \t]*({units}){optional}" if units else ""
    return {
        "description": _described(help, dimension),
        "type": ["number", "string"] if dimension.bare_allowed else "string",
        "pattern": rf"^[ \t]*{_NUMBER}{unit}[ \t]*$|^{_PARAMETER}$",
        "x-dimension": dimension.name,
        **bounds,
    }


def _escaped(unit: str) -> str:
    return unit.replace("^", r"\^")


def _described(help: str, dimension: Dimension) -> str:
    si = f" [{dimension.si}]" if dimension.si else ""
    what = article(dimension.name).capitalize()
    return f"{help} {what}{si}, like `{dimension.example}`."


def vector(dimension: Dimension, help: str, **bounds: Any) -> Schema:
    return {
        "description": _described(help, dimension),
        "type": ["array", "string"],
        "pattern": _PLACE,
        "items": quantity(dimension, "One number.", **bounds),
        "minItems": 3,
        "maxItems": 3,
        "x-dimension": dimension.name,
    }


def _bounds(field: Field) -> dict[str, float]:
    bounds = (field.above, field.at_least, field.below, field.at_most)
    return {key: bound for key, bound in zip(BOUNDS, bounds, strict=True) if bound is not None}


def _help(field: Field) -> str:
    """The description that an editor shows of a parameter: its help, default and bounds."""
    default = "" if field.required else f" Default: {shown_value(field.default, field)}."
    bounds = bounds_of(field)
    return f"{field.help}{default}" + (f" {bounds[0].upper()}{bounds[1:]}." if bounds else "")


def field_schema(field: Field) -> Schema:
    """The schema of one parameter."""
    text = _help(field)
    bounds = _bounds(field)
    if field.dimension is not None:
        if field.shape == "scalar":
            return quantity(field.dimension, text, **bounds)
        point = vector(field.dimension, text, **bounds)
        if field.shape == "vector":
            return point
        return {
            "description": text,
            "type": ["array", "string"],
            "pattern": f"^{_PARAMETER}$",
            "items": point,
            "minItems": 1,
        }
    if field.shape == "choice":
        choices = [{"enum": list(field.choices)}, {"pattern": f"^{_PARAMETER}$"}]
        return {"description": text, "type": "string", "anyOf": choices}
    if field.shape in ("text", "file", "file path"):
        return {"description": text, "type": "string"}
    if field.shape in ITEMS:
        one = replace(field, shape=ITEMS[field.shape], help="One of them.", required=True)
        return {"description": text, "type": "array", "items": field_schema(one)}
    return {
        "description": text,
        "type": [field.shape, "string"],
        "pattern": f"^{_PARAMETER}$",
        **bounds,
    }


def params_schema(fields: tuple[Field, ...], title: str) -> Schema:
    """The schema of the parameters of one part, alone."""
    return {
        "title": title,
        "type": "object",
        "properties": {field.name: field_schema(field) for field in fields},
        "required": [field.name for field in fields if field.required],
        "additionalProperties": False,
    }


def nullable(schema: Any) -> Any:
    """The schema with `null` allowed wherever a key may be left out: it is the same as not
    written."""
    if isinstance(schema, list):
        return [nullable(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {key: nullable(value) for key, value in with_nulls(schema).items()}


def with_nulls(schema: Schema) -> Schema:
    """The schema with `null` allowed for the keys of its own mapping that may be left out."""
    new, needed = dict(schema), schema.get("required", ())
    if isinstance(schema.get("properties"), dict):
        new["properties"] = {
            name: inner if name in needed else _with_null(inner)
            for name, inner in schema["properties"].items()
        }
    if isinstance(schema.get("additionalProperties"), dict):
        new["additionalProperties"] = _with_null(schema["additionalProperties"])
    return new


def _with_null(schema: Any) -> Any:
    if not isinstance(schema, dict) or "type" not in schema:
        return schema
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    either = {"anyOf": [*schema["anyOf"], {"type": "null"}]} if "anyOf" in schema else {}
    return {**schema, "type": [*kinds, "null"], **either}


NAME = r"^[A-Za-z_][A-Za-z0-9_]*(?!\n)$"
"""Python's `$` alone would let a line break end the name."""
DOTTED = r"^[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*(?!\n)$"


def title() -> Schema:
    """The name of a file's content; a run's folder is called by it."""
    return {"description": "Its name.", "type": "string", "pattern": NAME, "maxLength": 60}


def text(help: str) -> Schema:
    return {"description": help, "type": "string"}


def named(help: str, value: Schema, **more: Any) -> Schema:
    """A mapping of names to `value`."""
    names = {"pattern": NAME}
    return {
        "description": help, "type": "object", "propertyNames": names,
        "additionalProperties": value, **more,
    }  # fmt: skip


def mapping(title: str, help: str, properties: Schema, **more: Any) -> Schema:
    return {
        "title": title, "description": help, "type": "object", "properties": properties,
        "additionalProperties": False, **more,
    }  # fmt: skip


def use(title: str, help: str, extra: Schema | None = None) -> Schema:
    """A part by its bare name, or a mapping with `use` and its parameters."""
    properties = {
        "use": text("Name of the part."),
        "as": text("A name of its own, when the same part is used twice."),
        **(extra or {}),
    }
    return {
        "title": title, "description": help, "type": ["string", "object"],
        "properties": properties, "required": ["use"],
    }  # fmt: skip


def uses(title: str, help: str, extra: Schema | None = None) -> Schema:
    """A list of parts and of stacks of them."""
    part = use(title, "One of them.", extra)
    stack = text("A stack: its parts for this list stand here.")
    properties = {**part["properties"], "stack": stack}
    either = {
        "if": {"type": "object", "required": ["stack"]},
        "then": mapping("stack's place", "A stack.", {"stack": stack}),
        "else": {"title": title, "properties": properties, "required": part.pop("required")},
    }
    items = {**part, "properties": properties, **either}
    return {"description": help, "type": "array", "items": items}


NEXT = mapping(
    "transition",
    "One way out of a behavior: all of `when`, `event` and `after` that are written must hold.",
    {
        "when": text("A condition, like `state.altitude > 1 m`."),
        "event": text("An event to hear."),
        "after": quantity(DURATION, "Time in the behavior.", minimum=0),
        "for": quantity(DURATION, "How long the condition must hold.", minimum=0),
        "emit": text("An event of the mission's own, told when this way is taken."),
        "go": text("The behavior to go to."),
    },
    required=["go"],
)
