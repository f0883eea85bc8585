"""Expand chains, which are behaviors that are used as one. `pick: {do: chain.pick_up, height: 1 m,
then: home}` becomes the states `pick.over`, `pick.down`, ... of the chain, with the values of its
parameters. The first state is on top. The entry `pick` holds the transitions of the use, which
apply to all these states.

A state of the chain without `then`, or with `then: end`, leaves through the `then` of the use; a
state without `failed` leaves through the use's `failed` if it fails. `within` of the use bounds the
whole chain. Its `estimators` apply to the states that name none.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from kybflow.core.params import RESERVED, fields_of
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Collector, Span
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import END, ChainPlan
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, Sequence, entries_of
from kybflow.dsl.resolving.exports import Exports, UseMarker, chain_of
from kybflow.dsl.resolving.parameters import (
    ParameterTable,
    Setting,
    Substitution,
    declare,
    known,
    names_in,
    unused_parameter,
)

CODES = {
    "KYB158": "A transition of a chain, or its `begin`, names a state that the chain doesn't have.",
    "KYB159": "A chain's parameter, or a state inside a chain, has a name that is taken.",
    "KYB160": "Chains use each other in a cycle, or there are too many uses of chains.",
    "KYB161": "A chain has a transition to `end`, but its use doesn't say what follows.",
}
MAX_USES = 2000
OF_CHAINS = frozenset(field.key for field in fields_of(ChainPlan))
"""The keys of a chain as a whole, written where it is used."""
_KEYS = OF_CHAINS | {"do", "estimators"}


class ChainExpansion(NamedTuple):
    """One use of a chain that is being expanded. state: the name of the state that uses it. do: the
    scalar `chain.NAME`. body: the mapping of the use. exports: the file in which the chain's name
    is looked up. around: the uses that contain this one, outermost first. inherited: whether the
    use came through `like`."""

    state: str
    do: Scalar
    body: Mapping
    exports: Exports
    around: tuple[ChainExpansion, ...] = ()
    inherited: bool = False
    is_alone: bool = False
    """Whether nothing uses the chain, so that its parameters need no value."""

    @property
    def end(self) -> Node | None:
        """The state that follows the chain: the use's own `then`, or else that of the enclosing
        use."""
        own = self.body.get("then")
        return own if own is not None or not self.around else self.around[-1].end

    @property
    def places(self) -> tuple[Span, ...]:
        return tuple(use.do.span for use in (*self.around, self))


class Chains:
    """Expands the chains in the vehicles of one mission. What several vehicles share is expanded
    once."""

    def __init__(self, exports: Exports, found: Collector) -> None:
        self._exports = exports
        self._found = found
        self._done: dict[int, tuple[Mapping, Mapping]] = {}
        self._seen: set[tuple[Exports, str]] = set()
        self._uses = 0

    def expanded(self, vehicle: Mapping) -> Mapping:
        """Return the vehicle with the states of each chain in place of its use. A vehicle without
        chains is returned unchanged."""
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
        """Check the file's own chains, including those that nothing uses."""
        exports, found = self._exports, self._found
        for name, entry in exports.written("chains").items():
            chain = exports.entry("chains", name)
            named = set(names_in(chain.entries["behaviors"].value))
            for parameter, declared in entries_of(chain.get("parameters")).items():
                span, other = declared.key.span, exports.parameters.names.get(parameter)
                if other is not None:
                    whose = f"both for the file and for the chain `{name}`"
                    message = f"the parameter `{parameter}` is declared {whose}"
                    notes = (f"the file's is at {other.at}",)
                    found.report("KYB159", message, span, notes=notes, help="rename one of them")
                elif parameter in RESERVED:
                    message = f"a parameter of a chain can't be called `{parameter}`"
                    hint = (
                        f"the key `{parameter}` has a meaning where a chain is used: rename the "
                        "parameter"
                    )
                    found.report("KYB159", message, span, help=hint)
                elif parameter not in named:
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
                    own, other = states[inner].key.span, state.key.span
                    if own.used:
                        own, other = other, own
                    message = f"`{inner}` is declared twice: by a chain and by the vehicle"
                    notes = (f"the chain's is at {other.at}",)
                    hint = "rename the vehicle's behavior"
                    self._found.report("KYB159", message, own, notes=notes, help=hint)
                else:
                    states[inner] = state
        return Mapping(states, written.span)

    def _used(self, use: ChainExpansion) -> list[tuple[str, MappingEntry]]:
        """Return the states of a use, after the entry that holds its transitions."""
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
        """Return the states of the chain `name` of `exports`, the first state on top."""
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
        """Return the parameters visible in the chain: its own, with the values given where it is
        used, and those declared in its file."""
        own = Collector()
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
                message = f"{names[:200]}, in a cycle"
                hint = "remove one of these uses"
                self._found.report("KYB160", message, use.do.span, help=hint)
                return True
        if self._uses == MAX_USES:
            message = f"chains are used more than {MAX_USES} times, counting uses inside chains"
            hint = "let fewer chains use others"
            self._found.report("KYB160", message, use.do.span, help=hint)
        return self._uses >= MAX_USES

    def _state(self, body: Mapping, use: ChainExpansion, behaviors: Collection[str]) -> Mapping:
        """Return a state of the chain with transitions that lead to the states of this use, or out
        of it, and with the estimators of the use if it names none. `then: end` is removed, because
        the `then` of the use applies."""
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
        """Report a name that no behavior of the chain has (KYB158)."""
        message = f"the chain has no behavior `{name.text}`"
        hint = did_you_mean(name.text, [*behaviors, END])
        self._found.report("KYB158", message, name.span._replace(used=()), help=hint)
