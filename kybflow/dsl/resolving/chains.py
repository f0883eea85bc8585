"""Chains: behaviors that are used as one. `pick: {do: chain.pick_up, height: 1 m, then: home}`
becomes the states `pick.over`, `pick.down`, ... of the chain with its parameters in place, the
first one on top, and, as `pick`, the arrows of the use, which hold for all of them.

A state inside that has no `then`, or `then: end`, leaves by the `then` of the use, and one that
fails without `failed` by its `failed`; `within` of the use bounds the whole chain; its `estimators`
hold for the states that name none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from kybflow.core.params import RESERVED
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.reading.nodes import Entry, Mapping, Node, Scalar, entries_of
from kybflow.dsl.reading.source import Span
from kybflow.dsl.resolving.chain_arrows import Arrows, unknown
from kybflow.dsl.resolving.chain_nodes import chain_of, used_at
from kybflow.dsl.resolving.parameters import Parameters, Setting, declare
from kybflow.dsl.resolving.substitution import Substitution, known, names_in

if TYPE_CHECKING:
    from kybflow.dsl.resolving.offers import Offers

CODES = {
    "KYB159": "A name that is taken: of a chain's parameter, or of a state inside of a chain.",
    "KYB160": "Chains that use each other in a circle, or more uses than a mission may have.",
}
MAX_USES = 2000
_ARROWS = frozenset({"then", "next", "failed", "within"})
_KEYS = _ARROWS | {"do", "estimators"}


class Use(NamedTuple):
    """One use of a chain: the name of the state, the `do` that names the chain, its arrows, the
    file in which its name means something, and the uses around it, outermost first."""

    state: str
    do: Scalar
    body: Mapping
    offers: Offers
    around: tuple[Use, ...] = ()
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

    def __init__(self, offers: Offers, found: list[Diagnostic]) -> None:
        self._offers, self._found = offers, found
        self._done: dict[int, tuple[Mapping, Mapping]] = {}
        self._seen: set[tuple[Offers, str]] = set()
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
        """Find what is wrong with the file's own chains, those that nothing uses included."""
        offers, written = self._offers, self._offers.written("chains")
        for name, entry in written.items():
            chain = offers.entry("chains", name)
            own = entries_of(chain.get("parameters"))
            named = set(names_in(chain.entries["behaviors"].value))
            for parameter, declared in own.items():
                span = declared.key.span
                self._found += _taken(parameter, span, offers.parameters)
                self._found += () if parameter in named else (_unused(parameter, span),)
            if (offers, name) not in self._seen:
                do = entry.key._replace(text=f"chain.{name}")
                landed = {"then": Entry(do, do._replace(text="landed"))}
                alone = Use(name, do, Mapping(landed, do.span), offers, is_alone=True)
                list(self._inside(alone, offers, name, self._parameters(alone, offers, name)))

    def _behaviors(self, written: Mapping) -> Mapping:
        states: dict[str, Entry] = {}
        for name, entry in written.entries.items():
            do = chain_of(entry.value)
            if do is None:
                self._enter(states, name, entry)
                continue
            assert isinstance(entry.value, Mapping)
            use = Use(name, do, entry.value, self._offers, inherited=entry.inherited)
            for inner, state in self._used(use):
                self._enter(states, inner, state)
        return Mapping(states, written.span)

    def _enter(self, states: dict[str, Entry], name: str, entry: Entry) -> None:
        if name not in states:
            states[name] = entry
            return
        message = f"`{name}` is a behavior of the vehicle and of a chain"
        for here, there in ((states[name], entry), (entry, states[name])):
            span, other = here.key.span, there.key.span
            notes = (f"the other is at {other.at}",)
            self._found.append(Diagnostic("KYB159", message, span, notes=notes))

    def _used(self, use: Use) -> Iterator[tuple[str, Entry]]:
        """The states of a use, and the entry that holds its arrows."""
        meant = use.offers.chain(use.do)
        if meant is None:
            return
        offers, name = meant
        arrows = {k: e for k, e in use.body.entries.items() if k in _ARROWS}
        if arrows:
            yield use.state, Entry(_named(use.do, use.state), Mapping(arrows, use.body.span))
        yield from self._inside(use, offers, name, self._parameters(use, offers, name))

    def _parameters(self, use: Use, offers: Offers, name: str) -> Parameters:
        """The values of the chain's parameters, and of those of its file."""
        found: list[Diagnostic] = []
        section = offers.entry("chains", name).get("parameters")
        if section is not None:
            section = Substitution(offers.parameters, found).apply(section)
        given = {k: e for k, e in use.body.entries.items() if k not in _KEYS}
        settings = {key: Setting(known(e.value), e.key.span) for key, e in given.items()}
        own = declare(section, settings, found, use.do)
        self._found += [f for f in found if not use.is_alone or f.code == "KYB131"]
        return Parameters(
            {**offers.parameters.names, **own.names},
            {**offers.parameters.declared, **own.declared},
        )

    def _inside(
        self, use: Use, offers: Offers, name: str, parameters: Parameters
    ) -> Iterator[tuple[str, Entry]]:
        """The states of the chain `name` of `offers`, the first on top."""
        if self._is_endless(use):
            return
        self._seen.add((offers, name))
        chain = offers.entry("chains", name)
        written = chain.entries["behaviors"].value
        filled = entries_of(Substitution(parameters, self._found).apply(written))
        behaviors = {inner: e for inner, e in filled.items() if isinstance(e.value, Mapping)}
        begin = self._begin(chain, behaviors)
        arrows = Arrows(use.state, use.end, behaviors, self._found)
        for inner in sorted(behaviors, key=lambda inner: inner != begin):
            key, value = behaviors[inner].key, used_at(behaviors[inner].value, use.places)
            full = f"{use.state}.{inner}"
            assert isinstance(value, Mapping)
            body = _flown_on(arrows.of(value), use.body)
            do = chain_of(body)
            if do is None:
                span = replace(key.span, used=use.places)
                yield full, Entry(Scalar(full, span), body, use.inherited)
            else:
                around = (*use.around, use)
                nested = Use(full, do, body, offers, around, use.inherited, use.is_alone)
                yield from self._used(nested)

    def _is_endless(self, use: Use) -> bool:
        self._uses += 1
        first = next((u for u in use.around if _same(u, use)), None)
        if first is not None:
            names = " uses ".join(f"`{u.do.text}`" for u in (*use.around, use))
            message = f"{names[:200]}: this never ends"
            self._found.append(Diagnostic("KYB160", message, use.do.span))
        elif self._uses == MAX_USES:
            message = f"more than {MAX_USES} uses of chains, counted along every way"
            self._found.append(Diagnostic("KYB160", message, use.do.span))
        return first is not None or self._uses >= MAX_USES

    def _begin(self, chain: Mapping, behaviors: dict[str, Entry]) -> str:
        begin = chain.get("begin")
        first = next(iter(behaviors), "")
        if not isinstance(begin, Scalar):
            return first
        if begin.text not in behaviors:
            self._found.append(unknown(begin, behaviors))
        return begin.text


def _flown_on(state: Mapping, use: Mapping) -> Mapping:
    """A state of a chain with the `estimators` of the chain's use, where it has none of its own."""
    named = use.entries.get("estimators")
    if named is None or "estimators" in state.entries:
        return state
    return Mapping({**state.entries, "estimators": named}, state.span)


def _same(a: Use, b: Use) -> bool:
    return a.offers is b.offers and a.do.text == b.do.text


def _named(do: Scalar, name: str) -> Scalar:
    return Scalar(name, do.span)


def _taken(name: str, span: Span, file: Parameters) -> Iterator[Diagnostic]:
    if name in file.names:
        message = f"`{name}` is a parameter of the file and of a chain in it"
        other = file.names[name]
        yield Diagnostic("KYB159", message, span, notes=(f"the other is at {other.at}",))
        yield Diagnostic("KYB159", message, other, notes=(f"the other is at {span.at}",))
    elif name in RESERVED:
        message, hint = f"a parameter of a chain can't be called `{name}`", "it is a key there"
        yield Diagnostic("KYB159", message, span, help=hint)


def _unused(name: str, span: Span) -> Diagnostic:
    message, hint = f"nothing uses the parameter `{name}`", f"use it as `${name}`, or remove it"
    return Diagnostic("KYB133", message, span, help=hint, severity=Severity.WARNING)
