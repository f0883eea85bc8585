"""The parts of a library, judged without a mission. What only a mission brings is left to it: a
parameter without a value, a named point, what an entry to start from lacks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.diagnostics.spans import PREFIX, Span
from kybflow.dsl.expanding.flows import flows_of
from kybflow.dsl.expanding.mission import airframes_of
from kybflow.dsl.expanding.world import world_of
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.plan import LISTS, EstimatorPlan, StatePlan
from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence, entries_of, items_of
from kybflow.dsl.resolving.exports import EMPTY, chain_of, stack_of

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

_LACKING = frozenset({"KYB102", "KYB108"})


def judge_library(library: Mapping, catalog: Catalog, found: Findings) -> None:
    """Report what is wrong with the worlds, airframes, parts and flows of a library, each of whose
    sections is whole, but for its chains, which are as written."""
    decoder = Decoder(catalog, found)
    for entry in entries_of(library.get("worlds")).values():
        world_of(entry.value, decoder)
    airframes_of(library, decoder)
    left, own = set[Span](), Findings()
    decoder = Decoder(catalog, own)
    for section in ("vehicles", "stacks", "chains"):
        for entry in entries_of(library.get(section)).values():
            if isinstance(entry.value, Mapping):
                _judge_parts(entry.value, decoder)
    flows_of(library.get("flows"), decoder)
    for section in ("vehicles", "stacks", "chains", "flows"):
        left.update(_left_open(library.get(section) or EMPTY))
    found.add(f for f in own.all if f.code not in _LACKING and f.span not in left)


def _judge_parts(body: Mapping, decoder: Decoder) -> None:
    for kind in LISTS:
        for item in items_of(body.get(kind)):
            if stack_of(item) is not None:
                continue
            if kind == "estimators":
                decoder.record(EstimatorPlan, item, item.span)
            else:
                decoder.part(kind, item)
    tracker = body.get("tracker")
    if tracker is not None:
        decoder.part("trackers", tracker)
    for name, entry in entries_of(body.get("behaviors")).items():
        if isinstance(entry.value, Mapping) and chain_of(entry.value) is None:
            decoder.record(
                StatePlan, entry.value, entry.key.span, name=name, legs=(), transitions=()
            )


def _left_open(node: Node) -> Iterator[Span]:
    """The place of each value that only a mission gives."""
    if isinstance(node, Scalar):
        if "$" in node.text or node.text.startswith(PREFIX):
            yield node.span
        return
    inside = node.items if isinstance(node, Sequence) else (e.value for e in node.entries.values())
    for value in inside:
        yield from _left_open(value)
