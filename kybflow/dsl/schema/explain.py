"""Each error of `jsonschema` in our words: what was found, where, and a way out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from kybflow.core.errors import UnitError
from kybflow.core.params import Field
from kybflow.core.text import did_you_mean, nearest
from kybflow.core.units import DIMENSIONS, NUMBER, article, parse_quantity
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, collect
from kybflow.dsl.reading.nodes import (
    Mapping,
    Node,
    Scalar,
    Sequence,
    describe,
    head_of,
)
from kybflow.dsl.reading.slips import CONDITIONS, missing_colon
from kybflow.dsl.reading.values import TYPES, decode, quantity_field
from kybflow.dsl.schema.building import BOUNDS

CODES = {
    "KYB101": "A key that the language doesn't have there.",
    "KYB102": "A key that is needed and missing.",
    "KYB103": "A value of the wrong shape: a list where a mapping is needed, and so on.",
    "KYB106": "Nothing where something is needed.",
    "KYB107": "A parameter that the part doesn't have.",
    "KYB108": "A part without a parameter that it needs.",
    "KYB110": "A name that can't be one.",
    "KYB111": "A version of the language that this program doesn't read.",
}
_NEVER = {("library", "kybflow"): "remove it; a library begins with `library:`"}
_MISSING = {"kybflow": "write `kybflow: 1`", "use": "write `use: NAME`"}
_SHAPES = {
    "object": "a mapping",
    "array": "a list",
    "string": "text",
    "number": "a number",
    "boolean": "`true` or `false`",
    "integer": "a whole number",
}


class SchemaViolation(NamedTuple):
    """One error of `jsonschema`: the keyword that failed, what it wanted, the value and the schema;
    the node that it is about, the name by which a person would call that, and the part whose
    parameters are judged, with the keys beside them that could be meant too."""

    keyword: str
    wanted: Any
    instance: Any
    schema: dict[str, Any]
    node: Node
    name: str
    part: str
    beside: frozenset[str] = frozenset()


def explain(fault: SchemaViolation) -> Iterator[Diagnostic]:
    """The findings that say what `fault` means."""
    if fault.keyword == "pattern" and isinstance(fault.node, Mapping):
        return _explain_name(fault)
    if "maxLength" in fault.schema and fault.keyword in ("pattern", "maxLength"):
        return _explain_title(fault)
    return _EXPLAINERS.get(fault.keyword, _explain_value)(fault)


def _explain_unknown(fault: SchemaViolation) -> Iterator[Diagnostic]:
    node = fault.node
    assert isinstance(node, Mapping)
    known = fault.schema["properties"]
    for key, entry in node.entries.items():
        if key in known:
            continue
        if fault.part:
            message = f"`{key}` is no parameter of `{fault.part}`"
            hint = meant(fault.part, key, node, known, fault.beside)
            yield Diagnostic("KYB107", message, entry.key.span, help=hint)
        else:
            what = fault.schema["title"]
            hint = _NEVER.get((what, key)) or did_you_mean(key, known)
            yield Diagnostic(
                "KYB101", f"`{key}` is no key of {article(what)}", entry.key.span, help=hint
            )


def _explain_missing(fault: SchemaViolation) -> Iterator[Diagnostic]:
    node = fault.node
    assert isinstance(node, Mapping)
    is_closed = fault.schema.get("additionalProperties") is False
    unknown = [k for k in node.entries if is_closed and k not in fault.schema["properties"]]
    for key in fault.wanted:
        if node.get(key) is not None or nearest(key, unknown):
            continue  # the misspelt key is reported already
        if fault.part:
            hint = how_to_write(key, fault.schema["properties"][key])
            message = f"`{fault.part}` needs `{key}`"
            yield Diagnostic("KYB108", message, node.span, help=hint)
        else:
            what, hint = fault.schema["title"], _MISSING.get(key, "")
            others = [k for k in node.entries if k not in fault.schema["properties"]]
            near = [k for k in ("use", "stack") if nearest(k, others)]
            if key == "use" and near and near[0] in fault.schema["properties"]:
                hint = f"did you mean `{near[0]}`?"
            message = f"{article(what)} needs `{key}`"
            yield Diagnostic("KYB102", message, head_of(node), help=hint)


def _explain_value(fault: SchemaViolation) -> Iterator[Diagnostic]:
    """A type, a pattern, a bound, a choice: our own decoder says it best where it can."""
    node, name = fault.node, fault.name
    schema = fault.schema
    field = _field(name, schema)
    found = [] if field is None else collect(decode(node, field)).diagnostics
    if found:
        yield from found
        return
    types = fault.wanted if fault.keyword == "type" else schema.get("type", ())
    types = [types] if isinstance(types, str) else [t for t in types if t != "null"]
    if len(types) > 1 and schema.get("pattern", "").startswith("^\\$"):
        types.remove("string")
    wanted = " or ".join(dict.fromkeys(_SHAPES[t] for t in types)) or "another value"
    place = f"`{name}`" if name else f"{article(schema.get('title', 'file'))}"
    shown = f" `{node.text[:60]}`" if isinstance(node, Scalar) and node.text else ""
    hint = ""
    if name in CONDITIONS:
        hint = "write a condition, like `state.altitude > 1 m`"
    elif name == "log" and isinstance(node, Mapping):
        hint = "write a text that has braces in quotes"
    elif isinstance(node, Scalar) and "object" in types and missing_colon(node.text):
        hint = missing_colon(node.text)
    elif isinstance(node, Scalar) and "array" in types and node.text.startswith("-"):
        hint = "a list has a space after each `-`"
    elif wanted == "text" and isinstance(node, Scalar):
        hint = f'write "{node.text[:60]}" in quotes if you mean the text'
    elif schema.get("examples") and fault.keyword == "type":
        own = name.rpartition("[")[0] or name
        hint = f"write it like `{own}: {_flow(schema['examples'][0])}`"
        if schema.get("title") == "parameter" and isinstance(node, Scalar) and node.text in TYPES:
            hint = f"write `{own}: {{type: {node.text}}}`"
    yield Diagnostic(
        "KYB103",
        f"{place} must be {wanted}, but this is {describe(node)}{shown}",
        node.span,
        help=hint or _reshaped(node, types, name.rpartition("[")[0] or name),
    )


def _reshaped(node: Node, types: list[str], name: str) -> str:
    """How a list, or a mapping, is written that is the other one or a bare text."""
    if types == ["object"] and isinstance(node, Sequence):
        return f"write it in braces: `{name}: {{...}}`" if name else ""
    if types == ["array"] and isinstance(node, Mapping):
        return f"write it in brackets: `{name}: [{{...}}]`" if name else ""
    if types == ["array"] and isinstance(node, Scalar) and node.text:
        return "write it as a list: each on a line of its own, behind `- `"
    return ""


def _field(name: str, schema: dict[str, Any]) -> Field | None:
    """The field that a schema was made of, as far as its decoder asks; None where that is none."""
    dimension = DIMENSIONS.get(schema.get("x-dimension", ""))
    if dimension is not None:
        shape = "vector" if "items" in schema else "scalar"
        return quantity_field(name, dimension, shape, **_bounds(schema))
    choices = tuple(schema.get("anyOf", [{}])[0].get("enum", ()))
    if choices or (_bounds(schema) and "integer" in schema.get("type", ())):
        plain = quantity_field(name, NUMBER, "choice" if choices else "integer", **_bounds(schema))
        return replace(plain, dimension=None, choices=choices)
    return None


def _flow(value: Any) -> str:
    """An example as YAML in one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(inner)}" for key, inner in value.items()) + "}"
    return "[" + ", ".join(map(_flow, value)) + "]" if isinstance(value, list) else str(value)


def _bounds(schema: dict[str, Any]) -> dict[str, Any]:
    return {ours: schema[theirs] for theirs, ours in BOUNDS.items() if theirs in schema}


def _explain_version(fault: SchemaViolation) -> Iterator[Diagnostic]:
    node = fault.node
    shown = node.text if isinstance(node, Scalar) else describe(node)
    yield Diagnostic(
        "KYB111",
        f"version `{shown}` of the language is not known here",
        node.span,
        help="this program reads `kybflow: 1`",
    )


def _explain_empty(fault: SchemaViolation) -> Iterator[Diagnostic]:
    yield Diagnostic("KYB106", f"`{fault.name}` is empty", fault.node.span)


def _explain_few(fault: SchemaViolation) -> Iterator[Diagnostic]:
    """A list of the language, that is; those of parts have a decoder."""
    if fault.part or fault.wanted != 1:
        yield from _explain_value(fault)
    else:
        hint = f"name one at least, or leave out `{fault.name}`"
        yield Diagnostic("KYB106", f"`{fault.name}` is empty", fault.node.span, help=hint)


def _explain_name(fault: SchemaViolation) -> Iterator[Diagnostic]:
    node = fault.node
    assert isinstance(node, Mapping)
    bad = str(fault.instance)
    yield Diagnostic(
        "KYB110",
        f"`{bad}` can't be a name",
        node.entries[bad].key.span,
        help="a name has letters, digits and `_`, and begins with no digit",
    )


def _explain_title(fault: SchemaViolation) -> Iterator[Diagnostic]:
    most = fault.schema["maxLength"]
    found = repr(str(fault.instance)[:most])[1:-1]
    yield Diagnostic(
        "KYB110",
        f"`{found}` can't be the name of a {fault.name}",
        fault.node.span,
        help=f"a name has letters, digits and `_`, begins with no digit and has at most {most}",
    )


_EXPLAINERS = {
    "additionalProperties": _explain_unknown,
    "required": _explain_missing,
    "const": _explain_version,
    "minProperties": _explain_empty,
    "minItems": _explain_few,
}


_SURE = 0.75
Schemas = dict[str, dict[str, Any]]


def meant(part: str, key: str, node: Mapping, known: Schemas, beside: frozenset[str]) -> str:
    """The help line for an unknown key: a parameter with a similar name, a key beside the
    parameters, the one parameter that fits the value; else every parameter."""
    if not known:
        return f"`{part}` has no parameters"
    if key.lower() in known and key.lower() in node.entries:
        return f"`{key.lower()}` is written, too: remove one of them"
    one = nearest(key, known) or nearest(key, beside, _SURE)
    near = [one] if one else []
    if not near and "for" in beside:  # a fault: what it is to do could be meant as well as when
        return did_you_mean(key, {*known, *beside})
    if not near:
        free = {name: schema for name, schema in known.items() if name not in node.entries}
        fitting = list(_fitting(node.entries[key].value, free))
        near = fitting if len(fitting) == 1 else []
    if near:
        return did_you_mean(near[0], {*known, *beside})
    names = ", ".join(f"`{name}`" for name in sorted(known))
    return f"the parameters of `{part}` are {names}"


def _fitting(value: Node, known: Schemas) -> Iterator[str]:
    """The parameters that can have a value: lists of the same depth, quantities with its unit."""
    for name, schema in known.items():
        dimension = DIMENSIONS.get(schema.get("x-dimension", ""))
        if isinstance(value, Sequence) and "items" in schema:
            is_path = "items" in schema["items"]
            if is_path == any(isinstance(item, Sequence) for item in value.items):
                yield name
        if isinstance(value, Scalar) and dimension is not None and "items" not in schema:
            try:
                parse_quantity(value.text, dimension)
            except UnitError:
                continue
            if not value.text.strip()[-1:].isdigit():
                yield name


def how_to_write(name: str, schema: dict[str, Any]) -> str:
    """A parameter as an author writes it, and what it is."""
    about = str(schema.get("description", "")).split(". ")[0].rstrip(".")
    example = _example(schema)
    how = f"write `{name}: {example}`" if example else f"write `{name}: ...`"
    return f"{how}: {about[:1].lower()}{about[1:]}" if about else how


def _example(schema: dict[str, Any]) -> str:
    """A value that a schema allows; empty where only its author knows one."""
    if "items" in schema and "items" in schema["items"]:
        return f"[{_example(schema['items'])}, ...]"
    dimension = DIMENSIONS.get(schema.get("x-dimension", ""))
    if dimension is None:
        return ""
    return f"[{', '.join([dimension.example] * 3)}]" if "items" in schema else dimension.example
