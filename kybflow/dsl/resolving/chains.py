"""Chains: behaviors that are used as one. `pick: {do: chain.pick_up, height: 1 m, then: home}`
becomes the states `pick.over`, `pick.down`, ... of the chain with its parameters in place, the
first one on top, and, as `pick`, the transitions of the use, which hold for all of them.

A state inside that has no `then`, or `then: end`, leaves by the `then` of the use, and one that
fails without `failed` by its `failed`; `within` of the use bounds the whole chain; its `estimators`
hold for the states that name none.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from kybflow.core.params import RESERVED, fields_of
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.plan import END, ChainPlan
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, Sequence, entries_of
from kybflow.dsl.resolving.exports import Exports, UseMarker, chain_of
from kybflow.dsl.resolving.parameters import ParameterTable, Setting, declare
from kybflow.dsl.resolving.substitution import Substitution, known, names_in, unused_parameter

CODES = {
    "KYB158": "A chain whose transition, or `begin`, names a state that it does not have.",
    "KYB159": "A name that is taken: of a chain's parameter, or of a state inside of a chain.",
    "KYB160": "Chains that use each other in a cycle, or more uses than a mission may have.",
    "KYB161": "A transition to `end` in a chain whose use does not say what follows.",
}
MAX_USES = 2000
OF_CHAINS = frozenset(field.key for field in fields_of(ChainPlan))
"""The keys of a chain as a whole, where it is used."""
_KEYS = OF_CHAINS | {"do", "estimators"}


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

    def __init__(self, exports: Exports, found: Findings) -> None:
        self._exports = exports
        self._found = found
        self._done: dict[int, tuple[Mapping, Mapping]] = {}
        self._seen: set[tuple[Exports, str]] = set()
        self._uses = 0

    def expanded(self, vehicle: Mapping) -> Mapping:
        """The vehicle with states in the place of chains; one without any stays the same."""
        behaviors = vehicle.entries.get("behaviors")
        if behaviors is None or not isinstance(behaviors.value, Mapping):
            return vehicle
        written = behaviors.value
        if not any(chain_of(entry.value) for entry in written.entries.values()):
            return vehicle
        if id(written) not in self._done:
            self._done[id(written)] = (written, self._behaviors(written))
        whole = behaviors._replace(value=self._done[id(written)][1])
        return Mapping({**vehicle.entries, "behaviors": whole}, vehicle.span)

    def judge(self) -> None:
        """Judge the file's own chains, those that nothing uses included."""
        exports, found = self._exports, self._found
        for name, entry in exports.written("chains").items():
            chain = exports.entry("chains", name)
            named = set(names_in(chain.entries["behaviors"].value))
            for parameter, declared in entries_of(chain.get("parameters")).items():
                span, other = declared.key.span, exports.parameters.names.get(parameter)
                if other is not None:
                    message = f"`{parameter}` is a parameter of the file and of a chain in it"
                    _report_both(message, span, other, found)
                elif parameter in RESERVED:
                    message = f"a parameter of a chain can't be called `{parameter}`"
                    found.report("KYB159", message, span, help="it is a key there")
                if parameter not in named:
                    unused_parameter(parameter, span, found)
            if (exports, name) not in self._seen:
                do = entry.key._replace(text=f"chain.{name}")
                landed = {"then": MappingEntry(do, do._replace(text="landed"))}
                alone = ChainExpansion(name, do, Mapping(landed, do.span), exports, is_alone=True)
                self._inside(alone, exports, name)

    def _behaviors(self, written: Mapping) -> Mapping:
        states: dict[str, MappingEntry] = {}
        for name, entry in written.entries.items():
            do, several = chain_of(entry.value), [(name, entry)]
            if do is not None:
                assert isinstance(entry.value, Mapping)
                use = ChainExpansion(
                    name, do, entry.value, self._exports, inherited=entry.inherited
                )
                several = self._used(use)
            for inner, state in several:
                if inner in states:
                    message = f"`{inner}` is a behavior of the vehicle and of a chain"
                    _report_both(message, states[inner].key.span, state.key.span, self._found)
                else:
                    states[inner] = state
        return Mapping(states, written.span)

    def _used(self, use: ChainExpansion) -> list[tuple[str, MappingEntry]]:
        """The states of a use, and the entry that holds its transitions."""
        meant = use.exports.chain(use.do)
        if meant is None:
            return []
        transitions = {k: e for k, e in use.body.entries.items() if k in OF_CHAINS}
        whole = MappingEntry(Scalar(use.state, use.do.span), Mapping(transitions, use.body.span))
        inside = self._inside(use, *meant)
        return [(use.state, whole), *inside] if transitions else inside

    def _inside(
        self, use: ChainExpansion, exports: Exports, name: str
    ) -> list[tuple[str, MappingEntry]]:
        """The states of the chain `name` of `exports`, the first on top."""
        chain = exports.entry("chains", name)
        parameters = self._parameters(use, exports, chain)
        if self._is_endless(use):
            return []
        self._seen.add((exports, name))
        written = chain.entries["behaviors"].value
        filled = entries_of(Substitution(parameters, self._found).apply(written))
        behaviors = {inner: e for inner, e in filled.items() if isinstance(e.value, Mapping)}
        begin = chain.get("begin")
        first = begin.text if isinstance(begin, Scalar) else next(iter(behaviors), "")
        if isinstance(begin, Scalar) and first not in behaviors:
            self._report_unknown(begin, behaviors)
        states, used = list[tuple[str, MappingEntry]](), UseMarker()
        for inner in sorted(behaviors, key=lambda inner: inner != first):
            value = used.marked(behaviors[inner].value, use.places)
            assert isinstance(value, Mapping)
            full = f"{use.state}.{inner}"
            body = self._state(value, use, behaviors)
            do = chain_of(body)
            if do is None:
                span = behaviors[inner].key.span._replace(used=use.places)
                states.append((full, MappingEntry(Scalar(full, span), body, use.inherited)))
            else:
                around = (*use.around, use)
                nested = ChainExpansion(
                    full, do, body, exports, around, use.inherited, use.is_alone
                )
                states += self._used(nested)
        return states

    def _parameters(self, use: ChainExpansion, exports: Exports, chain: Mapping) -> ParameterTable:
        """The chain's own parameters, with the values that its use gives them, and those of its
        file."""
        own = Findings()
        section = chain.get("parameters")
        if section is not None:
            section = Substitution(exports.parameters, own).apply(section)
        given = {k: e for k, e in use.body.entries.items() if k not in _KEYS}
        settings = {key: Setting(known(e.value), e.key.span) for key, e in given.items()}
        table = declare(section, settings, own, use.do)
        self._found.add(f for f in own.all if not use.is_alone or f.code == "KYB131")
        return ParameterTable(
            {**exports.parameters.names, **table.names},
            {**exports.parameters.declared, **table.declared},
        )

    def _is_endless(self, use: ChainExpansion) -> bool:
        self._uses += 1
        for other in use.around:
            if other.exports is use.exports and other.do.text == use.do.text:
                names = " uses ".join(f"`{u.do.text}`" for u in (*use.around, use))
                message = f"{names[:200]}: this never ends"
                self._found.report("KYB160", message, use.do.span)
                return True
        if self._uses == MAX_USES:
            message = f"more than {MAX_USES} uses of chains, counted along every way"
            self._found.report("KYB160", message, use.do.span)
        return self._uses >= MAX_USES

    def _state(self, body: Mapping, use: ChainExpansion, behaviors: Collection[str]) -> Mapping:
        """A state of the chain whose transitions go to the states of the use, or out of it, with
        the estimators of the use where it names none. A `then: end` is left out: the `then` of the
        use holds for it."""
        entries = dict(body.entries)
        for key in ("then", "failed"):
            goal = body.get(key)
            if key == "then" and isinstance(goal, Scalar) and goal.text == END:
                del entries[key]
            elif isinstance(goal, Scalar):
                entries[key] = entries[key]._replace(value=self._goal(goal, use, behaviors))
        ways = body.get("next")
        if isinstance(ways, Sequence):
            items: list[Node] = []
            for item in ways.items:
                way, go = item, item.get("go") if isinstance(item, Mapping) else None
                if isinstance(item, Mapping) and isinstance(go, Scalar):
                    entry = item.entries["go"]._replace(value=self._goal(go, use, behaviors))
                    way = Mapping({**item.entries, "go": entry}, item.span)
                items.append(way)
            entries["next"] = entries["next"]._replace(value=Sequence(tuple(items), ways.span))
        estimators = use.body.entries.get("estimators")
        if estimators is not None:
            entries.setdefault("estimators", estimators)
        return Mapping(entries, body.span)

    def _goal(self, goal: Scalar, use: ChainExpansion, behaviors: Collection[str]) -> Scalar:
        if goal.text in behaviors:
            return goal._replace(text=f"{use.state}.{goal.text}")
        if goal.text == END:
            end = use.end
            if isinstance(end, Scalar):
                return goal._replace(text=end.text)
            message = f"`{use.state}` does not say what follows `end`"
            hint = "write `then: NAME` where the chain is used"
            self._found.report("KYB161", message, goal.span, help=hint)
        elif goal.text not in BUILT_IN:
            self._report_unknown(goal, behaviors)
        return goal

    def _report_unknown(self, name: Scalar, behaviors: Collection[str]) -> None:
        """Report a name that no behavior of the chain has."""
        message = f"the chain has no behavior `{name.text}`"
        hint = did_you_mean(name.text, [*behaviors, END])
        self._found.report("KYB158", message, name.span._replace(used=()), help=hint)


def _report_both(message: str, first: Span, second: Span, found: Findings) -> None:
    """Report a name that stands at two places, at both."""
    for span, other in ((first, second), (second, first)):
        found.report("KYB159", message, span, notes=(f"the other is at {other.at}",))
