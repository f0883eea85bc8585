"""`groups:` and `flows:` of the tree to the document; which vehicles a flow drives, and which
states flows and callbacks may ask for."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import replace

from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, every
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.document import Document, FlowEntry, PhaseEntry, TransitionEntry, VehicleEntry
from kybflow.dsl.names.option_names import members
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, entries_of, items_of
from kybflow.dsl.reading.values import decode
from kybflow.dsl.schema.flows import ARRIVE
from kybflow.dsl.shaping.callbacks import named_values
from kybflow.dsl.shaping.entry_values import goal_of
from kybflow.dsl.shaping.states import duration, next_transition
from kybflow.parts import GROUND

CODES = {
    "KYB462": "A way out of every phase of a flow that counts time.",
    "KYB192": "A phase with `within` and no `otherwise`, or the reverse.",
}
GROUNDED = "landed"
"""The state that a vehicle waits in for its flow."""


def groups_of(node: Node | None) -> dict[str, tuple[Text, ...]]:
    """The members of each group as written."""
    return {
        name: tuple(item.as_text for item in items_of(entry.value) if isinstance(item, Scalar))
        for name, entry in entries_of(node).items()
    }


def flows_of(node: Node | None) -> Diagnosed[dict[str, FlowEntry]]:
    """The flows as written."""
    flows = {}
    for name, entry in entries_of(node).items():
        body = entry.value
        if not isinstance(body, Mapping):
            continue  # null: not written
        written = body.entries.get("phases")
        shared = yield from _shared(body.get("next"), name)
        several = yield from every(_phase(e, shared) for e in _own(written).values())
        phases = {phase.name.text: phase for phase in several}
        if not phases:
            message = f"the flow `{name}` needs `phases`"
            hint = "write `phases: {...}`, or start from a flow that has some"
            yield Diagnostic("KYB102", message, entry.key.span, help=hint)
            continue
        begin = body.get("begin")
        first = next(iter(phases.values())).name
        text = begin.as_text if isinstance(begin, Scalar) else first
        flows[name] = FlowEntry(entry.key.as_text, text, phases, entry.key.span, shared)
    return flows


def _own(phases: MappingEntry | None) -> dict[str, MappingEntry]:
    """The phases, each of which says whether it came through `like`."""
    if phases is None:
        return {}
    entries = entries_of(phases.value)
    if not phases.inherited:
        return entries
    return {name: entry._replace(inherited=True) for name, entry in entries.items()}


def _shared(node: Node | None, flow: str) -> Diagnosed[tuple[TransitionEntry, ...]]:
    """The ways out of every phase of a flow."""
    items = [item for item in items_of(node) if isinstance(item, Mapping)]
    for item in items:
        if item.get("after") is not None:
            message, hint = (
                "a flow's `next` has no `after`",
                "write it in each phase that it bounds",
            )
            yield Diagnostic("KYB462", message, item.entries["after"].key.span, help=hint)
    ways = yield from every(next_transition(item) for item in items)
    return tuple(way._replace(since=flow) for way in ways)


def _phase(entry: MappingEntry, shared: tuple[TransitionEntry, ...]) -> Diagnosed[PhaseEntry]:
    body = entry.value if isinstance(entry.value, Mapping) else Mapping({}, entry.key.span)
    options = body.entries.get("set")
    items = (item for item in items_of(body.get("next")) if isinstance(item, Mapping))
    actions = [] if options is None else (yield from named_values(options))
    transitions = yield from every(next_transition(item) for item in items)
    limit = yield from _limit(body)
    asked = {}
    for request in entries_of(body.get("run")).values():
        asked[request.key.as_text] = yield from goal_of(request)
    run = {who: goal for who, goal in asked.items() if goal is not None}
    arrive = yield from _arrival(body.get("arrive"))
    return PhaseEntry(
        name=entry.key.as_text,
        run=tuple((who, state) for who, (state, _) in run.items()),
        give=tuple(_pairs(body.get("give"))),
        set=tuple(actions),
        transitions=(
            *(way for way in shared if way.target.text != entry.key.text),
            *transitions,
            *limit,
        ),
        span=entry.key.span,
        inherited=entry.inherited,
        values={who.text: values for who, (_, values) in run.items() if values is not None},
        arrive=arrive,
    )


def _arrival(node: Node | None) -> Diagnosed[Text | None]:
    if not isinstance(node, Scalar) or node.is_null:
        return None
    value: str | None = yield from decode(node, ARRIVE)
    return None if value is None else node.as_text


def _limit(body: Mapping) -> Diagnosed[tuple[TransitionEntry, ...]]:
    """The transition of `within` and `otherwise`; none where one of them is missing."""
    limit, goal = body.get("within"), body.get("otherwise")
    if limit is not None and isinstance(goal, Scalar):
        after = yield from duration(body, "within", above=0.0)
        return (TransitionEntry("within", goal.as_text, limit.span, after=after),)
    if limit is not None:
        message, span = "nothing says where the phase goes after `within`", limit.span
        yield Diagnostic("KYB192", message, span, help="add `otherwise: PHASE`")
    elif goal is not None:
        message, span = "nothing says when the phase goes to `otherwise`", goal.span
        yield Diagnostic("KYB192", message, span, help="add `within: 20 s`")
    return ()


def _pairs(node: Node | None) -> Iterator[tuple[Text, Text]]:
    for entry in entries_of(node).values():
        if isinstance(entry.value, Scalar) and not entry.value.is_null:
            yield entry.key.as_text, entry.value.as_text


def with_waiting(document: Document) -> Document:
    """The document, whose vehicles wait on the ground for the flow that drives them, unless they
    say how they `begin`, or their topmost behavior stays on the ground."""
    if not document.flows:
        return document
    driven = {name for flow in document.flows.values() for name in named_vehicles(document, flow)}
    vehicles = {
        name: _waiting(vehicle) if name in driven and "begin" not in vehicle.spans else vehicle
        for name, vehicle in document.vehicles.items()
    }
    return replace(document, vehicles=vehicles)


def _waiting(vehicle: VehicleEntry) -> VehicleEntry:
    first = vehicle.states.get(vehicle.begin.text)
    legs = first.part.spec.cls.flight if first is not None else ()
    if legs and all(leg.start is leg.end is GROUND for leg in legs):
        return vehicle
    return replace(vehicle, begin=Text(GROUNDED, vehicle.span, verbatim=False))


def named_vehicles(document: Document, flow: FlowEntry) -> tuple[str, ...]:
    """The vehicles that a flow asks something of, or gives away."""
    names = [who.text for phase in flow.phases.values() for who, _ in (*phase.run, *phase.give)]
    return tuple(dict.fromkeys(v for name in names for v in members(document, name)))


def given_vehicles(document: Document, flow: FlowEntry) -> frozenset[str]:
    """The vehicles that other flows give to this one."""
    return frozenset(
        vehicle
        for other in document.flows.values()
        for phase in other.phases.values()
        for who, goal in phase.give
        if goal.text == flow.name.text
        for vehicle in members(document, who.text)
    )


def own_vehicles(document: Document, flow: FlowEntry) -> tuple[str, ...]:
    """The vehicles that a flow drives from the start: those it names and that nobody gives it."""
    given = given_vehicles(document, flow)
    return tuple(name for name in named_vehicles(document, flow) if name not in given)


def with_requests(document: Document) -> Document:
    """The document, whose vehicles know which of their states callbacks and flows may request."""
    asked = set(_requests(document))
    if not asked:
        return document
    first = set(_first_requests(document))
    vehicles = {
        name: dataclasses.replace(
            vehicle,
            requested=frozenset(state for who, state in asked if who == name),
            requested_first=frozenset(state for who, state in first if who == name),
        )
        for name, vehicle in document.vehicles.items()
    }
    return dataclasses.replace(document, vehicles=vehicles)


def _requests(document: Document) -> Iterator[tuple[str, str]]:
    """(vehicle, state) of each request; unknown names are left out."""
    requests = [
        (action.target.text, action.value.text)
        for callback in document.callbacks
        for action in callback.actions
        if action.name.text == "switch" and action.target is not None
    ]
    requests += [
        (who.text, state.text)
        for flow in document.flows.values()
        for phase in flow.phases.values()
        for who, state in phase.run
    ]
    for who, state in requests:
        yield from _goals(document, who, state)


def _goals(document: Document, who: str, state: str) -> Iterator[tuple[str, str]]:
    for vehicle in members(document, who):
        goal = document.vehicles[vehicle].goal(state)
        if goal in document.vehicles[vehicle].states:
            yield vehicle, goal


def _first_requests(document: Document) -> Iterator[tuple[str, str]]:
    """(vehicle, state) of the first requests that a flow makes to a vehicle which waits for it."""
    for flow in document.flows.values():
        for vehicle in own_vehicles(document, flow):
            if document.vehicles[vehicle].begin.text == GROUNDED:
                yield from _first_of(document, flow, vehicle)


def _first_of(document: Document, flow: FlowEntry, vehicle: str) -> Iterator[tuple[str, str]]:
    """Follow the transitions from the first phase until a phase requests something of the vehicle
    or gives it away."""
    waiting, seen = [flow.begin.text], {flow.begin.text}
    while waiting:
        phase = flow.phases.get(waiting.pop())
        if phase is None:
            continue
        requests = [w for who, state in phase.run for w in _goals(document, who.text, state.text)]
        yield from (request for request in requests if request[0] == vehicle)
        asked = (*phase.run, *phase.give)
        if any(vehicle in members(document, who.text) for who, _ in asked):
            continue
        fresh = {transition.target.text for transition in phase.transitions} - seen
        seen |= fresh
        waiting += fresh
