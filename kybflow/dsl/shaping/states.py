"""A vehicle's `behaviors` to its states.

States called `NAME.INNER` are those of a chain, and an entry `NAME` without `do` has the arrows of
the chain as a whole: each state inside has them too, its own first but for `next`; their times
count from the entry of the chain.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from kybflow.dsl.diagnostics.diagnostic import Diagnostic, did_you_mean
from kybflow.dsl.document import ChainUse, PartUse, State, Transition
from kybflow.dsl.names.built_in import failure_of
from kybflow.dsl.reading.nodes import Entry, Mapping, Node, Scalar, items_of
from kybflow.dsl.reading.source import Span, Text
from kybflow.dsl.shaping.arrows import duration, next_arrow
from kybflow.dsl.shaping.uses import Uses
from kybflow.parts.observables import chains_of

KEYS = frozenset({"then", "next", "failed", "within", "estimators"})
_OF_CHAINS = KEYS - {"estimators"}


class States:
    """The states and chains of one vehicle."""

    def __init__(self, behaviors: Mapping, uses: Uses) -> None:
        self._uses, self._found = uses, uses.found
        self._names = {name for name, e in behaviors.entries.items() if not _is_chain(e.value)}
        self._first: dict[str, str] = {}
        for name in behaviors.entries:
            for chain in chains_of(name):
                if name in self._names:
                    self._first.setdefault(chain, name)
        self.chains: dict[str, ChainUse] = {}
        self.states: dict[str, State] = {}
        for name, entry in behaviors.entries.items():
            if name in self._first and name not in self._names:
                self.chains[name] = self._chain(entry)
        for name, entry in behaviors.entries.items():
            state = None if name in self.chains else self._state(entry)
            if state is not None:
                self.states[name] = state

    def goal(self, name: Text) -> tuple[Text, str]:
        """(the state to enter, the chain that is entered by that)."""
        first = self._first.get(name.text)
        if first is None or name.text in self._names:
            return name, ""
        return Text(first, name.span, verbatim=False), name.text

    def _chain(self, entry: Entry) -> ChainUse:
        name = entry.key.text
        assert isinstance(entry.value, Mapping)
        for key, inner in entry.value.entries.items():
            if key not in _OF_CHAINS:
                message, span = f"`{key}` is no key of a chain's own entry", inner.key.span
                self._found.append(
                    Diagnostic("KYB101", message, span, help=did_you_mean(key, _OF_CHAINS))
                )
        arrows = tuple(replace(a, since=name) for a in self._written(entry.value))
        return ChainUse(entry.key.as_text, arrows, entry.key.span)

    def _state(self, entry: Entry) -> State | None:
        name, node = entry.key, entry.value
        use = self._uses.one("behaviors", node, KEYS, "do")
        if use is None or not isinstance(node, Mapping):
            return None
        part = PartUse(use.name, use.spec, use.params, name.text, use.span, use.spans)
        around = [self.chains[c].transitions for c in chains_of(name.text) if c in self.chains]
        arrows = _joined(list(self._written(node)), around, _implied(part))
        first = (n for n in items_of(node.get("estimators")) if isinstance(n, Scalar))
        estimators = tuple(item.as_text for item in first)
        return State(name.as_text, part, arrows, name.span, entry.inherited, estimators)

    def _written(self, node: Mapping) -> Iterator[Transition]:
        """The arrows of one entry; the goal of `within` is that of its `failed`, else empty."""
        for item in items_of(node.get("next")):
            if isinstance(item, Mapping):
                arrow = next_arrow(item, self._found)
                target, enters = self.goal(arrow.target)
                yield replace(arrow, target=target, enters=enters) if enters else arrow
        for cause in ("then", "failed"):
            goal = node.get(cause)
            if isinstance(goal, Scalar):
                target, enters = self.goal(goal.as_text)
                yield Transition(cause, target, goal.span, enters=enters)
        limit = node.get("within")
        after = duration(node, "within", self._found, above=0.0)
        if limit is not None and after is not None:
            yield Transition("within", _nowhere(limit.span), limit.span, after=after)


def _is_chain(node: Node) -> bool:
    return isinstance(node, Mapping) and "do" not in node.entries


def _nowhere(span: Span) -> Text:
    return Text("", span, verbatim=False)


def _implied(part: PartUse) -> str:
    return failure_of(part.spec.cls.flight)


def _joined(
    own: list[Transition], around: list[tuple[Transition, ...]], implied: str
) -> tuple[Transition, ...]:
    """The arrows of a state: `next` of the chains around it from the outermost, and its own; `then`
    and `failed` of itself, else of the nearest chain; every `within`, its own first."""
    inward = [own, *reversed(around)]
    arrows = [a for level in (*around, own) for a in level if a.cause == "next"]
    for cause in ("then", "failed"):
        nearest = _first_of(cause, inward)
        if nearest is not None:
            arrows.append(nearest)
    for depth, level in enumerate(inward):
        failed = _first_of("failed", inward[depth:])
        for arrow in level:
            if arrow.cause == "within" and failed is not None:
                arrows.append(replace(arrow, target=failed.target, enters=failed.enters))
            elif arrow.cause == "within":
                arrows.append(replace(arrow, target=replace(arrow.target, text=implied)))
    return tuple(arrows)


def _first_of(cause: str, levels: Iterable[Iterable[Transition]]) -> Transition | None:
    return next((arrow for level in levels for arrow in level if arrow.cause == cause), None)
