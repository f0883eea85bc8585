"""Whether a tree is valid by a schema: yes or no, and quick.

`jsonschema` says what is wrong with a tree, and is asked only when something is: nearly every tree
is right, and to find that out takes it as long as all the checks of a mission. Both read the same
schemas, and `tests/dsl/test_quick.py` holds them to the same answers.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import Any

from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence, to_json
from kybflow.dsl.schema.building import Schema, with_nulls

_Test = Callable[[Any], bool]
_TYPES: dict[str, tuple[type, ...]] = {
    "object": (Mapping,), "array": (Sequence,), "string": (str,), "number": (int, float),
    "integer": (int,), "boolean": (bool,), "null": (type(None),),
}  # fmt: skip
_BOUNDS: dict[str, Callable[[Any, Any], bool]] = {
    "minimum": operator.le,
    "exclusiveMinimum": operator.lt,
    "maximum": operator.ge,
    "exclusiveMaximum": operator.gt,
}
"""How each bound stands to the values that it allows."""
_KEYWORDS = frozenset(
    {
        "type", "enum", "const", "anyOf", "if", "then", "else", "pattern", "maxLength", *_BOUNDS,
        "properties", "required", "additionalProperties", "propertyNames", "minProperties",
        "items", "minItems", "maxItems", "title", "description", "examples", "x-dimension",
    }
)  # fmt: skip


class QuickValidator:
    """Judges nodes by one schema, with null allowed for every key that may be left out.

    It knows the keywords that the schemas of the language and of parts have, and raises ValueError
    for any other. A schema is read when the first node is judged by it, as a mission has few of the
    language's keys.
    """

    def __init__(self, schema: Schema | bool) -> None:
        nothing: Schema = {"enum": ()}
        self._schema = ({} if schema else nothing) if isinstance(schema, bool) else schema

    def is_valid(self, node: Node) -> bool:
        """Whether `jsonschema` finds nothing wrong with `node`."""
        return self._accepts(to_json(node) if isinstance(node, Scalar) else node)

    def _accepts(self, value: Any) -> bool:
        """Whether a mapping, a sequence or the value of a scalar is valid."""
        tests = self._tests.get(type(value))
        if tests is None:
            return False
        for test in tests:  # noqa: SIM110, `all` takes twice as long
            if not test(value):
                return False
        return True

    @cached_property
    def _tests(self) -> dict[type, tuple[_Test, ...]]:
        """What a value must pass, by its type; no entry for a type that is never valid."""
        schema = with_nulls(self._schema)
        if not schema.keys() <= _KEYWORDS:
            raise ValueError(f"unknown keywords: {', '.join(schema.keys() - _KEYWORDS)}")
        kinds = schema.get("type", list(_TYPES))
        types = [t for kind in ([kinds] if isinstance(kinds, str) else kinds) for t in _TYPES[kind]]
        tests = {kind: (*_of_type(kind, schema), *_of_any(schema)) for kind in types}
        if int in tests and float not in tests:
            tests[float] = (float.is_integer, *tests[int])
        return tests


def _of_type(kind: type, schema: Schema) -> Iterator[_Test]:
    """The tests of the keywords that speak of one type of value."""
    if kind is Mapping:
        yield from _of_mapping(schema)
    elif kind is Sequence:
        yield from _of_sequence(schema)
    elif kind is str:
        yield from _of_text(schema)
    elif kind in (int, float):
        for keyword in _BOUNDS.keys() & schema.keys():
            yield partial(_BOUNDS[keyword], schema[keyword])


def _of_mapping(schema: Schema) -> Iterator[_Test]:
    required, fewest = frozenset(schema.get("required", ())), schema.get("minProperties", 0)
    known = {name: QuickValidator(inner) for name, inner in schema.get("properties", {}).items()}
    others = QuickValidator(schema.get("additionalProperties", True))
    if required:
        yield lambda node: required <= node.entries.keys()
    if fewest:
        yield lambda node: len(node.entries) >= fewest
    if "propertyNames" in schema:
        names = QuickValidator(schema["propertyNames"])
        yield lambda node: all(map(names._accepts, node.entries))
    if known or "additionalProperties" in schema:
        yield lambda node: all(
            known.get(key, others).is_valid(entry.value) for key, entry in node.entries.items()
        )


def _of_sequence(schema: Schema) -> Iterator[_Test]:
    if "minItems" in schema or "maxItems" in schema:
        low, high = schema.get("minItems", 0), schema.get("maxItems", float("inf"))
        yield lambda node: low <= len(node.items) <= high
    if "items" in schema:
        items = QuickValidator(schema["items"])
        yield lambda node: all(map(items.is_valid, node.items))


def _of_text(schema: Schema) -> Iterator[_Test]:
    if "maxLength" in schema:
        longest = schema["maxLength"]
        yield lambda text: len(text) <= longest
    if "pattern" in schema:
        search = re.compile(schema["pattern"]).search
        yield lambda text: search(text) is not None


def _of_any(schema: Schema) -> Iterator[_Test]:
    """The tests of the keywords that speak of values of every type."""
    if "enum" in schema or "const" in schema:
        known = [*schema.get("enum", ()), *([schema["const"]] if "const" in schema else ())]
        yield lambda value: any(_is_same(value, one) for one in known)
    if "anyOf" in schema:
        either = [QuickValidator(one) for one in schema["anyOf"]]
        yield lambda value: any(one._accepts(value) for one in either)
    if "if" in schema:
        condition = QuickValidator(schema["if"])
        then, otherwise = (QuickValidator(schema.get(key, True)) for key in ("then", "else"))
        yield lambda value: (then if condition._accepts(value) else otherwise)._accepts(value)


def _is_same(a: object, b: object) -> bool:
    """Equality of JSON, where `true` is not 1."""
    return a == b and isinstance(a, bool) is isinstance(b, bool)
