"""The values with which a state is entered in place of its own: `run: {a: {goto: {position: [1, 0,
1]}}}` in a phase, `switch: {a: {goto: {...}}}` in a callback. Only parameters change; the state
keeps its transitions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics import Findings
from kybflow.dsl.language.source import Source
from kybflow.dsl.plan import PartPlan, Plan, Request, StatePlan, Values, VehiclePlan
from kybflow.dsl.reading.nodes import Mapping, entries_of, is_null
from kybflow.dsl.reading.values import decode_value

_FILES = frozenset({"file", "file path"})


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


def entry_values(source: Source, part: PartPlan, found: Findings) -> Values:
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


def with_values(state: StatePlan, source: Source, values: Values) -> StatePlan:
    """Return the state with other values of its parameters."""
    part = state.behavior
    entries = {**entries_of(part.source.node), **entries_of(source.node)}
    place = part.source._replace(node=Mapping(entries, part.source.node.span))
    part = part.but(params=replace(part.params, **dict(values)), source=place)
    return state.but(behavior=part)


def entered_states(plan: Plan, asked: ValuedRequest) -> Iterator[tuple[str, StatePlan]]:
    """Yield each requested vehicle with its state and the new values; nothing for values with
    errors."""
    for name in plan.members(asked.who):
        vehicle = plan.fleet[name]
        state = vehicle.states.get(vehicle.goal(asked.request.state))
        values = values_for(vehicle, asked.request)
        if state is not None and values:
            yield name, with_values(state, asked.request.source, values)


def values_for(vehicle: VehiclePlan, request: Request) -> Values:
    """Return the values of a request for one of its vehicles; empty if they have errors."""
    entered = vehicle.states.get(vehicle.goal(request.state))
    return () if entered is None else entry_values(request.source, entered.behavior, Findings())
