"""Checks where vehicles come to rest: KYB344."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

from kybflow.core.geometry import Vec3, distance
from kybflow.core.units import LENGTH, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.durations import disturbances
from kybflow.dsl.checks.flows import runs_of
from kybflow.dsl.checks.reachability import endless_states, entries_after, entries_of, may_end
from kybflow.dsl.checks.space import aim_of, own_place, shown_point
from kybflow.dsl.diagnostics import Diagnostic, Severity, Span
from kybflow.dsl.expanding.flows import given_vehicles, named_vehicles
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import END, StatePlan, VehiclePlan
from kybflow.parts import GROUND

_BELOW = frozenset({"landed", "brake", "hover", "auto_land"})
"""Built-in states that lead to the ground below."""


class RestingPlace(NamedTuple):
    """A position where a vehicle stays, and the source location that determines it."""

    at: Vec3
    span: Span


def rest_in_one_place(case: Case) -> Iterator[Diagnostic]:
    """KYB344: two vehicles come to rest so close together that they touch.

    A vehicle that never flies rests at its start, any other where its last landing ends. For a
    vehicle that a flow controls, that is where the flow's last request leads. Vehicles are not
    checked if one of their resting places is unknown, or if one of several is free.
    """
    resting = [(v, rests) for v in case.plan.vehicles if (rests := _rests(case, v))]
    for index, (b, own) in enumerate(resting):
        for a, others in resting[:index]:
            apart = (a.airframe.diameter + b.airframe.diameter) / 2
            if any(distance(p.at, q.at) >= apart for p, q in product(own, others)):
                continue
            first, second = others[0], own[0]
            yield Diagnostic(
                "KYB344",
                f"`{b.name}` comes to rest where `{a.name}` does",
                own_place(b, second.span, first.span),
                label=f"{format_quantity(distance(first.at, second.at), LENGTH)} away",
                notes=(f"`{a.name}` rests at {shown_point(first.at)} ({first.span.at})",),
                help=f"keep their resting places at least {format_quantity(apart, LENGTH)} apart",
                severity=Severity.WARNING,
            )
            break


def _rests(case: Case, vehicle: VehiclePlan) -> list[RestingPlace]:
    """Return every position where the vehicle may come to rest without a failure; empty if one is
    unknown."""
    found: list[RestingPlace] = []
    endless = endless_states(vehicle)
    goals = frozenset(_asked_last(case, vehicle) if vehicle.requested else ())
    if not goals <= vehicle.states.keys():
        return []
    reached = entries_after(vehicle, goals) if goals else entries_of(vehicle)
    for name, entries in reached.items():
        state = vehicle.states[name]
        transitions = [a for a in state.transitions if may_end(a, name in endless)]
        by_default = [a for a in transitions if a.target in BUILT_IN]
        if any(a.cause != "then" or a.target not in _BELOW for a in by_default):
            return []
        goes_on = name in endless or any(
            a.cause == "then" for a in transitions if a not in by_default
        )
        if goes_on and not (_is_on_ground(state) and not transitions):
            continue
        rests = [_rest(vehicle, state, entry) for entry in entries.candidates()]
        if None in rests:
            return []
        found += (rest for rest in rests if rest is not None)
    return found


def _asked_last(case: Case, vehicle: VehiclePlan) -> Iterator[str]:
    """Yield the states that may be the last ones that the vehicle's flow requests, for every path
    from its first phase to its end. Yields nothing if another flow or a callback may request
    more."""
    flows = [f for f in case.plan.flows if vehicle.name in named_vehicles(case.plan, f)]
    if len(flows) != 1 or case.cached(disturbances):
        return
    (flow,) = flows
    if vehicle.name in given_vehicles(case.plan, flow):
        return
    waiting, seen = [(flow.begin, vehicle.begin)], set[tuple[str, str]]()
    while waiting:
        name, goal = waiting.pop()
        if (name, goal) in seen or name not in flow.phases:
            continue
        seen.add((name, goal))
        phase = flow.phases[name]
        goal = vehicle.goal(runs_of(case, phase).get(vehicle.name, goal))
        if not phase.transitions or any(t.target == END for t in phase.transitions):
            yield goal
        waiting += ((transition.target, goal) for transition in phase.transitions)


def _rest(vehicle: VehiclePlan, state: StatePlan, entry: Vec3 | None) -> RestingPlace | None:
    """Return where the vehicle rests if nothing follows a behavior: below the end of the behavior's
    path. None if unknown."""
    footprint = state.footprint(entry)
    if footprint is None or footprint.exit is None:
        return None
    x, y, z = footprint.exit
    if _is_on_ground(state):
        start, own = vehicle.span_of("start", "at"), state.behavior.span
        return RestingPlace(footprint.exit, start if entry == vehicle.start else own)
    lands = any(leg.end is GROUND for leg in state.legs)
    return RestingPlace(footprint.exit if lands else (x, y, min(z, 0.0)), aim_of(state, footprint))


def _is_on_ground(state: StatePlan) -> bool:
    return all(leg == (GROUND, GROUND) for leg in state.legs)
