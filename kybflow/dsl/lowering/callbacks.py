"""Callbacks of the document to those of the plan: groups become their vehicles, names what they
stand for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.document import ActionEntry, CallbackEntry, Document
from kybflow.dsl.expressions import Scope, parse
from kybflow.dsl.names.option_names import members, option_values
from kybflow.dsl.plan import (
    ActionPlan,
    Call,
    CallbackPlan,
    Emit,
    Enable,
    EnterPhase,
    LogText,
    PartPlan,
    Perform,
    SetOption,
    Stop,
    Switch,
)
from kybflow.dsl.shaping.entry_values import values_for

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog


def callback_plans(document: Document, scope: Scope, catalog: Catalog) -> tuple[CallbackPlan, ...]:
    """Every callback, in the order of the mission; `scope` is that of their conditions."""
    return tuple(_callback(one, document, scope, catalog) for one in document.callbacks)


def _callback(
    callback: CallbackEntry, document: Document, scope: Scope, catalog: Catalog
) -> CallbackPlan:
    event, vehicles = ("", ()) if callback.event is None else _heard(callback.event.text, document)
    return CallbackPlan(
        event=event,
        vehicles=vehicles,
        actions=tuple(
            plan for action in callback.actions for plan in _action(action, document, catalog)
        ),
        fields=tuple((field.text, value.text) for field, value in callback.fields),
        when=None if callback.when is None else parse(callback.when, scope)[0],
        at=callback.span.at,
        hold=callback.hold,
    )


def _heard(event: str, document: Document) -> tuple[str, tuple[str, ...]]:
    """(the event's own name, whose it is): a vehicle's, any one's, a group's, or the run's."""
    first, dot, name = event.partition(".")
    vehicles = tuple(document.vehicles) if first == "any" else members(document, first)
    return (name, vehicles) if dot and vehicles else (event, ("",))


def _action(action: ActionEntry, document: Document, catalog: Catalog) -> Iterator[ActionPlan]:
    name, target, part = action.name.text, action.target, action.part
    if part is not None:
        label = f"actions.{part.label}"
        yield Call(PartPlan(part.spec.name, part.spec.cls, part.params, label, part.span.at))
    elif name in ("switch", "perform") and target is not None:
        for vehicle in members(document, target.text):
            yield _asked(action, vehicle, document)
    elif name == "set":
        for option, value in option_values(action, document, catalog, Findings()):
            yield SetOption(option.name, value)
    elif name in ("enable", "disable"):
        who, _, label = action.value.text.partition(".")
        for vehicle in members(document, who):
            yield Enable(vehicle, label, name == "enable")
    elif name == "phase":
        yield _phase(action, document)
    else:
        yield _TOLD[name](action.value.text)


def _asked(action: ActionEntry, vehicle: str, document: Document) -> Switch | Perform:
    """What `switch` and `perform` ask of one vehicle."""
    if action.name.text == "perform":
        return Perform(vehicle, action.value.text)
    owner, state, written = document.vehicles[vehicle], action.value.text, action.values
    values = () if written is None else values_for(owner, state, written)
    return Switch(vehicle, owner.goal(state), values)


_TOLD: dict[str, type[Emit] | type[LogText] | type[Stop]] = {
    "emit": Emit,
    "log": LogText,
    "stop": Stop,
}


def _phase(action: ActionEntry, document: Document) -> EnterPhase:
    phase = action.value.text
    if action.target is not None:
        return EnterPhase(action.target.text, phase)
    return EnterPhase(next(n for n, f in document.flows.items() if phase in f.phases), phase)
