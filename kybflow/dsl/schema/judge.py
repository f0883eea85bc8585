"""Trees judged by their schemas, in our words: each error of `jsonschema` becomes a finding with a
place and a way out."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from kybflow.core.params import fields_of
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, Stopped
from kybflow.dsl.reading.nodes import (
    Mapping,
    Node,
    Scalar,
    Sequence,
    describe,
    entries_of,
    head_of,
    to_json,
)
from kybflow.dsl.schema.building import Schema, nullable, params_schema
from kybflow.dsl.schema.explain import SchemaViolation, explain
from kybflow.dsl.schema.mission import library_schema, skeleton
from kybflow.dsl.schema.quick import QuickValidator

if TYPE_CHECKING:
    from jsonschema import ValidationError
    from jsonschema.protocols import Validator


class _Schema:
    """A schema of the language or of a part, and what judges by it: the quick validator whether a
    tree is valid, `jsonschema` what is wrong with one that isn't."""

    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self._quick = QuickValidator(schema)

    def errors(self, root: Node) -> Iterator[ValidationError]:
        if not self._quick.is_valid(root):
            yield from self._validator.iter_errors(to_json(root))

    @functools.cached_property
    def _validator(self) -> Validator:
        from jsonschema import Draft202012Validator  # takes longer to import than all else in `dsl`

        return Draft202012Validator(nullable(self.schema))


@functools.cache
def _skeleton(kind: str) -> _Schema:
    return _Schema(skeleton() if kind == "mission" else library_schema())


@functools.cache
def _part(params: type) -> _Schema:
    return _Schema(params_schema(fields_of(params), ""))


def judge_file(root: Node, kind: str) -> list[Diagnostic]:
    """What is wrong with the shape of a whole file; `kind` is mission or library."""
    return list(_findings(root, _skeleton(kind)))


def misplaced(root: Mapping, before: Mapping | None) -> Iterator[Diagnostic]:
    """KYB103 for each point where the language has a name: a parameter or a point of the world
    brought it there after the shape of the file was judged. What is the same as in `before` has
    none."""
    yield from _misplaced(root, before, _skeleton("mission").schema, "")


def _misplaced(
    node: Mapping | Sequence, before: Node | None, schema: Schema, name: str
) -> Iterator[Diagnostic]:
    if isinstance(node, Sequence):
        if "type" in schema and "array" not in schema["type"]:
            message = f"`{name}` must be a name, but this is a point"
            yield Diagnostic("KYB103", message, node.span)
        elif isinstance(items := schema.get("items"), dict) and "x-dimension" not in items:
            for item in node.items:
                if not isinstance(item, Scalar):
                    yield from _misplaced(item, None, items, name)
        return
    known, others = schema.get("properties", {}), schema.get("additionalProperties")
    same = entries_of(before)
    for key, entry in node.entries.items():
        value = entry.value
        if isinstance(value, Scalar) or (key in same and same[key].value is value):
            continue
        if isinstance(inner := known.get(key, others), dict):
            yield from _misplaced(value, same[key].value if key in same else None, inner, key)


def is_library(root: Node) -> bool:
    """Whether the file offers things to missions instead of being one."""
    return isinstance(root, Mapping) and "library" in root.entries and "mission" not in root.entries


def judge_mission(root: Node) -> Diagnosed[Mapping]:
    """The top level of a mission. Raises Stopped when its shape has errors."""
    if not isinstance(root, Mapping) or "mission" not in root.entries:
        hint = "a mission begins with `kybflow: 1` and `mission: NAME`"
        what = (
            f"this is {describe(root)}" if not isinstance(root, Mapping) else "`mission` is missing"
        )
        yield Diagnostic("KYB102", f"a mission is needed, but {what}", head_of(root), help=hint)
        raise Stopped
    findings = judge_file(root, "mission")
    yield from findings
    if findings:
        raise Stopped
    return root


def judge_params(
    node: Mapping, params: type, part: str, beside: frozenset[str] = frozenset()
) -> list[Diagnostic]:
    """What is wrong with the parameters of `part`; `node` has nothing but them. `beside` are the
    keys of the place, which could be meant too."""
    return list(_findings(node, _part(params), part, beside))


def _findings(
    root: Node,
    judged_by: _Schema,
    part: str = "",
    beside: frozenset[str] = frozenset(),
) -> Iterator[Diagnostic]:
    for error in judged_by.errors(root):
        node, name = _locate(root, error.absolute_path)
        schema = error.schema if isinstance(error.schema, dict) else {}
        yield from explain(
            SchemaViolation(
                str(error.validator),
                error.validator_value,
                error.instance,
                schema,
                node,
                name,
                part,
                beside,
            )
        )


def _locate(root: Node, path: Any) -> tuple[Node, str]:
    """The node at `path` and the name by which a person would call it."""
    node, name = root, ""
    for step in path:
        if isinstance(node, Mapping):
            node, name = node.entries[step].value, step
        elif isinstance(node, Sequence):
            node, name = node.items[step], name if name.endswith("]") else f"{name}[{step}]"
    return node, name
