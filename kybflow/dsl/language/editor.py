"""What the published schema tells an editor besides what is right: what to insert, and what is
wrong in words.

`defaultSnippets` and `errorMessage` are words of the language servers of editors; other validators
leave them out. Such a server offers `null` wherever a `type` allows it, and writes a list wherever
it sees `items`. So what judges a value stands behind an `if`, where it looks for what is wrong and
not for what to insert. Null is right there: it removes what `like` brought.
"""

from __future__ import annotations

from typing import Any

from kybflow.core.errors import UnitError
from kybflow.core.params import Field
from kybflow.core.units import DIMENSIONS, Dimension, article, format_quantity, parse_quantity
from kybflow.dsl.language.schema import BOUNDS, NAME, Schema, field_schema
from kybflow.dsl.reading.values import diagonal, quantity_field, shown_value

_DEFAULT = "x-default"
Shared = dict[str, Schema]
"""What judges values, by its name under `$defs`."""
_SAID = ("title", "description", "examples")
_KINDS = {
    "object": "a mapping", "array": "a list", "string": "text", "number": "a number",
    "integer": "a whole number", "boolean": "`true` or `false`",
}  # fmt: skip
_DATA = frozenset({"examples", "enum", "const", "required", "type"})
_NAMED = "A name has letters, digits and `_`, and begins with no digit."
_LISTS = {
    "vector": "`[x, y, z]` is needed",
    "path": "`[[x, y, z], ...]` is needed",
    "matrix": "`[[...], ...]` is needed, {} rows of {}",
    "row": "A row of {} is needed, `[...]`",
}
_NOTHING: Schema = {"type": "null"}


def for_editors(schema: Schema) -> Schema:
    """The schema as editors read it, with null for every key that may be left out."""
    shared: Shared = {}
    whole = _inside(schema, shared)
    return {**whole, "$defs": {**whole.get("$defs", {}), **shared}}


def parameter(field: Field) -> Schema:
    """The schema of one parameter of a part, with the default that an editor inserts."""
    is_number = field.dimension is not None or field.shape == "integer"
    default = {_DEFAULT: field.default} if is_number and not field.required else {}
    return {**field_schema(field), **default}


def _inside(schema: Any, shared: Shared) -> Any:
    """`schema` with what is written in it as editors read it."""
    if isinstance(schema, list):
        return [_inside(one, shared) for one in schema]
    if not isinstance(schema, dict):
        return schema
    needed = schema.get("required", ())
    new: Schema = {}
    for key, inner in schema.items():
        if key == "properties":
            values = inner.items()
            new[key] = {k: _value(v, shared, may_lack=k not in needed) for k, v in values}
        elif key in ("additionalProperties", "items"):
            new[key] = _value(inner, shared, may_lack=key != "items")
        elif key == "propertyNames":
            new[key] = {**inner, "patternErrorMessage": _NAMED}
        else:
            new[key] = inner if key in _DATA else _inside(inner, shared)
    return new


def _value(schema: Any, shared: Shared, *, may_lack: bool) -> Any:
    """What a key's value may be."""
    types = _types(schema)
    if not types or _offers_parts(schema):
        return _inside(schema, shared)
    items = schema.get("items", {})
    if "object" in types or "object" in _types(items) or "$ref" in items:
        return _mapping(_inside(schema, shared), types, may_lack=may_lack)
    said = {key: schema[key] for key in _SAID if key in schema}
    choices, inserted = _choices(schema), _inserted(schema)
    if choices:
        said["examples"] = choices
    elif inserted:
        said["defaultSnippets"] = [{"label": inserted, "body": inserted}]
    elif "examples" not in said:
        said["anyOf"] = [{}]  # a value of no type: the key is inserted, and none with it
    judging = _judging(schema, shared)
    return {**said, "if": _NOTHING, "else": judging} if may_lack else {**said, **judging}


def _types(schema: Any) -> list[str]:
    types = schema.get("type", ()) if isinstance(schema, dict) else ()
    return [types] if isinstance(types, str) else list(types)


def _offers_parts(schema: Schema) -> bool:
    """Whether it lists the names of parts, each with what it does: completed as it stands."""
    return "const" in schema.get("anyOf", [{}])[0]


def _mapping(schema: Schema, types: list[str], *, may_lack: bool) -> Schema:
    """A mapping, or a list of them, whose keys are completed from where they stand."""
    if not may_lack:
        return schema
    said = {key: one for key, one in schema.items() if key not in ("type", "allOf")}
    right = {"type": types, "errorMessage": _kinds(types)}
    if types == ["object"] and not said.keys() & {"properties", "examples"}:
        said["defaultSnippets"] = [{"label": "NAME", "body": "\n  ${1:name}: "}]
    return {**said, "allOf": [*schema.get("allOf", ()), {"if": _NOTHING, "else": right}]}


def _kinds(types: list[str]) -> str:
    """Which kinds of value are right, in words."""
    return " or ".join(_KINDS[one] for one in types).capitalize() + " is needed."


def _choices(schema: Schema) -> list[Any]:
    """The words of which one is chosen; none for a value that isn't."""
    if "boolean" in _types(schema) and "number" not in _types(schema):
        return [True, False]
    return list(schema.get("anyOf", [{}])[0].get("enum", ()))


def _judging(schema: Schema, shared: Shared, *, is_row: bool = False) -> Schema:
    """What judges a value, or a row of a matrix, and says in words what is wrong with it."""
    dimension = DIMENSIONS.get(_innermost(schema).get("x-dimension", ""))
    left_out = (*_SAID, *BOUNDS, "x-dimension", _DEFAULT)
    judged = {key: one for key, one in schema.items() if key not in left_out}
    bounds = {key: schema[key] for key in BOUNDS if key in schema}
    if "items" in schema:
        judged["items"] = _judging(schema["items"], shared, is_row=_is_matrix(schema))
    if dimension is None:
        words = [f"`{choice}`" for choice in _choices(schema) if isinstance(choice, str)]
        needed = "One of " + ", ".join(words) + " is needed." if words else _kinds(_types(schema))
        either = {"anyOf": [{**one, "errorMessage": needed} for one in judged.pop("anyOf", ())]}
        needed = _NAMED if schema.get("pattern") == NAME else needed
        return {**judged, **bounds, **(either if words else {}), "errorMessage": needed}
    shape = "row" if is_row else _shape(schema)
    name = "_".join([*dimension.name.split(), *([shape] if shape else [])])
    judged["errorMessage"] = _needed(dimension, schema, shape)
    while shared.setdefault(name, judged) != judged:
        name += "_"
    return {"$ref": f"#/$defs/{name}", **bounds}


def _depth(schema: Schema) -> int:
    """0 for a quantity, 1 for a vector, 2 for a path or a matrix."""
    return 1 + _depth(schema["items"]) if "items" in schema else 0


def _is_matrix(schema: Schema) -> bool:
    return _depth(schema) == 2 and "maxItems" in schema


def _shape(schema: Schema) -> str:
    """The word for lists of numbers; empty for a quantity."""
    return "matrix" if _is_matrix(schema) else ("", "vector", "path")[_depth(schema)]


def _innermost(schema: Schema) -> Schema:
    """The schema of one number of a vector, path or matrix."""
    return _innermost(schema["items"]) if "items" in schema else schema


def _needed(dimension: Dimension, schema: Schema, shape: str) -> str:
    one = f"{article(dimension.name)}, like `{dimension.example}`"
    if shape in _LISTS:
        sizes = schema.get("minItems"), schema["items"].get("minItems")
        return f"{_LISTS[shape].format(*sizes)}, each {one}."
    units = f"; its units are {', '.join(dimension.units)}" if dimension.units else ""
    return f"{one[:1].upper()}{one[1:]}, is needed{units}."


def _inserted(schema: Schema) -> str:
    """The value to begin with: an example, the default, else one inside of the bounds; empty where
    only the author knows one."""
    if "examples" in schema:
        return ""
    innermost, depth, default = _innermost(schema), _depth(schema), schema.get(_DEFAULT)
    dimension = DIMENSIONS.get(innermost.get("x-dimension", ""))
    own = _field(innermost, dimension)
    if dimension is None:
        if _types(innermost)[0] != "integer":
            return ""
        whole = str(default if default is not None else int(max(1, own.at_least or 0)))
        return f"[{whole}, {whole}]" if depth else whole
    if default not in (None, ()):
        return shown_value(default, own)
    one = _fitting(own, dimension)
    zero = format_quantity(0.0, dimension)
    first = zero if _is_inside(zero, own, dimension) else one
    if _is_matrix(schema):
        return diagonal((schema["minItems"], schema["items"]["minItems"]), one, first)
    return ("[" * depth + f"{first}, {first}, {one}" + "]" * depth) if depth else one


def _field(schema: Schema, dimension: Dimension | None) -> Field:
    bounds = {ours: schema.get(theirs) for theirs, ours in BOUNDS.items()}
    return quantity_field("", dimension or DIMENSIONS["number"], **bounds)


def _fitting(field: Field, dimension: Dimension) -> str:
    """A quantity inside of the bounds: the example of its dimension, else one between them."""
    low = next((b for b in (field.above, field.at_least) if b is not None), 0.0)
    high = next((b for b in (field.below, field.at_most) if b is not None), 2.0 * low + 2.0)
    between = format_quantity(0.5 * (low + high), dimension)
    return dimension.example if _is_inside(dimension.example, field, dimension) else between


def _is_inside(text: str, field: Field, dimension: Dimension) -> bool:
    try:
        return field.outside(parse_quantity(text, dimension)) is None
    except UnitError:
        return False
