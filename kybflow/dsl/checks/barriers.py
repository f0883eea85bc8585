"""Lower bounds for the duration of flow phases: KYB436 and KYB437."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.durations import (
    Way,
    disturbances,
    exceeds,
    no_way_exceeds,
    own_wait,
    quickest,
    quickest_into,
    seconds_of,
    sum_of,
    ways_from,
)
from kybflow.dsl.checks.flows import handovers, runs_of
from kybflow.dsl.checks.phases import said_states
from kybflow.dsl.checks.reachability import FlightNode
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.expanding.flows import GROUNDED, own_vehicles
from kybflow.dsl.plan import FlowPlan, PhasePlan, TransitionPlan
from kybflow.parts.observables import is_in


def barrier_too_short(case: Case) -> Iterator[Diagnostic]:
    """KYB436: the `within` of a phase expires before the state that the phase waits for can be
    reached.

    This is checked for vehicles that the phase runs and whose state at its beginning is known: they
    wait for the flow, or the condition that leads into the phase names their state.
    """
    for flow, known in case.cached(_undisturbed):
        for name, states in known.items():
            phase = flow.phases[name]
            limit = next((t for t in phase.transitions if t.cause == "within"), None)
            vehicles = [case.plan.fleet[name] for name in runs_of(case, phase)]
            if limit is None or limit.after is None:
                continue
            if all(no_way_exceeds(case, vehicle, limit.after) for vehicle in vehicles):
                continue
            ways = (t for t in phase.transitions if t is not limit)
            waits = [_least_wait(case, phase, t, states) for t in ways]
            least = min(waits, key=lambda w: w[1].seconds, default=("", Way(0.0)))
            if exceeds(least[1].seconds, limit.after):
                yield Diagnostic(
                    "KYB436",
                    f"the phase `{name}` ends before `{least[0]}` can reach the awaited state",
                    limit.span,
                    label=f"needs at least {seconds_of(least[1].seconds)}",
                    notes=(sum_of(least[1]),),
                    help="allow more time",
                )


def flow_too_long(case: Case) -> Iterator[Diagnostic]:
    """KYB437: a flow needs more time than the mission's time limit, so the run lands its vehicles
    early and fails."""
    limit = case.plan.time_limit
    for flow, way in case.cached(flow_ways):
        transitions = [t for name, _ in way.steps() for t in flow.phases[name].transitions]
        if not exceeds(way.seconds, limit) or any((t.after or 0.0) >= limit for t in transitions):
            continue  # KYB259 reports a single wait
        yield Diagnostic(
            "KYB437",
            f"`{flow.name}` can't finish within the mission's time limit",
            flow.phases[way.longest()].span,
            label=f"the flow takes at least {seconds_of(way.seconds)}",
            notes=(sum_of(way), f"its `time_limit` is {seconds_of(limit)}"),
            help="shorten the waits, or write a longer `time_limit`",
        )


def flow_ways(case: Case) -> Iterator[tuple[FlowPlan, Way]]:
    """Yield the quickest path through the phases of each flow to which vehicles belong from the
    start of the mission."""
    for flow, states in () if case.plan.faults else case.cached(_undisturbed):
        if own_vehicles(case.plan, flow):
            ways = quickest(
                [flow.begin], partial(_phases_ahead, case, flow, states), lambda name: name
            )
            going_on = {name for name, phase in flow.phases.items() if phase.transitions}
            ends = [way for name, way in ways.items() if name not in going_on]
            if ends:
                yield flow, min(ends, key=lambda way: way.seconds)


def _phases_ahead(
    case: Case, flow: FlowPlan, states: dict[str, dict[str, str]], name: str
) -> Iterator[tuple[str, float]]:
    """Yield (phase, seconds) for each phase that may follow a phase: the least time until it
    begins. A `within` counts only if no other transition leaves the phase."""
    phase = flow.phases.get(name)
    if phase is None:
        return
    is_bounded_only = all(t.cause == "within" for t in phase.transitions)
    for transition in phase.transitions:
        if transition.cause == "within" and not is_bounded_only:
            continue
        _, way = _least_wait(case, phase, transition, states.get(name, {}))
        yield transition.target, max(own_wait(transition), way.seconds)


def _undisturbed(case: Case) -> Iterator[tuple[FlowPlan, dict[str, dict[str, str]]]]:
    """Yield each flow with the known states of its vehicles on entry to each phase. Yields nothing
    if a callback may disturb flows."""
    for flow in () if case.cached(disturbances) else case.plan.flows:
        yield flow, _known_states(case, flow)


def _least_wait(
    case: Case, phase: PhasePlan, transition: TransitionPlan, states: dict[str, str]
) -> tuple[str, Way]:
    """Return (vehicle, path) for the vehicle that takes longest until a transition of a phase can
    be taken, with its quickest path."""
    slowest = ("", Way(0.0))
    run = runs_of(case, phase)
    for name, state in said_states(case.condition(transition, "when", case.scopes.flow())):
        if name not in run or name not in states or is_in(states[name], state):
            continue
        vehicle = case.plan.fleet[name]
        goal = vehicle.goal(run[name])
        first = [FlightNode(goal, leg.start) for leg in case.legs(vehicle, goal)]
        way = quickest_into(ways_from(case, vehicle, first), state)
        if way is not None and way.seconds > slowest[1].seconds:
            slowest = name, way
    return slowest


def _known_states(case: Case, flow: FlowPlan) -> dict[str, dict[str, str]]:
    """Return, for each phase, the states in which vehicles are certain to be when it is entered."""
    plan, scope = case.plan, case.scopes.flow()
    first = {
        name: GROUNDED for name in own_vehicles(plan, flow) if plan.fleet[name].begin == GROUNDED
    }
    entered = {flow.begin: first} if flow.begin in flow.phases else {}
    waiting = list(entered)
    while waiting:
        phase = flow.phases[waiting.pop()]
        asked = {*runs_of(case, phase), *(a.vehicle for a in handovers(plan, phase))}
        for transition in phase.transitions:
            still = {v: s for v, s in entered[phase.name].items() if v not in asked}
            left = {v: s for v, s in still.items() if s == GROUNDED}
            left |= dict(said_states(case.condition(transition, "when", scope)))
            target = transition.target
            before = entered.get(target)
            merged = left if before is None else dict(before.items() & left.items())
            if target in flow.phases and merged != before:
                entered[target] = merged
                waiting.append(target)
    return entered
