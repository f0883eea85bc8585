"""Reports the current situation of a run, which commands it would accept now, and which events a
person can emit: those that the mission waits for at any time, and those that it waits for now."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from kybflow.core.errors import EventRefused
from kybflow.core.geometry import heading_of
from kybflow.core.signals import NS, Estimate, Time
from kybflow.core.text import did_you_mean
from kybflow.dsl.plan import Call, Emit, Plan, TransitionPlan
from kybflow.parts.events import AWAITED_EVENTS
from kybflow.runtime.commanding.orders import COMMANDS, PREFIX
from kybflow.runtime.commanding.situation import (
    EstimateSummary,
    FlowSituation,
    SetpointSummary,
    Situation,
    VehicleSituation,
)
from kybflow.runtime.fleet.flows import Flows, RunningFlow
from kybflow.runtime.vehicle.vehicle import Vehicle


def check_emitted(plan: Plan, names: Iterable[str]) -> None:
    """Raise EventRefused for the first of `names` that a person can't emit, because the mission
    doesn't wait for it or kybflow emits it."""
    known = {*awaited(plan), *COMMANDS}
    for name in names:
        if name in AWAITED_EVENTS:
            raise EventRefused(
                f"the mission doesn't wait for a person's `{name}`: kybflow raises that event "
                "itself"
            )
        if name not in known:
            hint = did_you_mean(name, known)
            raise EventRefused(f"the mission doesn't wait for `{name}`; {hint}")


def awaited(plan: Plan) -> Iterator[str]:
    """Yield the events of the operator and of the mission itself that any transition or callback
    waits for."""
    actions = [action for callback in plan.callbacks for action in callback.actions]
    own = {action.name for action in actions if isinstance(action, Emit)}
    own.update(n for action in actions if isinstance(action, Call) for n in action.part.cls.events)
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


NOT_FLYING = "the preflight is not over"
"""Why most commands are refused before the first tick."""


class RunView(NamedTuple):
    """The parts of a run that determine its situation."""

    plan: Plan
    vehicles: Sequence[Vehicle]
    flows: Flows

    def awaited_now(self) -> set[str]:
        """Return the events that a transition or callback waits for now."""
        begun = {v.name: v.state for v in self.vehicles if v.runner.begun}
        flows = (self.flows.running(flow.name) for flow in self.plan.flows)
        phases = {flow.plan.name: flow.phase.name for flow in flows if flow.active}
        return awaited_now(self.plan, begun, phases)

    def situation(self, now: Time, holder: str | None, *, flying: bool) -> Situation:
        """Return the situation at `now`. holder: the name of the lease's holder, or None. flying:
        whether the preflight is over."""
        heard = self.awaited_now()
        return Situation(
            mission=self.plan.mission,
            time=now / NS,
            flying=flying,
            holder=holder,
            vehicles=tuple(_vehicle(v, now, self.flows.driver(v.name)) for v in self.vehicles),
            flows=tuple(_flow(flow.name, self.flows, now, flying) for flow in self.plan.flows),
            emit={name: flying and name in heard for name in awaited(self.plan)},
        )


def _vehicle(vehicle: Vehicle, now: Time, driver: str | None) -> VehicleSituation:
    runner, requests, override = vehicle.runner, vehicle.requests, vehicle.link_out.override
    begun, failsafe, hold = runner.begun, vehicle.failsafe, runner.hold
    early, aim = None if begun else NOT_FLYING, vehicle.followed
    goals = [name for name in vehicle.plan.states if name != "fault"]
    return VehicleSituation(
        name=vehicle.name,
        state=vehicle.state if begun else "",
        behavior=runner.state.behavior.name if begun else "",
        flight=runner.flight.value,
        elapsed=(now - runner.entered) / NS if begun else 0.0,
        holders=() if hold is None else tuple(sorted(hold.holders)),
        latched=None if failsafe.latched is None else failsafe.latched.name.lower(),
        braking=failsafe.brakes_because or None,
        override=None if override is None else override.reason,
        retired=requests.retired,
        driver=driver,
        battery=None if vehicle.battery is None else vehicle.battery.remaining,
        estimate=_estimate(vehicle.estimate, vehicle.estimator),
        setpoint=None if aim is None else SetpointSummary(aim.position, aim.velocity),
        waits_for=heard_by(runner.state.transitions) if begun else (),
        enter={goal: early or requests.objection(goal) for goal in goals},
        pause=early or requests.pause_objection(),
        resume=early or requests.resume_objection(),
        reset=early or requests.reset_objection(now),
        land=early or requests.land_objection(),
    )


def _estimate(estimate: Estimate | None, estimator: str | None) -> EstimateSummary | None:
    if estimate is None:
        return None
    heading = heading_of(estimate.attitude)
    return EstimateSummary(estimate.position, estimate.velocity, heading, estimate.age, estimator)


def _flow(name: str, flows: Flows, now: Time, flying: bool) -> FlowSituation:
    running: RunningFlow = flows.running(name)
    reason = flows.objection(name) if flying else NOT_FLYING
    return FlowSituation(
        name=name,
        phase=running.phase.name if running.active else None,
        elapsed=(now - running.entered) / NS if running.active else 0.0,
        vehicles=tuple(flows.driven(name)),
        waits_for=heard_by(running.phase.transitions) if running.active else (),
        enter=dict.fromkeys(running.plan.phases, reason),
    )
