"""What can be proven of a mission before take-off: one family of checks a file, one function a
check, its code first in its docstring."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from kybflow.dsl.checks import arrows, conditions, data, links, space
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.document import Document

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
    conditions.conditions,
    conditions.health,
    conditions.expectations,
    data.chains_that_do_not_connect,
    data.missing_measurements,
    data.control_rates,
    space.starts_outside,
    space.starts_too_close,
    space.leaves_the_fence,
    space.too_fast,
    space.undecided,
)


def run_checks(document: Document, catalog: Catalog) -> list[Diagnostic]:
    """Everything that the checks find in `document`, in no order."""
    case = Case(document, catalog)
    return [finding for check in CHECKS for finding in check(case)]
