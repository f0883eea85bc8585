"""Checks how the vehicles of a phase arrive (`arrive`): KYB530 to KYB532."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.dsl.checks.case import Case, part_of
from kybflow.dsl.checks.flows import Assignment, assignments, phases
from kybflow.dsl.checks.reachability import endless_states
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import Arrive, PhasePlan, VehiclePlan

_TOGETHER: Arrive = "together"
_LASTING = frozenset({"hover", "landed"})
"""Built-in states that don't end by themselves, or only after a long wait."""


class _Arriving(NamedTuple):
    """A phase with `arrive`, and its requests to the vehicles."""

    phase: PhasePlan
    asked: list[Assignment]


def nobody_to_wait_for(case: Case) -> Iterator[Diagnostic]:
    """KYB530: a phase has `arrive` but runs fewer than two vehicles.

    Phases inherited through `like` are exempt: a template is for groups of any size.
    """
    for phase, asked in case.cached(_arriving):
        vehicles = {assignment.vehicle for assignment in asked}
        is_known = all(case.plan.members(who) for who in phase.run)
        if len(vehicles) < 2 and is_known and not phase.inherited:
            who = "only " + "".join(f"`{name}`" for name in vehicles) if vehicles else "no vehicle"
            yield Diagnostic(
                "KYB530",
                f"`{phase.name}` runs {who}, so `arrive: {phase.arrive}` has no effect",
                phase.span_of("arrive"),
                label="needs at least two vehicles",
                help="remove it, or add the other vehicles to `run`",
            )


def has_no_pace(case: Case) -> Iterator[Diagnostic]:
    """KYB531: vehicles are to arrive together, but one of them runs something that can't keep a
    common pace.

    Each must run a single behavior that flies one straight line and knows its duration. A chain of
    behaviors can't.
    """
    for phase, asked in case.cached(_arriving):
        if phase.arrive != _TOGETHER:
            continue
        for vehicle, goal, assignment in _asked(case, asked):
            cls = case.behavior(vehicle, goal)
            is_chain = goal != assignment.goal.text
            if cls is None or (cls.keeps_pace and not is_chain):
                continue
            what = "a chain" if is_chain else f"`{part_of(vehicle, goal)}`"
            paced = (f"`{s.name}`" for s in case.parts("behaviors") if s.cls.keeps_pace)
            yield Diagnostic(
                "KYB531",
                f"`{assignment.goal.text}` of `{assignment.vehicle}` can't keep a common pace",
                assignment.goal.span,
                label=f"{what} has no pace to adjust",
                notes=(_said(phase, assignment),),
                help=f"use {' or '.join(paced)}, or write `arrive: in_turns`",
            )


def never_passes_its_turn(case: Case) -> Iterator[Diagnostic]:
    """KYB532: vehicles are to arrive in turns, but one of them runs something that never ends, so
    the vehicles behind it would wait forever.

    A vehicle's turn ends when it leaves the state, or the chain, that the phase runs.
    """
    for phase, asked in case.cached(_arriving):
        if phase.arrive == _TOGETHER:
            continue
        for vehicle, goal, assignment in list(_asked(case, asked))[:-1]:
            if _lasts(vehicle, goal):
                yield Diagnostic(
                    "KYB532",
                    f"`{assignment.goal.text}` of `{assignment.vehicle}` never ends",
                    assignment.goal.span,
                    label="the vehicles behind it wait forever",
                    notes=(_said(phase, assignment),),
                    help="give it an end, or add a `next` that leaves it",
                )


def _lasts(vehicle: VehiclePlan, goal: str) -> bool:
    """Return whether a vehicle leaves a state only when its behavior fails."""
    if goal not in vehicle.states:
        return goal in _LASTING
    ways = {transition.cause for transition in vehicle.states[goal].transitions}
    return goal in endless_states(vehicle) and ways.isdisjoint({"next", "within"})


def _said(phase: PhasePlan, assignment: Assignment) -> str:
    at = phase.span_of("arrive").beside(assignment.goal.span)
    return f"{at} says `arrive: {phase.arrive}`"


def _arriving(case: Case) -> Iterator[_Arriving]:
    for _, phase in phases(case.plan):
        if phase.arrive is not None:
            yield _Arriving(phase, list(assignments(case.plan, phase, "run")))


def _asked(case: Case, asked: list[Assignment]) -> Iterator[tuple[VehiclePlan, str, Assignment]]:
    """Yield (vehicle, state, request) for each vehicle that has the state that the phase runs."""
    for assignment in asked:
        vehicle = case.plan.fleet[assignment.vehicle]
        goal = vehicle.goal(assignment.goal.text)
        if goal in vehicle.states or goal in BUILT_IN:
            yield vehicle, goal, assignment
