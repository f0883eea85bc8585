"""The parts of a library, judged without a mission. What only a mission brings is left to it: a
parameter without a value, a named point, what an entry to start from lacks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from kybflow.dsl.reading.nodes import Mapping, Node, Scalar, Sequence, entries_of, items_of
from kybflow.dsl.reading.source import PREFIX, Span
from kybflow.dsl.resolving.chain_nodes import chain_of
from kybflow.dsl.resolving.offers import EMPTY
from kybflow.dsl.resolving.stacks import LISTS, stack_of
from kybflow.dsl.schema.skeleton import ESTIMATOR_KEYS
from kybflow.dsl.shaping.flows import flows_of
from kybflow.dsl.shaping.shape import airframes_of
from kybflow.dsl.shaping.states import KEYS
from kybflow.dsl.shaping.uses import Uses

if TYPE_CHECKING:
    from kybflow.dsl.diagnostics.diagnostic import Diagnostic
    from kybflow.parts.catalog import Catalog

_LACKING = frozenset({"KYB102", "KYB108"})


def judge_parts(library: Mapping, catalog: Catalog, found: list[Diagnostic]) -> None:
    """Find what is wrong with the airframes, parts and flows of a library, whose vehicles, stacks
    and flows are whole and whose chains are as written."""
    list(airframes_of(library, catalog, found))
    findings: list[Diagnostic] = []
    uses, left = Uses(catalog, findings), set[Span]()
    for section in ("vehicles", "stacks", "chains"):
        for entry in entries_of(library.get(section)).values():
            _judge(entry.value, uses)
            left.update(_left_open(entry.value))
    flows_of(library.get("flows"), findings)
    left.update(_left_open(library.get("flows") or EMPTY))
    found += (f for f in findings if f.code not in _LACKING and f.span not in left)


def _judge(body: Node, uses: Uses) -> None:
    if not isinstance(body, Mapping):
        return
    for kind in LISTS:
        own = frozenset(ESTIMATOR_KEYS if kind == "estimators" else ())
        for item in items_of(body.get(kind)):
            if stack_of(item) is None:
                uses.one(kind, item, own)
    tracker = body.get("tracker")
    if tracker is not None:
        uses.one("trackers", tracker)
    for entry in entries_of(body.get("behaviors")).values():
        if isinstance(entry.value, Mapping) and chain_of(entry.value) is None:
            uses.one("behaviors", entry.value, KEYS, "do")


def _left_open(node: Node) -> Iterator[Span]:
    """The place of each value that only a mission gives."""
    if isinstance(node, Scalar):
        if "$" in node.text or node.text.startswith(PREFIX):
            yield node.span
        return
    inside = node.items if isinstance(node, Sequence) else (e.value for e in node.entries.values())
    for value in inside:
        yield from _left_open(value)
