"""Chains: behaviors that are used as one. `pick: {do: chain.pick_up, height: 1 m, then: home}`
becomes the states `pick.over`, `pick.down`, ... of the chain with its parameters in place, the
first one on top, and, as `pick`, the transitions of the use, which hold for all of them.

A state inside that has no `then`, or `then: end`, leaves by the `then` of the use, and one that
fails without `failed` by its `failed`; `within` of the use bounds the whole chain; its `estimators`
hold for the states that name none.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

from kybflow.core.params import RESERVED
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, collect, every
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, Sequence, entries_of
from kybflow.dsl.resolving.exports import Exports, chain_of
from kybflow.dsl.resolving.parameters import ParameterTable, Setting, declare
from kybflow.dsl.resolving.substitution import Substitution, known, names_in, unused_parameter

CODES = {
    "KYB158": "A chain whose transition, or `begin`, names a state that it does not have.",
    "KYB159": "A name that is taken: of a chain's parameter, or of a state inside of a chain.",
    "KYB160": "Chains that use each other in a cycle, or more uses than a mission may have.",
    "KYB161": "A transition to `end` in a chain whose use does not say what follows.",
}
MAX_USES = 2000
END = "end"
"""The goal that leaves a chain."""
_TRANSITIONS = frozenset({"then", "next", "failed", "within"})
_KEYS = _TRANSITIONS | {"do", "estimators"}


class ChainExpansion(NamedTuple):
    """One use of a chain, being expanded: the name of the state, the `do` that names the chain, the
    transitions of the use, the file in which that name has its meaning, and the uses around this
    one, outermost first."""

    state: str
    do: Scalar
    body: Mapping
    exports: Exports
    around: tuple[ChainExpansion, ...] = ()
    inherited: bool = False
    is_alone: bool = False
    """Nothing uses it: its parameters may have no value."""

    @property
    def end(self) -> Node | None:
        """Where it goes when the chain is done: its `then`, else that of the chain around it."""
        own = self.body.get("then")
        return own if own is not None or not self.around else self.around[-1].end

    @property
    def places(self) -> tuple[Span, ...]:
        return tuple(use.do.span for use in (*self.around, self))


class Chains:
    """Expands chains in the vehicles of one mission. What several vehicles share is expanded
    once."""

    def __init__(self, exports: Exports) -> None:
        self._exports = exports
        self._done: dict[int, tuple[Mapping, Mapping]] = {}
        self._seen: set[tuple[Exports, str]] = set()
        self._uses = 0

    def expanded(self, vehicle: Mapping) -> Diagnosed[Mapping]:
        """The vehicle with states in the place of chains; one without any stays the same."""
        behaviors = vehicle.entries.get("behaviors")
        if behaviors is None or not isinstance(behaviors.value, Mapping):
            return vehicle
        written = behaviors.value
        if not any(chain_of(entry.value) for entry in written.entries.values()):
            return vehicle
        if id(written) not in self._done:
            self._done[id(written)] = (written, (yield from self._behaviors(written)))
        whole = behaviors._replace(value=self._done[id(written)][1])
        return Mapping({**vehicle.entries, "behaviors": whole}, vehicle.span)

    def judge(self) -> Iterator[Diagnostic]:
        """What is wrong with the file's own chains, those that nothing uses included."""
        exports, written = self._exports, self._exports.written("chains")
        for name, entry in written.items():
            chain = exports.entry("chains", name)
            own = entries_of(chain.get("parameters"))
            named = set(names_in(chain.entries["behaviors"].value))
            for parameter, declared in own.items():
                span = declared.key.span
                yield from _taken(parameter, span, exports.parameters)
                if parameter not in named:
                    yield unused_parameter(parameter, span)
            if (exports, name) not in self._seen:
                do = entry.key._replace(text=f"chain.{name}")
                landed = {"then": MappingEntry(do, do._replace(text="landed"))}
                alone = ChainExpansion(name, do, Mapping(landed, do.span), exports, is_alone=True)
                parameters = yield from self._parameters(alone, exports, name)
                yield from self._inside(alone, exports, name, parameters)

    def _behaviors(self, written: Mapping) -> Diagnosed[Mapping]:
        states: dict[str, MappingEntry] = {}
        for name, entry in written.entries.items():
            do, several = chain_of(entry.value), [(name, entry)]
            if do is not None:
                assert isinstance(entry.value, Mapping)
                use = ChainExpansion(
                    name, do, entry.value, self._exports, inherited=entry.inherited
                )
                several = yield from self._used(use)
            for inner, state in several:
                if inner in states:
                    yield from _same_name(inner, states[inner].key.span, state.key.span)
                else:
                    states[inner] = state
        return Mapping(states, written.span)

    def _used(self, use: ChainExpansion) -> Diagnosed[list[tuple[str, MappingEntry]]]:
        """The states of a use, and the entry that holds its transitions."""
        meant = yield from use.exports.chain(use.do)
        if meant is None:
            return []
        exports, name = meant
        transitions = {k: e for k, e in use.body.entries.items() if k in _TRANSITIONS}
        whole = MappingEntry(Scalar(use.state, use.do.span), Mapping(transitions, use.body.span))
        parameters = yield from self._parameters(use, exports, name)
        inside = yield from self._inside(use, exports, name, parameters)
        return [(use.state, whole), *inside] if transitions else inside

    def _parameters(
        self, use: ChainExpansion, exports: Exports, name: str
    ) -> Diagnosed[ParameterTable]:
        """The values of the chain's parameters, and of those of its file."""
        own, found = collect(_given(use, exports, name))
        yield from (f for f in found if not use.is_alone or f.code == "KYB131")
        return ParameterTable(
            {**exports.parameters.names, **own.names},
            {**exports.parameters.declared, **own.declared},
        )

    def _inside(
        self, use: ChainExpansion, exports: Exports, name: str, parameters: ParameterTable
    ) -> Diagnosed[list[tuple[str, MappingEntry]]]:
        """The states of the chain `name` of `exports`, the first on top."""
        if (yield from self._is_endless(use)):
            return []
        self._seen.add((exports, name))
        chain = exports.entry("chains", name)
        written = chain.entries["behaviors"].value
        filled = entries_of((yield from Substitution(parameters).apply(written)))
        behaviors = {inner: e for inner, e in filled.items() if isinstance(e.value, Mapping)}
        begin = yield from _begin(chain, behaviors)
        states: list[tuple[str, MappingEntry]] = []
        for inner in sorted(behaviors, key=lambda inner: inner != begin):
            key, value = behaviors[inner].key, _used_at(behaviors[inner].value, use.places)
            full = f"{use.state}.{inner}"
            assert isinstance(value, Mapping)
            transitions = yield from _transitions(value, use, behaviors)
            body = _flown_on(transitions, use.body)
            do = chain_of(body)
            if do is None:
                span = key.span._replace(used=use.places)
                states.append((full, MappingEntry(Scalar(full, span), body, use.inherited)))
            else:
                around = (*use.around, use)
                nested = ChainExpansion(
                    full, do, body, exports, around, use.inherited, use.is_alone
                )
                states += yield from self._used(nested)
        return states

    def _is_endless(self, use: ChainExpansion) -> Diagnosed[bool]:
        self._uses += 1
        first = next((u for u in use.around if _same(u, use)), None)
        if first is not None:
            names = " uses ".join(f"`{u.do.text}`" for u in (*use.around, use))
            yield Diagnostic("KYB160", f"{names[:200]}: this never ends", use.do.span)
        elif self._uses == MAX_USES:
            message = f"more than {MAX_USES} uses of chains, counted along every way"
            yield Diagnostic("KYB160", message, use.do.span)
        return first is not None or self._uses >= MAX_USES


def _given(use: ChainExpansion, exports: Exports, name: str) -> Diagnosed[ParameterTable]:
    """The chain's own parameters, with the values that its use gives them."""
    section = exports.entry("chains", name).get("parameters")
    if section is not None:
        section = yield from Substitution(exports.parameters).apply(section)
    given = {k: e for k, e in use.body.entries.items() if k not in _KEYS}
    settings = {key: Setting(known(e.value), e.key.span) for key, e in given.items()}
    return (yield from declare(section, settings, use.do))


def _begin(chain: Mapping, behaviors: dict[str, MappingEntry]) -> Diagnosed[str]:
    begin = chain.get("begin")
    if not isinstance(begin, Scalar):
        return next(iter(behaviors), "")
    if begin.text not in behaviors:
        yield _unknown(begin, behaviors)
    return begin.text


def _transitions(
    body: Mapping, use: ChainExpansion, behaviors: Collection[str]
) -> Diagnosed[Mapping]:
    """A state of the chain whose transitions go to the states of the use, or out of it.
    A `then: end` is left out: the `then` of the use holds for it."""
    entries = dict(body.entries)
    for key in ("then", "failed"):
        goal = body.get(key)
        if key == "then" and isinstance(goal, Scalar) and goal.text == END:
            del entries[key]
        elif isinstance(goal, Scalar):
            entries[key] = entries[key]._replace(value=(yield from _goal(goal, use, behaviors)))
    ways = body.get("next")
    if isinstance(ways, Sequence):
        items = yield from every(_way(item, use, behaviors) for item in ways.items)
        entries["next"] = entries["next"]._replace(value=Sequence(tuple(items), ways.span))
    return Mapping(entries, body.span)


def _way(item: Node, use: ChainExpansion, behaviors: Collection[str]) -> Diagnosed[Node]:
    go = item.get("go") if isinstance(item, Mapping) else None
    if not isinstance(item, Mapping) or not isinstance(go, Scalar):
        return item
    entry = item.entries["go"]._replace(value=(yield from _goal(go, use, behaviors)))
    return Mapping({**item.entries, "go": entry}, item.span)


def _goal(goal: Scalar, use: ChainExpansion, behaviors: Collection[str]) -> Diagnosed[Scalar]:
    if goal.text in behaviors:
        return goal._replace(text=f"{use.state}.{goal.text}")
    if goal.text == END:
        end = use.end
        if isinstance(end, Scalar):
            return goal._replace(text=end.text)
        message = f"`{use.state}` does not say what follows `end`"
        hint = "write `then: NAME` where the chain is used"
        yield Diagnostic("KYB161", message, goal.span, help=hint)
    elif goal.text not in BUILT_IN:
        yield _unknown(goal, behaviors)
    return goal


def _unknown(name: Scalar, behaviors: Collection[str]) -> Diagnostic:
    """KYB158 for a name that no behavior of the chain has."""
    message = f"the chain has no behavior `{name.text}`"
    hint = did_you_mean(name.text, [*behaviors, END])
    return Diagnostic("KYB158", message, name.span._replace(used=()), help=hint)


def _used_at(node: Node, places: tuple[Span, ...]) -> Node:
    """Copy the nodes of a chain, so that their spans say where the chain is used."""
    span = node.span._replace(used=places)
    if isinstance(node, Scalar):
        return node._replace(span=span)
    if isinstance(node, Sequence):
        return Sequence(tuple(_used_at(item, places) for item in node.items), span)
    entries = {
        key: entry._replace(
            key=entry.key._replace(span=entry.key.span._replace(used=places)),
            value=_used_at(entry.value, places),
        )
        for key, entry in node.entries.items()
    }
    return Mapping(entries, span)


def _same_name(name: str, first: Span, second: Span) -> Iterator[Diagnostic]:
    message = f"`{name}` is a behavior of the vehicle and of a chain"
    for span, other in ((first, second), (second, first)):
        yield Diagnostic("KYB159", message, span, notes=(f"the other is at {other.at}",))


def _flown_on(state: Mapping, use: Mapping) -> Mapping:
    """A state of a chain with the `estimators` of the chain's use, where it has none of its own."""
    named = use.entries.get("estimators")
    if named is None or "estimators" in state.entries:
        return state
    return Mapping({**state.entries, "estimators": named}, state.span)


def _same(a: ChainExpansion, b: ChainExpansion) -> bool:
    return a.exports is b.exports and a.do.text == b.do.text


def _taken(name: str, span: Span, file: ParameterTable) -> Iterator[Diagnostic]:
    if name in file.names:
        message = f"`{name}` is a parameter of the file and of a chain in it"
        other = file.names[name]
        yield Diagnostic("KYB159", message, span, notes=(f"the other is at {other.at}",))
        yield Diagnostic("KYB159", message, other, notes=(f"the other is at {span.at}",))
    elif name in RESERVED:
        message, hint = f"a parameter of a chain can't be called `{name}`", "it is a key there"
        yield Diagnostic("KYB159", message, span, help=hint)
