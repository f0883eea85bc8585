"""The events that a person can emit: those that the mission waits for at any time, and those that
it waits for now."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from kybflow.core.errors import EventRefused
from kybflow.core.text import did_you_mean
from kybflow.dsl.plan import ActionPlan, Call, Emit, Plan, TransitionPlan
from kybflow.parts.events import AWAITED_EVENTS
from kybflow.runtime.commanding.orders import COMMANDS, PREFIX


def check_emitted(plan: Plan, names: Iterable[str]) -> None:
    """Raise EventRefused for the first of `names` that a person can't emit, because the mission
    doesn't wait for it or kybflow emits it."""
    known = {*awaited(plan), *COMMANDS}
    for name in names:
        if name in AWAITED_EVENTS:
            raise EventRefused(
                f"the mission doesn't wait for a person's `{name}`: kybflow tells it"
            )
        if name not in known:
            hint = did_you_mean(name, known)
            raise EventRefused(f"the mission doesn't wait for `{name}`; {hint}")


def awaited(plan: Plan) -> Iterator[str]:
    """Yield the events of the operator and of the mission itself that any transition or callback
    waits for."""
    own = {name for one in plan.callbacks for action in one.actions for name in _emitted(action)}
    states = (state for vehicle in plan.vehicles for state in vehicle.states.values())
    phases = (phase for flow in plan.flows for phase in flow.phases.values())
    transitions = [t for places in (states, phases) for place in places for t in place.transitions]
    own |= {transition.emit for transition in transitions if transition.emit is not None}
    heard = set(heard_by(transitions))
    for name in sorted(heard | heard_always(plan)):
        if name in own or name.startswith(PREFIX):
            yield name


def awaited_now(plan: Plan, states: Mapping[str, str], phases: Mapping[str, str]) -> set[str]:
    """Return the events that a transition or callback waits for now.

    states: the active state of each vehicle that has one, by the vehicle's name.
    phases: the current phase of each active flow, by the flow's name.
    """
    heard = heard_always(plan)
    for vehicle in plan.vehicles:
        if vehicle.name in states:
            heard.update(heard_by(vehicle.states[states[vehicle.name]].transitions))
    for flow in plan.flows:
        if flow.name in phases:
            heard.update(heard_by(flow.phases[phases[flow.name]].transitions))
    return heard


def heard_by(transitions: Iterable[TransitionPlan]) -> tuple[str, ...]:
    """Return the events that these transitions wait for, without duplicates."""
    return tuple(dict.fromkeys(t.event for t in transitions if t.event is not None))


def heard_always(plan: Plan) -> set[str]:
    """Return the events without a vehicle that callbacks wait for during the whole run."""
    return {callback.event for callback in plan.callbacks if callback.vehicles == ("",)}


def _emitted(action: ActionPlan) -> tuple[str, ...]:
    if isinstance(action, Emit):
        return (action.name,)
    return action.part.cls.events if isinstance(action, Call) else ()
