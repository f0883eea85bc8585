"""A vehicle's `behaviors` to its states.

States called `NAME.INNER` are those of a chain, and an entry `NAME` without `do` has the
transitions of the chain as a whole: each state inside has them too, its own first but for `next`;
their times count from the entry of the chain.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from kybflow.core.text import did_you_mean
from kybflow.core.units import DURATION
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, every
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.document import ChainEntry, PartUse, StateEntry, TransitionEntry
from kybflow.dsl.names.built_in import failure_of
from kybflow.dsl.plan import Cause
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, items_of
from kybflow.dsl.reading.values import decode, quantity_field
from kybflow.dsl.shaping.parts import PartDecoder
from kybflow.parts.observables import chains_of

CODES = {
    "KYB143": "A transition that says nothing of when, or how long of nothing.",
}
KEYS = frozenset({"then", "next", "failed", "within", "estimators"})
_OF_CHAINS = KEYS - {"estimators"}


class States(NamedTuple):
    """The states and chains of one vehicle. `first` is the first state of each chain."""

    states: dict[str, StateEntry]
    chains: dict[str, ChainEntry]
    first: dict[str, str]

    def goal(self, name: Text) -> tuple[Text, str]:
        """(the state to enter, the chain that is entered by that)."""
        first = self.first.get(name.text)
        if first is None:
            return name, ""
        return Text(first, name.span, verbatim=False), name.text


def states_of(behaviors: Mapping, uses: PartDecoder) -> Diagnosed[States]:
    """The states and chains that `behaviors` says; a state with errors is left out."""
    names = [name for name, e in behaviors.entries.items() if not _is_chain(e.value)]
    first: dict[str, str] = {}
    for name in names:
        for chain in chains_of(name):
            first.setdefault(chain, name)
    found = States({}, {}, {chain: name for chain, name in first.items() if chain not in names})
    for name, entry in behaviors.entries.items():
        if name in found.first:
            found.chains[name] = yield from _chain(entry, found)
    for name, entry in behaviors.entries.items():
        state = None if name in found.chains else (yield from _state(entry, found, uses))
        if state is not None:
            found.states[name] = state
    return found


def _chain(entry: MappingEntry, states: States) -> Diagnosed[ChainEntry]:
    name = entry.key.text
    assert isinstance(entry.value, Mapping)
    for key, inner in entry.value.entries.items():
        if key not in _OF_CHAINS:
            message = f"`{key}` is no key of a chain's own entry"
            hint = did_you_mean(key, _OF_CHAINS)
            yield Diagnostic("KYB101", message, inner.key.span, help=hint)
    transitions = yield from _written(entry.value, states)
    return ChainEntry(
        entry.key.as_text, tuple(a._replace(since=name) for a in transitions), entry.key.span
    )


def _state(entry: MappingEntry, states: States, uses: PartDecoder) -> Diagnosed[StateEntry | None]:
    name, node = entry.key, entry.value
    use = yield from uses.one("behaviors", node, KEYS, "do")
    if use is None or not isinstance(node, Mapping):
        return None
    part = PartUse(use.name, use.spec, use.params, name.text, use.span, use.spans)
    chains = states.chains
    around = [chains[c].transitions for c in chains_of(name.text) if c in chains]
    own = yield from _written(node, states)
    transitions = _joined(own, around, failure_of(part.spec.cls.flight))
    first = (n for n in items_of(node.get("estimators")) if isinstance(n, Scalar))
    estimators = tuple(item.as_text for item in first)
    return StateEntry(name.as_text, part, transitions, name.span, entry.inherited, estimators)


def _written(node: Mapping, states: States) -> Diagnosed[list[TransitionEntry]]:
    """The transitions of one entry; the goal of `within` is that of its `failed`, else empty."""
    items = (item for item in items_of(node.get("next")) if isinstance(item, Mapping))
    transitions: list[TransitionEntry] = []
    for transition in (yield from every(next_transition(item) for item in items)):
        target, enters = states.goal(transition.target)
        transitions.append(
            transition._replace(target=target, enters=enters) if enters else transition
        )
    causes: tuple[Cause, ...] = ("then", "failed")
    for cause in causes:
        goal = node.get(cause)
        if isinstance(goal, Scalar):
            target, enters = states.goal(goal.as_text)
            transitions.append(TransitionEntry(cause, target, goal.span, enters=enters))
    limit = node.get("within")
    after = yield from duration(node, "within", above=0.0)
    if limit is not None and after is not None:
        nowhere = Text("", limit.span, verbatim=False)
        transitions.append(TransitionEntry("within", nowhere, limit.span, after=after))
    return transitions


def _is_chain(node: Node) -> bool:
    return isinstance(node, Mapping) and "do" not in node.entries


def _joined(
    own: list[TransitionEntry], around: list[tuple[TransitionEntry, ...]], implied: str
) -> tuple[TransitionEntry, ...]:
    """The transitions of a state: `next` of the chains around it from the outermost, and its own;
    `then` and `failed` of itself, else of the nearest chain; every `within`, its own first."""
    inward = [own, *reversed(around)]
    transitions = [a for level in (*around, own) for a in level if a.cause == "next"]
    for cause in ("then", "failed"):
        nearest = _first_of(cause, inward)
        if nearest is not None:
            transitions.append(nearest)
    for depth, level in enumerate(inward):
        failed = _first_of("failed", inward[depth:])
        for transition in level:
            if transition.cause == "within" and failed is not None:
                transitions.append(transition._replace(target=failed.target, enters=failed.enters))
            elif transition.cause == "within":
                transitions.append(
                    transition._replace(target=transition.target._replace(text=implied))
                )
    return tuple(transitions)


def _first_of(cause: str, levels: Iterable[Iterable[TransitionEntry]]) -> TransitionEntry | None:
    return next(
        (transition for level in levels for transition in level if transition.cause == cause), None
    )


def next_transition(node: Mapping) -> Diagnosed[TransitionEntry]:
    """The transition that an item of `next` is; its shape is judged already."""
    when, event, goal = node.get("when"), node.get("event"), node.get("go")
    emit = node.get("emit")
    assert isinstance(goal, Scalar)
    if when is None and event is None and node.get("after") is None:
        message = f"nothing says when to go to `{goal.text}`"
        hint = "add `when: CONDITION`, `event: NAME` or `after: 10 s`"
        yield Diagnostic("KYB143", message, goal.span, help=hint)
    elif when is None and node.get("for") is not None:
        message = f"nothing says what must hold before it goes to `{goal.text}`"
        span, hint = node.entries["for"].key.span, "`for` belongs to a `when`"
        yield Diagnostic("KYB143", message, span, help=hint)
    after = yield from duration(node, "after")
    hold = yield from duration(node, "for")
    return TransitionEntry(
        "next",
        goal.as_text,
        node.span,
        when=when.as_text if isinstance(when, Scalar) else None,
        event=event.as_text if isinstance(event, Scalar) else None,
        after=after,
        hold=hold or 0.0,
        emit=emit.as_text if isinstance(emit, Scalar) and not emit.is_null else None,
    )


def duration(keys: Mapping, key: str, above: float | None = None) -> Diagnosed[float | None]:
    """The seconds of `key`; None when it is not written or has errors."""
    node = keys.get(key)
    if node is None:
        return None
    at_least = 0.0 if above is None else None
    field = quantity_field(key, DURATION, above=above, at_least=at_least)
    value: float | None = yield from decode(node, field)
    return value
