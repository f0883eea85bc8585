"""The values that a state is entered with in place of its own: `run: {a: {goto: {position: [1, 0,
1]}}}` in a phase, `switch: {a: {goto: {...}}}` in a callback. Only parameters change: the state
keeps its transitions."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

from kybflow.core.text import did_you_mean
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic, collect
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.document import Document, PartUse, StateEntry, VehicleEntry
from kybflow.dsl.names.option_names import members
from kybflow.dsl.plan import Values
from kybflow.dsl.reading.nodes import Mapping, MappingEntry, Scalar, is_null
from kybflow.dsl.reading.values import decode

CODES = {
    "KYB244": "Values for no state, or for several.",
}
_FILES = frozenset({"file", "file path"})


class ValuedRequest(NamedTuple):
    """A request in a phase or a callback that brings values with it."""

    who: Text
    state: Text
    values: Mapping


def goal_of(entry: MappingEntry) -> Diagnosed[tuple[Text, Mapping | None] | None]:
    """The state that the value of a vehicle means, and its values: `goto`, or `{goto: {...}}`; None
    where it is neither, with a finding unless it is null."""
    node = entry.value
    if isinstance(node, Scalar):
        return None if node.is_null else (node.as_text, None)
    if isinstance(node, Mapping) and len(node.entries) == 1:
        [asked] = node.entries.values()
        if isinstance(asked.value, Mapping):
            return asked.key.as_text, asked.value if asked.value.entries else None
        if is_null(asked.value):
            return asked.key.as_text, None
    message = f"`{entry.key.text}` is asked for what is no state with its values"
    hint = f"write `{entry.key.text}: STATE` or `{entry.key.text}: {{STATE: {{...}}}}`"
    yield Diagnostic("KYB244", message, node.span, help=hint)
    return None


def valued_requests(document: Document) -> Iterator[ValuedRequest]:
    """Every request of the mission that brings values with it."""
    for flow in document.flows.values():
        for phase in flow.phases.values():
            for who, state in phase.run:
                if who.text in phase.values:
                    yield ValuedRequest(who, state, phase.values[who.text])
    for callback in document.callbacks:
        for action in callback.actions:
            if action.values is not None and action.target is not None:
                yield ValuedRequest(action.target, action.value, action.values)


def entry_values(written: Mapping, part: PartUse) -> Diagnosed[Values]:
    """The values (SI) of `written` for the parameters of a state's part; empty, with findings,
    where they have errors."""
    fields = {field.name: field for field in part.spec.fields}
    values: list[tuple[str, Any]] = []
    findings: list[Diagnostic] = []
    for name, entry in written.entries.items():
        field = fields.get(name)
        if field is None:
            findings.append(_unknown(entry, part))
        elif field.shape in _FILES:
            message = f"`{name}` is a file, which is read before the flight"
            hint = "give the other file a state of its own"
            findings.append(Diagnostic("KYB244", message, entry.value.span, help=hint))
        elif is_null(entry.value) and field.optional:
            values.append((name, None))
        else:
            value, found = collect(decode(entry.value, field))
            findings += found
            values.append((name, value))
    yield from findings
    return () if findings else tuple(values)


def _unknown(entry: MappingEntry, part: PartUse) -> Diagnostic:
    name, known = entry.key.text, [field.name for field in part.spec.fields]
    own = part.spec.name
    return Diagnostic(
        "KYB107",
        f"`{name}` is no parameter of `{own}`",
        entry.key.span,
        help=did_you_mean(name, known),
    )


def with_values(state: StateEntry, written: Mapping, values: Values) -> StateEntry:
    """The state as it is entered with other values."""
    spans = {name: entry.value.span for name, entry in written.entries.items()}
    params = dataclasses.replace(state.part.params, **dict(values))
    part = replace(state.part, params=params, spans={**state.part.spans, **spans})
    return replace(state, part=part)


def entered_states(document: Document, asked: ValuedRequest) -> Iterator[tuple[str, StateEntry]]:
    """(vehicle, its state as it is entered) of each vehicle that is asked; nothing for values with
    errors."""
    for name in members(document, asked.who.text):
        vehicle = document.vehicles[name]
        state = vehicle.states.get(vehicle.goal(asked.state.text))
        values = values_for(vehicle, asked.state.text, asked.values)
        if state is not None and values:
            yield name, with_values(state, asked.values, values)


def values_for(vehicle: VehicleEntry, state: str, written: Mapping) -> Values:
    """The values of a request for one of its vehicles; none where they have errors."""
    entered = vehicle.states.get(vehicle.goal(state))
    return () if entered is None else collect(entry_values(written, entered.part)).value
