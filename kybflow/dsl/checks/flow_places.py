"""Finds the positions at which flows enter states, as far as the flows' conditions determine them.

A vehicle that waits for its flow is at its start. If a transition of a phase waits until a vehicle
is in `hover`, in `landed` or in a behavior that stays in place, the vehicle is then where the
requested state ends. All other positions are unknown.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from kybflow.core.geometry import Vec3
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.durations import disturbances
from kybflow.dsl.checks.flows import handovers, runs_of
from kybflow.dsl.checks.phases import said_states
from kybflow.dsl.checks.reachability import endless_states, entries_of, left_at, stays
from kybflow.dsl.expanding.flows import GROUNDED, own_vehicles
from kybflow.dsl.names import end_of
from kybflow.dsl.plan import FlowPlan, PhasePlan, TransitionPlan, VehiclePlan

_MOST_POINTS = 16
_KEEP = frozenset({"hover", "landed"})
"""Built-in states in which a vehicle stays in place until the next phase begins."""
_Points = frozenset[Vec3]
_Places = dict[str, _Points]
"""The positions where each vehicle may be, if they are known."""


class EnteredByFlow(NamedTuple):
    """A state reached through a flow, entered at the position `point`."""

    vehicle: VehiclePlan
    state: str
    point: Vec3


def entered_by_flows(case: Case) -> Iterator[EnteredByFlow]:
    """Yield every entry of a state through flows at a position that is not already known from the
    vehicle's own states."""
    told: set[tuple[str, str, Vec3]] = set()
    for flow in () if case.cached(disturbances) else case.plan.flows:
        for name, places in _places(case, flow).items():
            for who, goal in runs_of(case, flow.phases[name]).items():
                vehicle = case.plan.fleet[who]
                for state, point in _entries(vehicle, vehicle.goal(goal), places.get(who, ())):
                    if (who, state, point) not in told:
                        told.add((who, state, point))
                        yield EnteredByFlow(vehicle, state, point)


def _entries(vehicle: VehiclePlan, goal: str, points: Iterable[Vec3]) -> Iterator[tuple[str, Vec3]]:
    known = entries_of(vehicle)
    for point in points:
        for state, entries in _walked(vehicle, goal, point).items():
            if state in vehicle.states:
                before = known[state].points if state in known else ()
                yield from ((state, entry) for entry in entries if entry not in before)


def _places(case: Case, flow: FlowPlan) -> dict[str, _Places]:
    """Return where each vehicle may be on entry to each phase, by phase."""
    fleet = case.plan.fleet
    first: _Places = {
        name: frozenset({fleet[name].start})
        for name in own_vehicles(case.plan, flow)
        if fleet[name].begin == GROUNDED
    }
    entered = {flow.begin: first} if flow.begin in flow.phases else {}
    waiting = list(entered)
    while waiting:
        phase = flow.phases[waiting.pop()]
        for transition in phase.transitions:
            left = _places_after(case, phase, transition, entered[phase.name])
            target, before = transition.target, entered.get(transition.target)
            had = before or {}
            united = {
                v: had.get(v, frozenset()) | left.get(v, frozenset()) for v in had.keys() | left
            }
            merged = {v: points for v, points in united.items() if len(points) <= _MOST_POINTS}
            if target in flow.phases and merged != before:
                entered[target] = merged
                waiting.append(target)
    return entered


def _places_after(
    case: Case, phase: PhasePlan, transition: TransitionPlan, places: _Places
) -> _Places:
    """Return where each vehicle may be after a transition of a phase. A vehicle from which the
    phase requests nothing stays where it was. If the condition of the transition requires a vehicle
    to be in a state that stays in place, the vehicle is where that state ends."""
    plan = case.plan
    run = runs_of(case, phase)
    given = {asked.vehicle for asked in handovers(plan, phase)}
    left = {v: points for v, points in places.items() if v not in run and v not in given}
    for name, state in said_states(case.condition(transition, "when", case.scopes.flow())):
        if name not in run or name in given:
            continue
        vehicle, found = plan.fleet[name], set[Vec3]()
        for point in places.get(name, ()):
            found |= _walked(vehicle, vehicle.goal(run[name]), point).get(state, set())
        own = vehicle.states.get(state)
        if state in _KEEP or (own is not None and all(stays(own, point) for point in found)):
            left[name] = frozenset(found)
    return left


def _walked(vehicle: VehiclePlan, goal: str, point: Vec3) -> dict[str, set[Vec3]]:
    """Return the entry positions of the state `goal`, entered at `point`, and of all states that
    follow it, as far as they are known."""
    walks: dict[tuple[str, Vec3], dict[str, set[Vec3]]] = vehicle.known.setdefault("walks", {})
    if (goal, point) in walks:
        return walks[goal, point]
    found = walks[goal, point] = {goal: {point}}
    waiting = [(goal, point)]
    while waiting:
        name, entry = waiting.pop()
        for target, left in _left(vehicle, name, entry):
            points = found.setdefault(target, set())
            if left is not None and left not in points and len(points) < _MOST_POINTS:
                points.add(left)
                waiting.append((target, left))
    return found


def _left(vehicle: VehiclePlan, name: str, entry: Vec3) -> Iterator[tuple[str, Vec3 | None]]:
    """Yield (state, entry position) for all states that may follow a state."""
    if name == "brake":
        yield "hover", entry
    state = vehicle.states.get(name)
    if state is None:
        return
    for transition in state.transitions:
        yield transition.target, left_at(state, transition.cause, entry)
    ends = name not in endless_states(vehicle)
    if ends and all(transition.cause != "then" for transition in state.transitions):
        yield end_of(state.legs), left_at(state, "then", entry)
