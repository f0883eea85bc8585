"""`jsonschema` judges, in our words: each of its errors becomes a finding with a place and a way
out."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError

from kybflow.dsl import schema as schemas
from kybflow.dsl.diagnostics import Diagnostic, did_you_mean
from kybflow.dsl.nodes import NAME, Mapping, Node, Scalar, Sequence, describe, to_json
from kybflow.dsl.source import Span
from kybflow.dsl.values import decode, quantity_field
from kybflow.params import Field
from kybflow.units import DIMENSIONS

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
LATER = frozenset({"flows", "groups", "on", "faults", "chains", "inputs", "obstacles", "sensors"})
_SHAPES = {
    "object": "a mapping",
    "array": "a list",
    "string": "text",
    "number": "a number",
    "boolean": "`true` or `false`",
    "integer": "a whole number",
}


@functools.cache
def _skeleton(kind: str) -> Draft202012Validator:
    return Draft202012Validator(
        schemas.skeleton() if kind == "mission" else schemas.library_schema()
    )


@functools.cache
def _part(fields: tuple[Field, ...]) -> Draft202012Validator:
    return Draft202012Validator(schemas.params_schema(fields, ""))


def judge_file(root: Node, kind: str) -> list[Diagnostic]:
    """What is wrong with the shape of a whole file; `kind` is mission or library."""
    return list(_findings(root, _skeleton(kind)))


def judge_mission(root: Node, found: list[Diagnostic]) -> Mapping | None:
    """The top level of a mission; None when its shape has errors."""
    if not isinstance(root, Mapping) or "mission" not in root.entries:
        hint = "a mission begins with `kybflow: 1` and `mission: NAME`"
        if isinstance(root, Mapping) and "library" in root.entries:
            hint = "this file is a library: import it from a mission"
        what = f"this is {describe(root)}" if not isinstance(root, Mapping) else "`mission` is missing"
        found.append(Diagnostic("KYB102", f"a mission is needed, but {what}", head_of(root), help=hint))
        return None
    findings = judge_file(root, "mission")
    found += findings
    return None if findings else root


def judge_params(node: Mapping, fields: tuple[Field, ...], part: str) -> list[Diagnostic]:
    """What is wrong with the parameters of `part`; `node` has nothing but them."""
    return list(_findings(node, _part(fields), part))


def _findings(
    root: Node, validator: Draft202012Validator, part: str = ""
) -> Iterator[Diagnostic]:
    for error in validator.iter_errors(_without_nulls(to_json(root))):
        node, name = _locate(root, error.absolute_path)
        explain = _EXPLAIN.get(error.validator, _explain_value)
        yield from explain(error, node, name, part)


def _without_nulls(value: Any) -> Any:
    """`null` is the same as not written."""
    if isinstance(value, dict):
        return {k: _without_nulls(v) for k, v in value.items() if v is not None}
    return [_without_nulls(v) for v in value] if isinstance(value, list) else value


def _locate(root: Node, path: Any) -> tuple[Node, str]:
    """The node at `path` and the name by which a person would call it."""
    node, name = root, ""
    for step in path:
        if isinstance(node, Mapping):
            node, name = node.entries[step].value, step
        elif isinstance(node, Sequence):
            node, name = node.items[step], name if name.endswith("]") else f"{name}[{step}]"
    return node, name


def _explain_unknown(
    error: ValidationError, node: Node, name: str, part: str
) -> Iterator[Diagnostic]:
    assert isinstance(node, Mapping)
    known = error.schema["properties"]
    for key, entry in node.entries.items():
        if key in known:
            continue
        cut = _cut_by_yaml(node, key)
        if cut is not None:
            yield cut
        elif part:
            message = f"`{key}` is no parameter of `{part}`"
            help = did_you_mean(key, known) or f"`{part}` has no parameters"
            yield Diagnostic("KYB107", message, entry.key.span, help=help)
        else:
            what = error.schema["title"]
            help = did_you_mean(key, known)
            if key in LATER:
                help = f"this version of kybflow has no `{key}` yet"
            yield Diagnostic(
                "KYB101", f"`{key}` is no key of {article(what)}", entry.key.span, help=help
            )


def _cut_by_yaml(node: Mapping, key: str) -> Diagnostic | None:
    """What YAML made of `when: distance(a, b) < 1 m` inside of {...}: two keys."""
    keys = list(node.entries)
    before = keys.index(key) - 1
    if NAME.match(key) or before < 0:
        return None
    first = node.entries[keys[before]]
    if not isinstance(first.value, Scalar) or first.value.text.count("(") <= first.value.text.count(")"):
        return None
    return Diagnostic(
        "KYB101",
        f"YAML ends `{first.key.text}` at the comma and reads `{key}` as a key",
        node.entries[key].key.span,
        notes=(f"`{first.key.text}` is `{first.value.text}`",),
        help="the language has no commas: write `distance(a to b)`, `separation(a and b)`",
    )


def _explain_missing(
    error: ValidationError, node: Node, name: str, part: str
) -> Iterator[Diagnostic]:
    assert isinstance(node, Mapping)
    for key in error.validator_value:
        if node.get(key) is not None:
            continue
        if part:
            yield Diagnostic("KYB108", f"`{part}` needs `{key}`", head_of(node))
        else:
            what = error.schema["title"]
            yield Diagnostic("KYB102", f"{article(what)} needs `{key}`", head_of(node))


def head_of(node: Node) -> Span:
    """The first key of a mapping: a place for what is missing in it."""
    if isinstance(node, Mapping) and node.entries:
        return next(iter(node.entries.values())).key.span
    return node.span


def _explain_value(
    error: ValidationError, node: Node, name: str, part: str
) -> Iterator[Diagnostic]:
    """A type, a pattern, a bound: our own decoder says it best where there is a dimension."""
    schema = error.schema
    dimension = DIMENSIONS.get(schema.get("x-dimension", "")) if isinstance(schema, dict) else None
    if dimension is not None:
        found: list[Diagnostic] = []
        shape = "vector" if "items" in schema else "scalar"
        decode(node, quantity_field(name, dimension, shape, **_bounds(schema)), found)
        if found:
            yield from found
            return
    types = error.validator_value if error.validator == "type" else schema.get("type", ())
    types = [types] if isinstance(types, str) else types
    wanted = " or ".join(dict.fromkeys(_SHAPES[t] for t in types)) or "another value"
    place = f"`{name}`" if name else f"{article(schema.get('title', 'file'))}"
    shown = f" `{node.text[:60]}`" if isinstance(node, Scalar) and node.text else ""
    help = ""
    if wanted == "text" and isinstance(node, Scalar):
        help = f'write "{node.text[:60]}" in quotes if you mean the text'
    yield Diagnostic(
        "KYB103", f"{place} must be {wanted}, but this is {describe(node)}{shown}", node.span, help=help
    )


def _bounds(schema: dict[str, Any]) -> dict[str, Any]:
    names = {
        "exclusiveMinimum": "above", "minimum": "at_least",
        "exclusiveMaximum": "below", "maximum": "at_most",
    }  # fmt: skip
    return {ours: schema[theirs] for theirs, ours in names.items() if theirs in schema}


def _explain_version(
    error: ValidationError, node: Node, name: str, part: str
) -> Iterator[Diagnostic]:
    shown = node.text if isinstance(node, Scalar) else describe(node)
    yield Diagnostic(
        "KYB111",
        f"version `{shown}` of the language is not known here",
        node.span,
        help="this program reads `kybflow: 1`",
    )


def _explain_empty(
    error: ValidationError, node: Node, name: str, part: str
) -> Iterator[Diagnostic]:
    yield Diagnostic("KYB106", f"`{name}` is empty", node.span)


def _explain_name(
    error: ValidationError, node: Node, name: str, part: str
) -> Iterator[Diagnostic]:
    assert isinstance(node, Mapping)
    bad = str(error.instance)
    yield Diagnostic(
        "KYB110",
        f"`{bad}` can't be a name",
        node.entries[bad].key.span,
        help="a name has letters, digits and `_`, and begins with no digit",
    )


def article(noun: str) -> str:
    return f"{'an' if noun[:1] in 'aeiou' else 'a'} {noun}"


_EXPLAIN = {
    "additionalProperties": _explain_unknown,
    "required": _explain_missing,
    "const": _explain_version,
    "minProperties": _explain_empty,
    "pattern": _explain_value,
}
