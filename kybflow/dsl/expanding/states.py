"""Expand a vehicle's `behaviors` to its states.

States called `NAME.INNER` belong to the chain `NAME`; an entry `NAME` without `do` holds the
transitions of the whole chain. Each state of the chain has these transitions as well, after its
own, except that a chain's `next` comes first. Their times count from the entry of the chain.
"""

from __future__ import annotations

from collections.abc import Iterable

from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Findings
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.language.source import Source
from kybflow.dsl.names.built_in import failure_of
from kybflow.dsl.plan import Cause, ChainPlan, PartPlan, StatePlan, TransitionPlan, Ways
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, entries_of, is_null
from kybflow.dsl.resolving.chains import OF_CHAINS
from kybflow.parts.observables import chains_of

CODES = {
    "KYB143": "A transition without a condition, or a `for` without a `when`.",
}


def states_of(
    behaviors: dict[str, MappingEntry], decoder: Decoder
) -> dict[str, StatePlan | ChainPlan]:
    """Return the states and chains in the entries of `behaviors`, without the states that have
    errors."""
    entries = {name: e for name, e in behaviors.items() if not is_null(e.value)}
    names = [n for n, e in entries.items() if "do" in entries_of(e.value)]
    first: dict[str, str] = {}
    for name in names:
        for chain in chains_of(name):
            first.setdefault(chain, name)
    first = {chain: name for chain, name in first.items() if chain not in names}
    chains = {n: _chain(e, first, decoder) for n, e in entries.items() if n in first}
    found = {n: chains.get(n) or _state(e, first, chains, decoder) for n, e in entries.items()}
    return {name: one for name, one in found.items() if one is not None}


def _chain(entry: MappingEntry, first: dict[str, str], decoder: Decoder) -> ChainPlan:
    name, body = entry.key.text, entry.value
    assert isinstance(body, Mapping)
    for key, inner in body.entries.items():
        if key not in OF_CHAINS:
            message = f"`{key}` is not a key of a chain's own entry"
            hint = did_you_mean(key, OF_CHAINS)
            decoder.found.report("KYB101", message, inner.key.span, help=hint)
    chain: ChainPlan = decoder.record(ChainPlan, body, entry.key.span, entry.inherited, name=name)
    own = _written(chain, first, decoder.found)
    return chain.but(transitions=tuple(way.but(since=name) for way in own))


def _state(
    entry: MappingEntry, first: dict[str, str], chains: dict[str, ChainPlan], decoder: Decoder
) -> StatePlan | None:
    name = entry.key.text
    values = decoder.values(
        StatePlan, entry.value, entry.key.span, entry.inherited, name=name, legs=(), transitions=()
    )
    if values is None:
        return None
    part: PartPlan = values["behavior"]
    behavior = part.but(label=f"behaviors.{name}")
    state = StatePlan(**{**values, "behavior": behavior, "legs": part.cls.flight})
    around = [chains[c].transitions for c in chains_of(name) if c in chains]
    ways = _joined(_written(state, first, decoder.found), around, failure_of(state.legs))
    return state.but(transitions=ways)


def _written(
    entry: StatePlan | ChainPlan, first: dict[str, str], found: Findings
) -> list[TransitionPlan]:
    """Return the transitions of one entry. The target of `within` remains empty here. A chain as a
    target is replaced by its first state."""
    ways = [next_transition(way, found) for way in entry.next]
    causes: tuple[tuple[Cause, str | None], ...] = (("then", entry.then), ("failed", entry.failed))
    for cause, target in causes:
        if target is not None:
            ways.append(_following(entry, cause, target))
    if entry.within is not None:
        ways.append(_following(entry, "within", "", entry.within))
    return [
        way.but(target=first[way.target], enters=way.target) if way.target in first else way
        for way in ways
    ]


def _following(
    entry: StatePlan | ChainPlan, cause: Cause, target: str, after: float | None = None
) -> TransitionPlan:
    span = entry.span_of(cause)
    body = {} if cause == "within" else {"go": entry.source.node.entries[cause]}
    source = Source(span, Mapping(body, span))
    return TransitionPlan(cause=cause, target=target, after=after, at=span.at, source=source)


def _joined(own: list[TransitionPlan], around: list[Ways], implied: str) -> Ways:
    """Return the transitions of a state with those of the chains around it: every `next`, from the
    outermost chain to the state itself; `then` and `failed` of the state, or else of the nearest
    chain; every `within`, the state's own first. implied: the target of `within` if nothing has
    `failed`."""
    inward: list[Iterable[TransitionPlan]] = [own, *reversed(around)]
    transitions = [way for level in (*around, own) for way in level if way.cause == "next"]
    for cause in ("then", "failed"):
        nearest = _first_of(cause, inward)
        if nearest is not None:
            transitions.append(nearest)
    for depth, level in enumerate(inward):
        failed = _first_of("failed", inward[depth:])
        for way in level:
            if way.cause != "within":
                continue
            if failed is None:
                transitions.append(way.but(target=implied))
            else:
                place = way.source._replace(node=failed.source.node)
                target = {"target": failed.target, "enters": failed.enters, "source": place}
                transitions.append(way.but(**target))
    return tuple(transitions)


def _first_of(cause: str, levels: Iterable[Iterable[TransitionPlan]]) -> TransitionPlan | None:
    return next((way for level in levels for way in level if way.cause == cause), None)


def next_transition(way: TransitionPlan, found: Findings) -> TransitionPlan:
    """Return the transition of an item of `next` after checking that it has a condition
    (KYB143)."""
    if all(way.entry(key) is None for key in ("when", "event", "after")):
        message = f"the transition to `{way.target}` has no condition"
        hint = "add `when: CONDITION`, `event: NAME` or `after: 10 s`"
        found.report("KYB143", message, way.span_of("go"), help=hint)
    elif way.entry("when") is None and way.entry("for") is not None:
        message = f"`for` of the transition to `{way.target}` needs a `when`"
        found.report("KYB143", message, way.key_span("for"), help="`for` belongs to a `when`")
    return way
