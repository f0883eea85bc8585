"""The quick validator and `jsonschema` give the same answer: for every schema that there is and a
value of each kind, and for every mission, with each of its values changed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from kybflow.core.params import fields_of
from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.reading.composer import compose
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Sequence, to_json
from kybflow.dsl.schema.building import nullable, params_schema
from kybflow.dsl.schema.mission import library_schema, skeleton
from kybflow.dsl.schema.quick import QuickValidator
from kybflow.dsl.schema.world import AirframeCameraParams, GridParams, TagFile, TagParams
from kybflow.parts.catalog import BASES, load_catalog
from kybflow.world.vehicle_context import Airframe, Parcel

REPO = Path(__file__).parents[2]
MISSIONS = sorted((REPO / "missions").glob("**/*.yaml"))
LANGUAGE = {"mission": skeleton(), "library": library_schema()}
DECLARED = (Airframe, AirframeCameraParams, GridParams, Parcel, TagFile, TagParams)
VALUES = """
- null
- true
- 1
- 1.0
- 1.5
- -2
- 1e400
- 100000
- ""
- "1"
- " 3 m "
- 3 m
- 2 s
- 40 %
- 20 deg
- +.5e-3
- hover
- std.mk_quadro
- $name
- $name.x
- world.points.pad
- "name\\n"
- up
- aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa
- []
- [1, 2, 3]
- [1 m, 2 m, $z]
- [1, 2, 3, 4]
- [[0, 0, 1], [1, 1, 1]]
- [a, b]
- {}
- {a: 1}
- {a: null, b.c: {}}
- {1: x}
- {stack: indoor}
- {stack: indoor, use: fence}
- {use: fence, as: null}
- {from: [0, 0, 0], to: [1, 1, 1]}
- {like: other}
- {phases: {}}
- {phases: {a: {run: {x: y}}}}
- {type: length, default: 1 m}
- {go: home, after: -1 s}
- {event: a.landed, do: []}
"""


def read(text: str) -> Node:
    found = Findings()
    root = compose(text, "test.yaml", found)
    assert root is not None
    assert not found.all
    return root


def values() -> tuple[Node, ...]:
    root = read(VALUES)
    assert isinstance(root, Sequence)
    return root.items


def schemas_in(schema: Any) -> Iterator[Any]:
    """A schema and all inside of it."""
    yield schema
    if isinstance(schema, dict):
        inner = [*schema.get("properties", {}).values(), *schema.get("anyOf", ())]
        keys = ("items", "additionalProperties", "propertyNames", "if", "then", "else")
        for one in (*inner, *(schema[key] for key in keys if key in schema)):
            yield from schemas_in(one)


def parts() -> Iterator[type]:
    catalog = load_catalog()
    for kind in BASES:
        yield from (catalog.get(kind, name).params for name in catalog.names(kind))


def unequal(schema: Any, nodes: tuple[Node, ...]) -> list[object]:
    """The values about which the two disagree."""
    quick, slow = QuickValidator(schema), Draft202012Validator(nullable(schema))
    trees = ((node, to_json(node)) for node in nodes)
    return [tree for node, tree in trees if quick.is_valid(node) != slow.is_valid(tree)]


def test_every_schema_has_one_meaning() -> None:
    declared = [params_schema(fields_of(cls), "") for cls in (*parts(), *DECLARED)]
    every = {repr(one): one for s in (*LANGUAGE.values(), *declared) for one in schemas_in(s)}

    nodes = values()
    wrong = [(schema, found) for schema in every.values() if (found := unequal(schema, nodes))]
    assert wrong == []


def changed(node: Node, new: Node) -> Iterator[Node]:
    """The tree with `new` in the place of each of its nodes in turn, and without each key."""
    yield new
    if isinstance(node, Sequence):
        for index, item in enumerate(node.items):
            for inner in changed(item, new):
                yield node._replace(items=(*node.items[:index], inner, *node.items[index + 1 :]))
    elif isinstance(node, Mapping):
        for key, entry in node.entries.items():
            rest = {k: e for k, e in node.entries.items() if k != key}
            yield node._replace(entries=rest)
            yield node._replace(entries={**rest, "unknown": MappingEntry(entry.key, entry.value)})
            for inner in changed(entry.value, new):
                yield node._replace(entries={**node.entries, key: entry._replace(value=inner)})


@pytest.mark.parametrize("every", [42, pytest.param(7, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("path", MISSIONS, ids=lambda path: path.stem)
def test_every_mission_is_judged_alike(path: Path, every: int) -> None:
    """With one of `every` so many of its changes."""
    root = read(path.read_text(encoding="utf-8"))
    schema = LANGUAGE["library" if path.parent.name == "library" else "mission"]
    assert unequal(schema, (root,)) == []
    assert QuickValidator(schema).is_valid(root)

    nodes = (tree for new in values()[::6] for tree in changed(root, new))
    assert unequal(schema, tuple(islice(nodes, 0, None, every))) == []


def test_an_unknown_keyword_is_refused() -> None:
    validator = QuickValidator({"patternProperties": {}})
    with pytest.raises(ValueError, match="unknown keywords: patternProperties"):
        validator.is_valid(read("a: 1"))
