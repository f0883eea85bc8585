"""Coordinators of phases: what they object to, and pushes that none of them serves: KYB588 and
KYB589."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case, contexts, objected
from kybflow.dsl.checks.flows import phases, runs_of
from kybflow.dsl.diagnostics import Diagnostic


def coordinators_at_odds(case: Case) -> Iterator[Diagnostic]:
    """KYB588: a phase's coordinator can't work as written, or probably not as intended (a warning).

    It names an object that doesn't exist or a goal to which the object can't move, or the phase
    runs no vehicle. A warning: the object creeps along a slide whose friction is less than what
    pushes it while it is turned.
    """
    for _, phase in phases(case.plan):
        part = phase.coordinator
        if part is None:
            continue
        ran = runs_of(case, phase)
        team = {v.name: context for v, context in case.cached(contexts) if v.name in ran}
        if not team:
            message = f"the coordinator of `{phase.name}` has no vehicles"
            hint = "write `run: {VEHICLE: BEHAVIOR}` in the phase"
            yield Diagnostic("KYB588", message, part.span, help=hint)
            continue
        for objection in part.cls.objections(part.params, team):
            yield objected("KYB588", part.name, part, objection)


def pushes_without_force(case: Case) -> Iterator[Diagnostic]:
    """KYB589: a behavior pushes with a force that no coordinator gives: it has no `force`, and no
    phase with a coordinator runs its vehicle."""
    if not case.plan.objects:
        return
    coordinated = {
        name
        for _, phase in phases(case.plan)
        if phase.coordinator is not None
        for name in runs_of(case, phase)
    }
    for vehicle, state in case.states():
        pushed = state.behavior.cls.pushes(state.behavior.params)
        if pushed is not None and pushed[1] is None and vehicle.name not in coordinated:
            yield Diagnostic(
                "KYB589",
                f"`{state.name}` has no force",
                state.behavior.span,
                help=f"write `force: 0.3 N`, or let a phase with a `coordinator` run "
                f"`{vehicle.name}`",
            )
