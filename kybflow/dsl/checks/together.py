"""Behaviors and processors that involve several vehicles: KYB510 and KYB520 to KYB523."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.core.params import named_in
from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.case import Case, contexts
from kybflow.dsl.diagnostics import Diagnostic, Severity, Span
from kybflow.dsl.names import no_vehicles
from kybflow.dsl.plan import StatePlan, VehiclePlan


class _Shared(NamedTuple):
    """A state that a vehicle flies together with a group. span: where the group is named."""

    vehicle: VehiclePlan
    state: StatePlan
    group: str
    span: Span


def _shared(case: Case) -> Iterator[_Shared]:
    for vehicle, state in case.states():
        for parameter, name in named_in(state.behavior.params, "group").items():
            yield _Shared(vehicle, state, name, state.behavior.span_of(parameter))


def unknown_companions(case: Case) -> Iterator[Diagnostic]:
    """KYB520: a behavior names a group or a vehicle that the mission does not have."""
    plan = case.plan
    for _, _, group, span in case.cached(_shared):
        if group not in plan.groups:
            hint = did_you_mean(group, plan.groups) if plan.groups else ""
            hint = hint or f"declare it: `groups: {{{group}: [a, b]}}`"
            message = f"the mission has no group `{group}`"
            yield Diagnostic("KYB520", message, span, label="unknown", help=hint)
    for _, state in case.states():
        yield from no_vehicles("KYB520", state.behavior, plan)


def unknown_obstacles(case: Case) -> Iterator[Diagnostic]:
    """KYB510: a processor names a vehicle to avoid that the mission does not have."""
    for vehicle in case.plan.vehicles:
        for use in vehicle.processors:
            yield from no_vehicles("KYB510", use, case.plan)


def no_member(case: Case) -> Iterator[Diagnostic]:
    """KYB521: a vehicle flies a behavior together with a group that it is not a member of."""
    for vehicle, state, group, span in case.cached(_shared):
        members = case.plan.groups.get(group)
        name = vehicle.name
        if members is not None and name not in members:
            yield Diagnostic(
                "KYB521",
                f"`{name}` flies `{state.name}` with `{group}` but is not in it",
                span,
                label=f"its members: {', '.join(f'`{member}`' for member in members)}",
                help=f"add `{name}` to the group, or name another group",
            )


def never_comes(case: Case) -> Iterator[Diagnostic]:
    """KYB522: a member of a group never flies the behavior that the group flies together, so the
    others would wait in vain."""
    shared, groups = case.cached(_shared), case.plan.groups
    fly = {(s.vehicle.name, s.state.behavior.name, s.group) for s in shared}
    lost = {s.vehicle.name for s in shared if s.group not in groups}
    for _, state, group, span in shared:
        part = state.behavior.name
        for member in groups.get(group, ()):
            known = member in case.plan.fleet and member not in lost
            if known and (member, part, group) not in fly:
                yield Diagnostic(
                    "KYB522",
                    f"`{member}` never flies `{part}` with `{group}`",
                    span,
                    label=f"`{state.name}` waits for it",
                    help=f"give `{member}` this behavior, or name a group without it",
                )


def at_odds(case: Case) -> Iterator[Diagnostic]:
    """KYB523: a behavior's parameters don't fit each other or its vehicle, such as a formation
    whose shape has too few places (a warning if they are only doubtful). Each behavior decides that
    for itself."""
    for vehicle, context in case.cached(contexts):
        for state in vehicle.states.values():
            for objection in state.behavior.cls.objections(state.behavior.params, context):
                severity = Severity.WARNING if objection.is_doubt else Severity.ERROR
                yield Diagnostic(
                    "KYB523",
                    f"`{objection.parameter}` of `{state.name}` {objection.reason}",
                    state.behavior.span_of(objection.parameter),
                    help=objection.hint,
                    severity=severity,
                )
