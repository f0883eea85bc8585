"""How the vehicles of a phase arrive: KYB530 to KYB532."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case, part_of
from kybflow.dsl.checks.flows import Assignment, assignments, phases
from kybflow.dsl.checks.reachability import endless_states
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import PhaseEntry, VehicleEntry
from kybflow.dsl.names.built_in import BUILT_IN
from kybflow.dsl.names.option_names import members
from kybflow.dsl.plan import Arrive

_TOGETHER: Arrive = "together"
_LASTING = frozenset({"hover", "landed"})
"""Built-in states that are not left by themselves, or after a long wait only."""


def nobody_to_wait_for(case: Case) -> Iterator[Diagnostic]:
    """KYB530: a phase says how its vehicles arrive, and runs fewer than two."""
    for phase, _ in case.cached(_arriving):
        assert phase.arrive is not None
        asked = {a.vehicle for a in assignments(case.document, phase.run)}
        is_known = all(members(case.document, who.text) for who, _ in phase.run)
        if len(asked) < 2 and is_known:
            who = "only " + "".join(f"`{name}`" for name in asked) if asked else "nobody"
            yield Diagnostic(
                "KYB530",
                f"`{phase.name.text}` runs {who}, who can't arrive `{phase.arrive.text}`",
                phase.arrive.span,
                label="needs two vehicles",
                help="leave it out, or name the others in `run`",
            )


def has_no_pace(case: Case) -> Iterator[Diagnostic]:
    """KYB531: vehicles are to arrive together, and one is asked for what can't keep a common pace.

    It must be one behavior that flies one straight line and knows how long it takes; a chain of
    behaviors is no such thing.
    """
    for phase, asked in case.cached(_arriving):
        assert phase.arrive is not None
        if phase.arrive.text != _TOGETHER:
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
                label=f"{what} is not one straight line",
                notes=(f"line {phase.arrive.span.line} says `arrive: {phase.arrive.text}`",),
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
        assert phase.arrive is not None
        if phase.arrive.text == _TOGETHER:
            continue
        for vehicle, goal, assignment in list(_asked(case, asked))[:-1]:
            if _lasts(vehicle, goal):
                yield Diagnostic(
                    "KYB532",
                    f"`{assignment.goal.text}` of `{assignment.vehicle}` never ends",
                    assignment.goal.span,
                    label="the others wait for it",
                    notes=(f"line {phase.arrive.span.line} says `arrive: {phase.arrive.text}`",),
                    help="give it an end, or a `next` that leaves it",
                )


def _lasts(vehicle: VehicleEntry, goal: str) -> bool:
    """Whether a state has no end and no way out but by a failure."""
    if goal not in vehicle.states:
        return goal in _LASTING
    ways = {transition.cause for transition in vehicle.states[goal].transitions}
    return goal in endless_states(vehicle) and ways.isdisjoint({"next", "within"})


def _arriving(case: Case) -> Iterator[tuple[PhaseEntry, list[Assignment]]]:
    """Every phase that says how its vehicles arrive, and what it asks of each."""
    for _, phase in phases(case.document):
        if phase.arrive is not None:
            yield phase, list(assignments(case.document, phase.run))


def _asked(case: Case, asked: list[Assignment]) -> Iterator[tuple[VehicleEntry, str, Assignment]]:
    """Each vehicle and the state that it is asked for, if it has it."""
    for assignment in asked:
        vehicle = case.document.vehicles[assignment.vehicle]
        goal = vehicle.goal(assignment.goal.text)
        if goal in vehicle.states or goal in BUILT_IN:
            yield vehicle, goal, assignment
