"""Behaviors and processors that involve several vehicles: KYB510 and KYB520 to KYB524."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.core.params import named_in
from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.case import Case, contexts, objected
from kybflow.dsl.checks.flows import phases, runs_of
from kybflow.dsl.checks.space import own_place
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity, Span
from kybflow.dsl.names import no_vehicles
from kybflow.dsl.plan import PartPlan, StatePlan, VehiclePlan


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
    """KYB522: a member of a group never flies the behavior that the group flies together, or only
    with other values of parameters that must be equal, such as the shape of a formation. The others
    would wait in vain."""
    shared, groups = case.cached(_shared), case.plan.groups
    flown: dict[tuple[str, str], dict[str, dict[object, StatePlan]]] = {}
    for vehicle, state, group, _ in shared:
        members = flown.setdefault((state.behavior.name, group), {})
        members.setdefault(vehicle.name, {}).setdefault(_agreed(state.behavior), state)
    lost = {s.vehicle.name for s in shared if s.group not in groups}
    for vehicle, state, group, span in shared:
        part, own = state.behavior.name, _agreed(state.behavior)
        team = [m for m in groups.get(group, ()) if m in case.plan.fleet and m not in lost]
        states = flown[part, group]
        for member in team:
            if member not in states:
                yield Diagnostic(
                    "KYB522",
                    f"`{member}` never flies `{part}` with `{group}`",
                    span,
                    label=f"`{state.name}` waits for it",
                    help=f"give `{member}` this behavior, or name a group without it",
                )
        alike = [m for m in team if own in states.get(m, ())]
        others = [s for m in team if m not in alike for s in states.get(m, {}).values()]
        is_odd = 0 < 2 * len(alike) < len(team) + (team[0] not in alike)
        if others and is_odd and vehicle.name in alike:
            other = next((s for s in others if s.name == state.name), others[0])
            apart = _differing(state.behavior, other.behavior)
            name = next((n for n in apart if state.behavior.is_written(n)), apart[0])
            yield Diagnostic(
                "KYB522",
                f"`{state.name}` of `{vehicle.name}` is another `{part}` than that of the others",
                own_place(vehicle, state.behavior.span_of(name), other.behavior.span_of(name)),
                label=f"they have another `{name}`",
                help="give all members the same values",
                related=(Related(other.behavior.span_of(name), f"the others' `{name}`"),),
            )


def _agreed(part: PartPlan) -> tuple[object, ...]:
    """Return the values that all who fly a behavior together must have."""
    return tuple([getattr(part.params, name) for name in part.cls.agreed])


def _differing(one: PartPlan, other: PartPlan) -> list[str]:
    """Return the parameters that must agree and have other values in `other`."""
    agreed: tuple[str, ...] = one.cls.agreed
    return [n for n in agreed if getattr(one.params, n) != getattr(other.params, n)]


def at_each_other(case: Case) -> Iterator[Diagnostic]:
    """KYB524: vehicles follow each other in a circle, so that none leads and they may fly away
    together. It is an error if a phase lets them fly so at the same time, otherwise a warning."""
    follows: dict[tuple[str, str], tuple[str, Span]] = {}
    for vehicle, state in case.states():
        part = state.behavior
        for parameter, name in named_in(part.params, "vehicle").items() if part.cls.hears else ():
            span = part.span_of(parameter)
            follows[vehicle.name, state.name] = name, span
    if len({leader for leader, _ in follows.values()}) < 2:
        return
    told = set[frozenset[str]]()
    for _, phase in phases(case.plan):
        asked = (key for key in runs_of(case, phase).items() if key in follows)
        own = {key[0]: follows[key] for key in asked}
        yield from _circles(own, told, Severity.ERROR)
    every = dict[str, tuple[str, Span]]()
    for (name, _), one in follows.items():
        every.setdefault(name, one)
    yield from _circles(every, told, Severity.WARNING)


def _circles(
    own: dict[str, tuple[str, Span]], told: set[frozenset[str]], severity: Severity
) -> Iterator[Diagnostic]:
    """Yield a finding for each circle in `own`, which has the leader of each vehicle. told: the
    circles that are reported already."""
    for first in own:
        path = [first]
        while (leader := own.get(path[-1], ("",))[0]) in own and leader not in path:
            path.append(leader)
        circle = frozenset(path)
        if leader == first and len(path) > 1 and circle not in told:
            told.add(circle)
            names = " → ".join(f"`{name}`" for name in (*path, first))
            yield Diagnostic(
                "KYB524",
                "vehicles follow each other in a circle",
                own[path[-1]][1],
                label=names,
                help="let one of them lead",
                severity=severity,
            )


def at_odds(case: Case) -> Iterator[Diagnostic]:
    """KYB523: a behavior's parameters don't fit each other or its vehicle, such as a formation
    whose shape has too few places (a warning if they are only doubtful). Each behavior decides that
    for itself."""
    for vehicle, context in case.cached(contexts):
        for state in vehicle.states.values():
            for objection in state.behavior.cls.objections(state.behavior.params, context):
                yield objected("KYB523", state.name, state.behavior, objection)
