"""Decode flows: the transitions that every phase has, the vehicles that a flow drives, and the
states that flows and callbacks may request, with values of their own.

`run: {a: {goto: {position: [1, 0, 1]}}}` in a phase and `switch: {a: {goto: {...}}}` in a callback
replace only parameters of a state; the state keeps its transitions.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from kybflow.core.params import Field
from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Collector
from kybflow.dsl.expanding.vehicles import next_transition
from kybflow.dsl.language.decode import Decoder
from kybflow.dsl.language.records import Source
from kybflow.dsl.plan import (
    FlowPlan,
    PartPlan,
    PhasePlan,
    Plan,
    Request,
    StatePlan,
    TransitionPlan,
    Values,
    VehiclePlan,
    Ways,
)
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Node, Scalar, entries_of, is_null
from kybflow.dsl.reading.values import decode_value
from kybflow.parts import GROUND

CODES = {
    "KYB462": "A transition of a whole flow counts time, which only phases can.",
    "KYB192": "A phase has `within` but no `otherwise`, or the reverse.",
}
GROUNDED = "landed"
"""The state in which a vehicle waits for its flow."""
_FILES = frozenset({"file", "file path"})


def flows_of(node: Node | None, decoder: Decoder) -> tuple[FlowPlan, ...]:
    """Return the flows as written. Each phase also has the transitions that its flow declares for
    all phases."""
    flows = []
    for name, entry in entries_of(node).items():
        body = entry.value
        if not isinstance(body, Mapping):
            continue  # null means not written
        phases = entries_of(body.get("phases")).items()
        written = [name for name, phase in phases if isinstance(phase.value, Mapping)]
        if not written:
            message = f"the flow `{name}` needs `phases`"
            hint = "write `phases: {...}`, or name a flow in `like` that has some"
            decoder.found.report("KYB102", message, entry.key.span, help=hint)
            continue
        first: dict[str, Any] = {} if body.get("begin") is not None else {"begin": written[0]}
        flow = decoder.record(FlowPlan, body, entry.key.span, name=name, vehicles=(), **first)
        if flow is not None:
            flows.append(_with_ways(flow, decoder.found))
    return tuple(flows)


def _with_ways(flow: FlowPlan, found: Collector) -> FlowPlan:
    """Return the flow with the transitions of its phases."""
    shared = []
    for way in flow.next:
        if way.after is not None:
            hint = "write it in each phase that it bounds"
            message = "a flow's `next` has no `after`"
            found.report("KYB462", message, way.key_span("after"), help=hint)
        shared.append(next_transition(way, found).but(since=flow.name))
    phases = {}
    for name, phase in flow.phases.items():
        own = tuple(next_transition(way, found) for way in phase.next)
        of_all = (way for way in shared if way.target != name)
        phases[name] = phase.but(transitions=(*of_all, *own, *_limit(phase, found)))
    return flow.but(phases=phases)


def _limit(phase: PhasePlan, found: Collector) -> Ways:
    """Return the transition of `within` and `otherwise`; empty if either is missing."""
    limit, goal = phase.entry("within"), phase.entry("otherwise")
    if limit is not None and goal is not None:
        if phase.otherwise is None:
            return ()  # already reported: not a name
        span = limit.value.span
        source = Source(span, Mapping({"go": goal}, span))
        target, after = phase.otherwise, phase.within
        return (
            TransitionPlan(target=target, cause="within", after=after, at=span.at, source=source),
        )
    if limit is not None:
        message = "`within` needs `otherwise`"
        found.report("KYB192", message, limit.value.span, help="add `otherwise: PHASE`")
    elif goal is not None:
        message = "`otherwise` needs `within`"
        found.report("KYB192", message, goal.value.span, help="add `within: 20 s`")
    return ()


def with_waiting(plan: Plan) -> Plan:
    """Return the plan in which each vehicle that a flow drives waits on the ground first, unless it
    has `begin` or its first behavior stays on the ground."""
    driven = {name for flow in plan.flows for name in named_vehicles(plan, flow)}
    vehicles = list[VehiclePlan]()
    for vehicle in plan.vehicles:
        first = vehicle.states.get(vehicle.begin)
        stays = first is not None and all(leg.start is leg.end is GROUND for leg in first.legs)
        waits = vehicle.name in driven and not vehicle.is_written("begin") and not stays
        vehicles.append(vehicle.but(begin=GROUNDED) if waits else vehicle)
    return plan.but(vehicles=tuple(vehicles)) if driven else plan


def named_vehicles(plan: Plan, flow: FlowPlan) -> tuple[str, ...]:
    """Return the vehicles that a flow names: in its requests, or when it gives them to other
    flows."""
    names = [who for phase in flow.phases.values() for who in (*phase.run, *phase.give)]
    return tuple(dict.fromkeys(v for name in names for v in plan.members(name)))


def given_vehicles(plan: Plan, flow: FlowPlan) -> frozenset[str]:
    """Return the vehicles that other flows give to this flow."""
    return frozenset(
        vehicle
        for _, phase in plan.giving
        for who, goal in phase.give.items()
        if goal == flow.name
        for vehicle in plan.members(who)
    )


def own_vehicles(plan: Plan, flow: FlowPlan) -> tuple[str, ...]:
    """Return the vehicles that a flow drives from the start: those that it names and no other flow
    gives to it."""
    given = given_vehicles(plan, flow)
    return tuple(name for name in named_vehicles(plan, flow) if name not in given)


def with_requests(plan: Plan) -> Plan:
    """Return the plan with the states of each vehicle that callbacks and flows may request."""
    asked: set[tuple[str, str]] = set()
    for action in (action for callback in plan.callbacks for action in callback.do):
        if action.name == "switch" and action.target is not None:
            asked |= set(_goals(plan, action.target, action.value.state))
    for phase in (phase for flow in plan.flows for phase in flow.phases.values()):
        asked.update(goal for who, r in phase.run.items() for goal in _goals(plan, who, r.state))
    if not asked:
        return plan
    first = {
        request
        for flow in plan.flows
        for name in own_vehicles(plan, flow)
        if plan.fleet[name].begin == GROUNDED
        for request in _first_of(plan, flow, name)
    }
    vehicles = tuple(
        vehicle.but(
            requested=frozenset(state for who, state in asked if who == vehicle.name),
            requested_first=frozenset(state for who, state in first if who == vehicle.name),
        )
        for vehicle in plan.vehicles
    )
    return plan.but(vehicles=vehicles)


def _goals(plan: Plan, who: str, state: str) -> Iterator[tuple[str, str]]:
    for name in plan.members(who):
        goal = plan.fleet[name].goal(state)
        if goal in plan.fleet[name].states:
            yield name, goal


def _first_of(plan: Plan, flow: FlowPlan, vehicle: str) -> Iterator[tuple[str, str]]:
    """Yield the vehicle and the state of each request that may be the first to a vehicle that waits
    for the flow. The search follows the transitions from the first phase until a phase requests
    something of the vehicle or gives it away."""
    waiting, seen = [flow.begin], {flow.begin}
    while waiting:
        phase = flow.phases.get(waiting.pop())
        if phase is None:
            continue
        for who, request in phase.run.items():
            yield from (goal for goal in _goals(plan, who, request.state) if goal[0] == vehicle)
        if any(vehicle in plan.members(who) for who in (*phase.run, *phase.give)):
            continue
        fresh = {way.target for way in phase.transitions} - seen
        seen |= fresh
        waiting += fresh


class ValuedRequest(NamedTuple):
    """A request with values, in a phase or a callback. who: a vehicle or a group."""

    who: str
    request: Request


def valued_requests(plan: Plan) -> Iterator[ValuedRequest]:
    """Yield every request of the mission that has values."""
    for flow in plan.flows:
        for phase in flow.phases.values():
            yield from (ValuedRequest(who, r) for who, r in phase.run.items() if written(r))
    for callback in plan.callbacks:
        for action in callback.do:
            if action.name == "switch" and action.target is not None and written(action.value):
                yield ValuedRequest(action.target, action.value)


def written(request: Request) -> bool:
    """Return whether a request has values."""
    return bool(entries_of(request.source.node))


def entry_values(source: Source, part: PartPlan, found: Collector) -> Values:
    """Return the values (SI) written at `source` for the parameters of a state's part; empty if
    they have errors, which are reported."""
    fields = {field.key: field for field in part.fields}
    values: list[tuple[str, Any]] = []
    before = len(found.all)
    for name, entry in entries_of(source.node).items():
        field = fields.get(name)
        if field is None:
            message = f"`{name}` is not a parameter of `{part.name}`"
            found.report("KYB107", message, entry.key.span, help=did_you_mean(name, fields))
        elif field.shape in _FILES:
            message = f"`{name}` is a file, which is read before the flight"
            hint = "give the other file a state of its own"
            found.report("KYB244", message, entry.value.span, help=hint)
        else:
            is_none = is_null(entry.value) and field.optional
            values.append((name, None if is_none else decode_value(entry.value, field, found)))
    return () if len(found.all) > before else tuple(values)


def with_values(part: PartPlan, written: Node, values: Values) -> PartPlan:
    """Return the part with other values (SI) of its parameters, as if `written` stood in the
    mapping that declares it."""
    entries = {**entries_of(part.source.node), **entries_of(written)}
    place = part.source._replace(node=Mapping(entries, part.source.node.span))
    return part.but(params=replace(part.params, **dict(values)), source=place)


def with_options(
    plan: Plan, options: Iterable[tuple[str, str, Field, Any]], node: Node
) -> Plan | None:
    """Return the plan as if it declared other values of options, at `node`; None if all of them
    belong to built-in states. options: (vehicle, label of the part, parameter, value in SI)."""
    changed: dict[str, VehiclePlan] = {}
    for vehicle, label, field, value in options:
        own = plan.fleet[vehicle]
        written = Mapping({field.key: MappingEntry(Scalar(field.key, node.span), node)}, node.span)
        part = next((part for part in own.parts if part.label == label), None)
        if part is not None:
            part = with_values(part, written, ((field.name, value),))
            changed[vehicle] = own.with_part(part)
    return plan.with_vehicles(changed) if changed else None


def entered_states(plan: Plan, asked: ValuedRequest) -> Iterator[tuple[str, StatePlan]]:
    """Yield each vehicle to which a request gives values, by name, with the requested state that
    has these values; nothing for values with errors."""
    for name in plan.members(asked.who):
        vehicle = plan.fleet[name]
        state = vehicle.states.get(vehicle.goal(asked.request.state))
        values = values_for(vehicle, asked.request)
        if state is not None and values:
            part = with_values(state.behavior, asked.request.source.node, values)
            yield name, state.but(behavior=part)


def values_for(vehicle: VehiclePlan, request: Request) -> Values:
    """Return the values of a request for one of its vehicles; empty if they have errors."""
    entered = vehicle.states.get(vehicle.goal(request.state))
    return () if entered is None else entry_values(request.source, entered.behavior, Collector())
