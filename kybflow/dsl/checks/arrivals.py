"""How the vehicles of a phase arrive: KYB530 to KYB532."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.dsl.checks.case import Case, part_of
from kybflow.dsl.checks.flows import Assignment, assignments, phases
from kybflow.dsl.checks.reachability import endless_states
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.plan import Arrive, PhasePlan, VehiclePlan

_TOGETHER: Arrive = "together"
_LASTING = frozenset({"hover", "landed"})
"""Built-in states that are not left by themselves, or after a long wait only."""


class _Arriving(NamedTuple):
    """A phase that says how its vehicles arrive, and what it asks of each."""

    phase: PhasePlan
    asked: list[Assignment]


def nobody_to_wait_for(case: Case) -> Iterator[Diagnostic]:
    """KYB530: a phase says how its vehicles arrive, and runs fewer than two.

    Phases that came through `like` are excepted: a template is for groups of any size.
    """
    for phase, asked in case.cached(_arriving):
        vehicles = {assignment.vehicle for assignment in asked}
        is_known = all(case.plan.members(who) for who in phase.run)
        if len(vehicles) < 2 and is_known and not phase.inherited:
            who = "only " + "".join(f"`{name}`" for name in vehicles) if vehicles else "nobody"
            yield Diagnostic(
                "KYB530",
                f"`{phase.name}` runs {who}, who can't arrive `{phase.arrive}`",
                phase.span_of("arrive"),
                label="needs two vehicles",
                help="leave it out, or name the others in `run`",
            )


def has_no_pace(case: Case) -> Iterator[Diagnostic]:
    """KYB531: vehicles are to arrive together, and one is asked for what can't keep a common pace.

    It must be one behavior that flies one straight line and knows how long it takes; a chain of
    behaviors is no such thing.
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
            yield Diagnostic(
                "KYB531",
                f"`{assignment.goal.text}` of `{assignment.vehicle}` can't keep a common pace",
                assignment.goal.span,
                label=f"{what} keeps none",
                notes=(_said(phase, assignment),),
                help=f"use {_paced(case)}, or say `arrive: in_turns`",
            )


def _paced(case: Case) -> str:
    """The behaviors that keep a common pace, in words."""
    return " or ".join(f"`{spec.name}`" for spec in case.parts("behaviors") if spec.cls.keeps_pace)


def never_passes_its_turn(case: Case) -> Iterator[Diagnostic]:
    """KYB532: vehicles are to arrive in turns, and one is asked for what never ends: those behind
    it would wait in vain.

    A turn passes when the vehicle leaves the state, or the chain, that it was asked for.
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
                    label="the others wait for it",
                    notes=(_said(phase, assignment),),
                    help="give it an end, or a `next` that leaves it",
                )


def _lasts(vehicle: VehiclePlan, goal: str) -> bool:
    """Whether a state has no end and no way out but by a failure."""
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
    """Each vehicle and the state that it is asked for, if it has it."""
    for assignment in asked:
        vehicle = case.plan.fleet[assignment.vehicle]
        goal = vehicle.goal(assignment.goal.text)
        if goal in vehicle.states or goal in BUILT_IN:
            yield vehicle, goal, assignment
