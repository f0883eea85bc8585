"""Several vehicles together: whom their behaviors and processors name, and what they can't do:
KYB510 and KYB520 to KYB523."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.core.params import named_in
from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.contexts import contexts
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.plan import StatePlan, VehiclePlan
from kybflow.dsl.names.option_names import no_vehicles


class _Shared(NamedTuple):
    """A state that a vehicle flies together with a group, and the group as it is written."""

    vehicle: VehiclePlan
    state: StatePlan
    group: Text


def _shared(case: Case) -> Iterator[_Shared]:
    for vehicle, state in case.states():
        for parameter, name in named_in(state.behavior.params, "group").items():
            span = state.part.spans.get(parameter, state.behavior.span)
            yield _Shared(vehicle, state, Text(name, span))


def unknown_companions(case: Case) -> Iterator[Diagnostic]:
    """KYB520: a behavior names a group or a vehicle that the mission does not have."""
    plan = case.plan
    for _, _, group in case.cached(_shared):
        if group.text not in plan.groups:
            hint = did_you_mean(group.text, plan.groups) if plan.groups else ""
            hint = hint or f"declare it: `groups: {{{group.text}: [a, b]}}`"
            message = f"the mission has no group `{group.text}`"
            yield Diagnostic("KYB520", message, group.span, label="unknown", help=hint)
    for _, state in case.states():
        yield from no_vehicles("KYB520", state.part, plan)


def unknown_obstacles(case: Case) -> Iterator[Diagnostic]:
    """KYB510: a processor keeps its vehicle away from one that isn't there."""
    for vehicle in case.plan.vehicles:
        for use in vehicle.processors:
            yield from no_vehicles("KYB510", use, case.plan)


def no_member(case: Case) -> Iterator[Diagnostic]:
    """KYB521: a behavior is flown together with a group in which its vehicle is not."""
    for vehicle, state, group in case.cached(_shared):
        members = case.plan.groups.get(group.text)
        name = vehicle.name
        if members is not None and name not in {m.text for m in members}:
            yield Diagnostic(
                "KYB521",
                f"`{name}` is not in `{group.text}`, with which it flies `{state.name}`",
                group.span,
                label=f"has {', '.join(f'`{m.text}`' for m in members)}",
                help=f"add `{name}` to the group, or name one that it is in",
            )


def never_comes(case: Case) -> Iterator[Diagnostic]:
    """KYB522: a behavior is flown together with a group of which a member never flies it: the
    others would wait for it in vain."""
    shared, groups = case.cached(_shared), case.plan.groups
    fly = {(s.vehicle.name, s.state.behavior.name, s.group.text) for s in shared}
    lost = {s.vehicle.name for s in shared if s.group.text not in groups}
    for _, state, group in shared:
        part = state.behavior.name
        for member in groups.get(group.text, ()):
            known = member.text in case.plan.vehicles and member.text not in lost
            if known and (member.text, part, group.text) not in fly:
                yield Diagnostic(
                    "KYB522",
                    f"`{member.text}` never flies `{part}` with `{group.text}`",
                    group.span,
                    label=f"`{state.name}` waits for it",
                    help=f"give `{member.text}` such a behavior, or name a group without it",
                )


def at_odds(case: Case) -> Iterator[Diagnostic]:
    """KYB523: a behavior's parameters don't fit each other or its vehicle, as of a formation whose
    shape has no places for so many; a warning where they only hardly fit. Each part says so of
    itself."""
    for vehicle, context in case.cached(contexts):
        for state in vehicle.states.values():
            for objection in state.behavior.cls.objections(state.behavior.params, context):
                severity = Severity.WARNING if objection.is_doubt else Severity.ERROR
                yield Diagnostic(
                    "KYB523",
                    f"`{objection.parameter}` of `{state.name}` {objection.reason}",
                    state.part.spans.get(objection.parameter, state.behavior.span),
                    help=objection.hint,
                    severity=severity,
                )
