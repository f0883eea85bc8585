"""The parts of a library, judged without a mission. What only a mission brings is left to it: a
parameter without a value, a named point, what an entry to start from lacks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, collect
from kybflow.dsl.diagnostics.spans import PREFIX, Span
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence, entries_of, items_of
from kybflow.dsl.resolving.exports import EMPTY, chain_of, stack_of
from kybflow.dsl.schema.building import LISTS
from kybflow.dsl.schema.mission import ESTIMATOR_KEYS
from kybflow.dsl.shaping.flows import flows_of
from kybflow.dsl.shaping.parts import PartDecoder
from kybflow.dsl.shaping.shape import airframes_of
from kybflow.dsl.shaping.states import KEYS
from kybflow.dsl.shaping.world import world_of

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

_LACKING = frozenset({"KYB102", "KYB108"})


def judge_library(library: Mapping, catalog: Catalog) -> Iterator[Diagnostic]:
    """What is wrong with the worlds, airframes, parts and flows of a library, each of whose
    sections is whole, but for its chains, which are as written."""
    for entry in entries_of(library.get("worlds")).values():
        yield from world_of(entry.value)
    yield from airframes_of(library)
    left, findings = set[Span](), collect(_judge(library, PartDecoder(catalog))).diagnostics
    for section in ("vehicles", "stacks", "chains", "flows"):
        left.update(_left_open(library.get(section) or EMPTY))
    yield from (f for f in findings if f.code not in _LACKING and f.span not in left)


def _judge(library: Mapping, uses: PartDecoder) -> Diagnosed[None]:
    for section in ("vehicles", "stacks", "chains"):
        for entry in entries_of(library.get(section)).values():
            if isinstance(entry.value, Mapping):
                yield from _judge_parts(entry.value, uses)
    yield from flows_of(library.get("flows"))


def _judge_parts(body: Mapping, uses: PartDecoder) -> Diagnosed[None]:
    for kind in LISTS:
        own = frozenset(ESTIMATOR_KEYS if kind == "estimators" else ())
        for item in items_of(body.get(kind)):
            if stack_of(item) is None:
                yield from uses.one(kind, item, own)
    tracker = body.get("tracker")
    if tracker is not None:
        yield from uses.one("trackers", tracker)
    for entry in entries_of(body.get("behaviors")).values():
        if isinstance(entry.value, Mapping) and chain_of(entry.value) is None:
            yield from uses.one("behaviors", entry.value, KEYS, "do")


def _left_open(node: Node) -> Iterator[Span]:
    """The place of each value that only a mission gives."""
    if isinstance(node, Scalar):
        if "$" in node.text or node.text.startswith(PREFIX):
            yield node.span
        return
    inside = node.items if isinstance(node, Sequence) else (e.value for e in node.entries.values())
    for value in inside:
        yield from _left_open(value)
