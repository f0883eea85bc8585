"""A file is taken exactly where `jsonschema` finds nothing wrong with it by the schema that is
generated from the same records: for every mission and library, with values, keys and whole branches
changed."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from toolchain import ROOT

from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.language.judge import has_shape, is_library
from kybflow.dsl.language.schema import record_schema
from kybflow.dsl.plan import Library, Plan
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, Sequence, to_json
from kybflow.dsl.reading.reader import compose

FILES = sorted((ROOT / "missions").glob("**/*.yaml"))
KINDS = {kind: Draft202012Validator(record_schema(kind)) for kind in (Plan, Library)}
VALUES = """[
  null, true, 1, 1.0, 1.5, -2, 100000, "", "1", " 3 m ", 3 m, 2 s, 40 %, 20 deg, +.5e-3, hover,
  std.mk_quadro, $name, $name.x, world.points.pad, "name\\n", up,
  aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa, [], [1, 2, 3],
  [1 m, 2 m, $z], [1, 2, 3, 4], [[0, 0, 1], [1, 1, 1]], [a, b], {}, {a: 1}, {a: null, b.c: {}},
  {1: x}, {stack: indoor}, {stack: indoor, use: fence}, {use: fence, as: null},
  {from: [0, 0, 0], to: [1, 1, 1]}, {like: other}, {phases: {}}, {phases: {a: {run: {x: y}}}},
  {type: length, default: 1 m}, {go: home, after: -1 s}, {event: a.landed, do: []},
]"""


def read(text: str) -> Node:
    found = Collector()
    root = compose(text, "test.yaml", found)
    assert root is not None
    assert not found.all
    return root


def values() -> tuple[Node, ...]:
    root = read(VALUES)
    assert isinstance(root, Sequence)
    return root.items


def places(node: Node, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Every place in a tree."""
    yield path
    if isinstance(node, Sequence):
        for index, item in enumerate(node.items):
            yield from places(item, (*path, index))
    elif isinstance(node, Mapping):
        for key, entry in node.entries.items():
            yield from places(entry.value, (*path, key))


def at(node: Node, path: tuple[str | int, ...]) -> Node:
    for step in path:
        node = node.items[step] if isinstance(node, Sequence) else node.entries[step].value
    return node


def changed(node: Node, path: tuple[str | int, ...], new: Node) -> Node:
    """The tree with `new` at a place."""
    if not path:
        return new
    step, rest = path[0], path[1:]
    if isinstance(node, Sequence):
        items = list(node.items)
        items[step] = changed(items[step], rest, new)
        return node._replace(items=tuple(items))
    entry = node.entries[step]
    inner = entry._replace(value=changed(entry.value, rest, new))
    return node._replace(entries={**node.entries, step: inner})


def drawn(
    generator: random.Random, root: Node, strange: tuple[Node, ...], donors: list[Node]
) -> Node:
    """The tree with one to three changes: another value or branch, a key that is missing, one that
    is misspelt, or one too many."""
    for _ in range(generator.randint(1, 3)):
        path = generator.choice(list(places(root)))
        node, how = at(root, path), generator.random()
        if isinstance(node, Mapping) and node.entries and how < 0.5:
            key = generator.choice(list(node.entries))
            rest = {k: e for k, e in node.entries.items() if k != key or how > 0.35}
            if how > 0.15:
                entry = node.entries[key]
                other = generator.choice(["unknown", "like", "as", "for", f"{key}s", "a.b", "1x"])
                rest[other] = MappingEntry(Scalar(other, entry.key.span), entry.value)
            root = changed(root, path, node._replace(entries=rest))
        elif how < 0.8:
            root = changed(root, path, generator.choice(strange))
        else:
            donor = generator.choice(donors)
            root = changed(root, path, at(donor, generator.choice(list(places(donor)))))
    return root


@pytest.mark.parametrize(
    ("seed", "trees"), [(1, 700), pytest.param(2, 4_000, marks=pytest.mark.thorough)]
)
def test_the_decoder_and_the_schema_agree(seed: int, trees: int) -> None:
    generator, strange = random.Random(seed), values()
    roots = [read(path.read_text(encoding="utf-8")) for path in FILES]
    valid = 0
    for _ in range(trees):
        root = drawn(generator, generator.choice(roots), strange, roots)
        kind = Library if is_library(root) else Plan
        taken = has_shape(root, kind)
        assert taken is KINDS[kind].is_valid(to_json(root)), to_json(root)
        valid += taken
    assert trees / 20 < valid < trees / 2, "trees that say nothing"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_file_is_taken(path: Path) -> None:
    root = read(path.read_text(encoding="utf-8"))
    kind = Library if is_library(root) else Plan
    assert has_shape(root, kind)
    assert KINDS[kind].is_valid(to_json(root))
