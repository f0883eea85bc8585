"""The time that phases of flows need, as lower bounds: KYB436."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.budgets import disturbances
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.durations import (
    Way,
    exceeds,
    no_way_exceeds,
    quickest_into,
    seconds_of,
    sum_of,
    ways_from,
)
from kybflow.dsl.checks.flows import assignments
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
    flows = {} if case.cached(disturbances) else case.document.flows
    for flow in flows.values():
        if not any(_may_be_late(case, phase) for phase in flow.phases.values()):
            continue
        for name, states in _known_states(case, flow).items():
            phase = flow.phases[name]
            limit = next((t for t in phase.transitions if t.cause == "within"), None)
            waits = [
                _least_wait(case, phase, t, states) for t in phase.transitions if t is not limit
            ]
            least = min(waits, key=lambda w: w[1].seconds, default=None)
            if limit is None or limit.after is None or least is None:
                continue
            if exceeds(least[1].seconds, limit.after):
                yield Diagnostic(
                    "KYB436",
                    f"the phase `{name}` is over before `{least[0]}` is where it waits for",
                    limit.span,
                    label=f"needs {seconds_of(least[1].seconds)} at least",
                    notes=(sum_of(least[1]),),
                    help="allow more time",
                )


def _may_be_late(case: Case, phase: PhaseEntry) -> bool:
    """Whether a phase has a limit that not everything fits into which it asks for."""
    limit = next((t.after for t in phase.transitions if t.cause == "within"), None)
    run = assignments(case.document, phase.run) if limit is not None else ()
    vehicles = (case.document.vehicles[asked.vehicle] for asked in run)
    return any(not no_way_exceeds(case, vehicle, limit or 0.0) for vehicle in vehicles)


def _least_wait(
    case: Case, phase: PhaseEntry, transition: TransitionEntry, states: dict[str, str]
) -> tuple[str, Way]:
    """(the vehicle that takes longest, its quickest way) until a way out of a phase can open."""
    slowest = ("", Way(0.0))
    run = {a.vehicle: a.goal.text for a in assignments(case.document, phase.run)}
    for name, state in said_states(case.condition(transition.when, case.scopes.flow())):
        vehicle = case.document.vehicles[name]
        if name not in run or name not in states or is_in(states[name], state):
            continue
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
        asked = {a.vehicle for a in assignments(document, (*phase.run, *phase.give))}
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
