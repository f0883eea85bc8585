"""What can be proven of a mission before take-off: one family of checks a file, one function a
check, its code first in its docstring."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator
from typing import TYPE_CHECKING

from kybflow.dsl.checks import (
    actions,
    arrows,
    callbacks,
    certain,
    circles,
    conditions,
    data,
    driving,
    entering,
    events,
    fallback,
    faults,
    fences,
    flows,
    groups,
    limits,
    links,
    measured,
    obstacles,
    payload,
    proof,
    resting,
    sensors,
    space,
    tag_units,
    tags,
)
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic
from kybflow.dsl.document import Document
from kybflow.dsl.reading.source import Span

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CHECKS: tuple[Callable[[Case], Iterator[Diagnostic]], ...] = (
    links.unknown_targets,
    links.begins_in_the_air,
    links.ends_that_do_not_meet,
    links.unreachable_states,
    proof.never_lands,
    proof.comes_down_by_chance,
    proof.failures_that_circle,
    arrows.never_fires,
    arrows.reserved_names,
    events.unknown_events,
    events.of_the_simulator,
    callbacks.filters,
    callbacks.emitted_names,
    callbacks.phases,
    callbacks.logged_fields,
    circles.circles,
    actions.switches,
    actions.options,
    actions.loosened,
    actions.switched_off,
    conditions.conditions,
    conditions.callback_conditions,
    conditions.health,
    faults.unknown_vehicles,
    faults.not_simulated,
    faults.too_late,
    faults.twice,
    faults.itself,
    faults.unknown_estimators,
    faults.of_no_effect,
    faults.conditions,
    conditions.expectations,
    certain.never_true,
    certain.always_true,
    certain.after_the_end,
    measured.never_entered,
    measured.not_measured,
    fallback.never_used,
    fallback.alone_for_a_time,
    fallback.never_begins,
    fallback.unknown_first,
    fallback.first_twice,
    groups.groups,
    flows.flow_names,
    flows.phase_targets,
    flows.phase_states,
    flows.phase_arrows,
    flows.unreachable_phases,
    flows.barriers,
    flows.timeless_circles,
    flows.phase_conditions,
    arrows.phases_never_left,
    driving.two_drivers,
    driving.not_driven,
    driving.asked_twice,
    entering.can_not_enter,
    data.chains_that_do_not_connect,
    data.missing_measurements,
    data.drivers_not_as_told,
    sensors.of_no_use,
    sensors.not_simulated,
    sensors.not_as_told,
    sensors.two_of_the_same,
    sensors.nothing_to_see_with,
    sensors.nothing_to_see,
    data.nothing_to_fly_by,
    data.control_rates,
    space.starts_outside,
    space.starts_too_close,
    space.leaves_the_fence,
    space.held_back,
    fences.unfenced,
    fences.without_a_fence,
    space.too_fast,
    space.refuses,
    space.undecided,
    obstacles.starts_inside,
    obstacles.starts_in_the_air,
    obstacles.flies_into,
    obstacles.may_fly_into,
    obstacles.homes,
    resting.rest_in_one_place,
    tags.same_tag_twice,
    tags.tags_that_overlap,
    tag_units.in_another_unit,
    limits.beyond_the_airframe,
    limits.too_steep,
    limits.too_heavy,
    limits.no_rigid_body,
    payload.nothing_to_hold,
    payload.no_servo,
    payload.too_heavy_to_lift,
)
_NAMED = re.compile(r"`([^`]*)`")


def check(document: Document, catalog: Catalog) -> Diagnosed[None]:
    """Everything that the checks find in `document`, in no order."""
    case = Case(document, catalog)
    findings = (finding for one in CHECKS for finding in one(case))
    yield from _once(findings, document.vehicles)


def _once(found: Iterable[Diagnostic], vehicles: Container[str]) -> list[Diagnostic]:
    """One mistake, one report: what several vehicles share, and what one place means for several
    ways into it, is told for the first."""

    def blank(match: re.Match[str]) -> str:
        return "" if match[1] in vehicles else match[0]

    first: dict[tuple[str, Span, str], Diagnostic] = {}
    for finding in found:
        message = _NAMED.sub(blank, finding.message)
        first.setdefault((finding.code, finding.span, message), finding)
    return list(first.values())
