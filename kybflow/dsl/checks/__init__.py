"""What can be proven of a mission before take-off: one family of checks a file, one function a
check, its code first in its docstring."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator
from typing import TYPE_CHECKING

from kybflow.dsl.checks import arrows, conditions, data, events, limits, links, space
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.document import Document
from kybflow.dsl.source import Span

if TYPE_CHECKING:
    from kybflow.catalog import Catalog

CHECKS: tuple[Callable[[Case], Iterator[Diagnostic]], ...] = (
    links.unknown_targets,
    links.begins_in_the_air,
    links.ends_that_do_not_meet,
    links.unreachable_states,
    links.never_lands,
    arrows.never_fires,
    arrows.reserved_names,
    events.unknown_events,
    conditions.conditions,
    conditions.health,
    conditions.expectations,
    data.chains_that_do_not_connect,
    data.missing_measurements,
    data.nothing_to_fly_by,
    data.control_rates,
    space.starts_outside,
    space.starts_too_close,
    space.leaves_the_fence,
    space.held_back,
    space.unfenced,
    space.too_fast,
    space.undecided,
    limits.beyond_the_airframe,
    limits.too_steep,
    limits.too_heavy,
    limits.no_rigid_body,
)
_NAMED = re.compile(r"`([^`]*)`")


def run_checks(document: Document, catalog: Catalog) -> list[Diagnostic]:
    """Everything that the checks find in `document`, in no order."""
    case = Case(document, catalog)
    return _once((finding for check in CHECKS for finding in check(case)), document.vehicles)


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
