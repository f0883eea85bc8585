"""The time that phases of flows need, as lower bounds: KYB436 and KYB437."""

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
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.expanding.flows import GROUNDED, own_vehicles
from kybflow.dsl.plan import FlowPlan, PhasePlan, TransitionPlan
from kybflow.parts.observables import is_in


def barrier_too_short(case: Case) -> Iterator[Diagnostic]:
    """KYB436: the `within` of a phase is over before what the phase waits for can be.

    That is told of vehicles that the phase runs, where it is known in which state they are when it
    begins: waiting for the flow, or as the way into the phase says.
    """
    for flow, known in case.cached(_undisturbed):
        for name, states in known.items():
            phase = flow.phases[name]
            limit = next((t for t in phase.transitions if t.cause == "within"), None)
            if limit is None or limit.after is None or not _may_be_late(case, phase, limit.after):
                continue
            ways = (t for t in phase.transitions if t is not limit)
            waits = [_least_wait(case, phase, t, states) for t in ways]
            least = min(waits, key=lambda w: w[1].seconds, default=("", Way(0.0)))
            if exceeds(least[1].seconds, limit.after):
                yield Diagnostic(
                    "KYB436",
                    f"the phase `{name}` is over before `{least[0]}` is where it waits for",
                    limit.span,
                    label=f"needs {seconds_of(least[1].seconds)} at least",
                    notes=(sum_of(least[1]),),
                    help="allow more time",
                )


def flow_too_long(case: Case) -> Iterator[Diagnostic]:
    """KYB437: a flow can't have ended when the mission's time is over: the run lands its vehicles
    and has not succeeded."""
    limit = case.plan.time_limit
    for flow, way in case.cached(flow_ways):
        transitions = [t for name, _ in way.steps() for t in flow.phases[name].transitions]
        if not exceeds(way.seconds, limit) or any((t.after or 0.0) >= limit for t in transitions):
            continue  # KYB259 tells of a single wait
        yield Diagnostic(
            "KYB437",
            f"`{flow.name}` can't have ended when the mission's time is over",
            flow.phases[way.longest()].span,
            label=f"the flow takes {seconds_of(way.seconds)} at least",
            notes=(sum_of(way), f"its `time_limit` is {seconds_of(limit)}"),
            help="wait for less, or write a longer `time_limit`",
        )


def flow_ways(case: Case) -> Iterator[tuple[FlowPlan, Way]]:
    """The quickest way through each flow that has its vehicles from the start, by its phases."""
    for flow, states in () if case.plan.faults else case.cached(_undisturbed):
        if own_vehicles(case.plan, flow):
            ways = quickest(
                [flow.begin], partial(_phases_ahead, case, flow, states), lambda name: name
            )
            ends = [way for name, way in ways.items() if _ends(flow, name)]
            if ends:
                yield flow, min(ends, key=lambda way: way.seconds)


def _ends(flow: FlowPlan, name: str) -> bool:
    return name not in flow.phases or not flow.phases[name].transitions


def _phases_ahead(
    case: Case, flow: FlowPlan, states: dict[str, dict[str, str]], name: str
) -> Iterator[tuple[str, float]]:
    """The phases that follow one, with the least seconds until then. A `within` is the way out of a
    phase that has no other."""
    phase = flow.phases.get(name)
    if phase is None:
        return
    is_bounded_only = all(t.cause == "within" for t in phase.transitions)
    for transition in phase.transitions:
        if transition.cause == "within" and not is_bounded_only:
            continue
        _, way = _least_wait(case, phase, transition, states.get(name, {}))
        yield transition.target, max(own_wait(transition), way.seconds)


def _may_be_late(case: Case, phase: PhasePlan, limit: float) -> bool:
    """Whether not everything that a phase asks for surely fits into its limit."""
    vehicles = (case.plan.fleet[name] for name in runs_of(case, phase))
    return any(not no_way_exceeds(case, vehicle, limit) for vehicle in vehicles)


def _undisturbed(case: Case) -> Iterator[tuple[FlowPlan, dict[str, dict[str, str]]]]:
    """Every flow that no callback disturbs, with what is known of its vehicles' states."""
    for flow in () if case.cached(disturbances) else case.plan.flows:
        yield flow, _known_states(case, flow)


def _least_wait(
    case: Case, phase: PhasePlan, transition: TransitionPlan, states: dict[str, str]
) -> tuple[str, Way]:
    """(the vehicle that takes longest, its quickest way) until a way out of a phase can open."""
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
    """The state that each vehicle surely is in when a phase is entered, by phase."""
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
