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
from kybflow.dsl.document import FlowEntry, PhaseEntry, TransitionEntry
from kybflow.dsl.shaping.flows import GROUNDED, own_vehicles
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
    limit = case.document.time_limit
    for flow, way in case.cached(flow_ways):
        transitions = [t for name, _ in way.steps() for t in flow.phases[name].transitions]
        if not exceeds(way.seconds, limit) or any((t.after or 0.0) >= limit for t in transitions):
            continue  # KYB259 tells of a single wait
        yield Diagnostic(
            "KYB437",
            f"`{flow.name.text}` can't have ended when the mission's time is over",
            flow.phases[way.longest()].span,
            label=f"the flow takes {seconds_of(way.seconds)} at least",
            notes=(sum_of(way), f"its `time_limit` is {seconds_of(limit)}"),
            help="wait for less, or write a longer `time_limit`",
        )


def flow_ways(case: Case) -> Iterator[tuple[FlowEntry, Way]]:
    """The quickest way through each flow that has its vehicles from the start, by its phases."""
    for flow, states in () if case.document.faults else case.cached(_undisturbed):
        if own_vehicles(case.document, flow):
            ways = quickest(
                [flow.begin.text], partial(_phases_ahead, case, flow, states), lambda name: name
            )
            ends = [way for name, way in ways.items() if _ends(flow, name)]
            if ends:
                yield flow, min(ends, key=lambda way: way.seconds)


def _ends(flow: FlowEntry, name: str) -> bool:
    return name not in flow.phases or not flow.phases[name].transitions


def _phases_ahead(
    case: Case, flow: FlowEntry, states: dict[str, dict[str, str]], name: str
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
        yield transition.target.text, max(own_wait(transition), way.seconds)


def _may_be_late(case: Case, phase: PhaseEntry, limit: float) -> bool:
    """Whether not everything that a phase asks for surely fits into its limit."""
    vehicles = (case.document.vehicles[name] for name in runs_of(case, phase))
    return any(not no_way_exceeds(case, vehicle, limit) for vehicle in vehicles)


def _undisturbed(case: Case) -> Iterator[tuple[FlowEntry, dict[str, dict[str, str]]]]:
    """Every flow that no callback disturbs, with what is known of its vehicles' states."""
    for flow in () if case.cached(disturbances) else case.document.flows.values():
        yield flow, _known_states(case, flow)


def _least_wait(
    case: Case, phase: PhaseEntry, transition: TransitionEntry, states: dict[str, str]
) -> tuple[str, Way]:
    """(the vehicle that takes longest, its quickest way) until a way out of a phase can open."""
    slowest = ("", Way(0.0))
    run = runs_of(case, phase)
    for name, state in said_states(case.condition(transition.when, case.scopes.flow())):
        if name not in run or name not in states or is_in(states[name], state):
            continue
        vehicle = case.document.vehicles[name]
        goal = vehicle.goal(run[name])
        first = [FlightNode(goal, leg.start) for leg in case.legs(vehicle, goal)]
        way = quickest_into(ways_from(case, vehicle, first), state)
        if way is not None and way.seconds > slowest[1].seconds:
            slowest = name, way
    return slowest


def _known_states(case: Case, flow: FlowEntry) -> dict[str, dict[str, str]]:
    """The state that each vehicle surely is in when a phase is entered, by phase."""
    document, scope = case.document, case.scopes.flow()
    first = {
        name: GROUNDED
        for name in own_vehicles(document, flow)
        if document.vehicles[name].begin.text == GROUNDED
    }
    entered = {flow.begin.text: first} if flow.begin.text in flow.phases else {}
    waiting = list(entered)
    while waiting:
        phase = flow.phases[waiting.pop()]
        asked = {*runs_of(case, phase), *(a.vehicle for a in handovers(document, phase))}
        for transition in phase.transitions:
            still = {v: s for v, s in entered[phase.name.text].items() if v not in asked}
            left = {v: s for v, s in still.items() if s == GROUNDED}
            left |= dict(said_states(case.condition(transition.when, scope)))
            target = transition.target.text
            before = entered.get(target)
            merged = left if before is None else dict(before.items() & left.items())
            if target in flow.phases and merged != before:
                entered[target] = merged
                waiting.append(target)
    return entered
