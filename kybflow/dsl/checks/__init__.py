"""Checks of a mission before take-off: one module per family, one function per check. A check's
docstring begins with the code that it reports.

Checks are discovered, not listed: every public function of a module here with the signature `(case:
Case) -> Iterator[Diagnostic]` is a check. Only the compiler calls them.
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from inspect import isfunction
from itertools import chain
from types import ModuleType
from typing import TYPE_CHECKING

from kybflow.dsl.checks.actions import sets_of
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Collector, Diagnostic, Span
from kybflow.dsl.expanding.flows import entered_states, valued_requests, with_options
from kybflow.dsl.names import option_values
from kybflow.dsl.plan import Plan

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CheckFunction = Callable[[Case], Iterator[Diagnostic]]
_SIGNATURE = {"case": "Case", "return": "Iterator[Diagnostic]"}
_NAMED = re.compile(r"`([^`]*)`")


@functools.cache
def checks() -> tuple[CheckFunction, ...]:
    """Return all checks, ordered by module and by position in the module."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = (importlib.import_module(f"{__name__}.{name}") for name in names)
    return tuple(one for module in modules for one in checks_in(module))


def checks_in(module: ModuleType) -> Iterator[CheckFunction]:
    """Yield the checks that a module defines."""
    for name, value in vars(module).items():
        if not isfunction(value) or name.startswith("_") or value.__module__ != module.__name__:
            continue
        if value.__annotations__ == _SIGNATURE:
            yield value


def check(plan: Plan, catalog: Catalog) -> list[Diagnostic]:
    """Return all findings of the checks in `plan`, in no particular order."""

    def blank(match: re.Match[str]) -> str:
        return "" if match[1] in plan.fleet else match[0]

    # several vehicles may share a mistake, and several paths may lead to it: the first is kept
    first: dict[tuple[str, Span, str], Diagnostic] = {}
    case = Case(plan, catalog)
    for finding in chain(_found(case), _found_with_values(plan, catalog), _found_at_sets(case)):
        message = _NAMED.sub(blank, finding.message)
        first.setdefault((finding.code, finding.span, message), finding)
    return list(first.values())


def _found(case: Case) -> Iterator[Diagnostic]:
    return (finding for one in checks() for finding in one(case))


def _found_with_values(plan: Plan, catalog: Catalog) -> Iterator[Diagnostic]:
    """Yield the findings about requests with values. For each request, the mission is checked with
    these values in place of those of the entered state. `check` later drops the findings that the
    mission also has without them."""
    for asked in valued_requests(plan):
        entered = dict(entered_states(plan, asked))
        if not entered:
            continue
        vehicles = {
            name: plan.fleet[name].but(states={**plan.fleet[name].states, state.name: state})
            for name, state in entered.items()
        }
        source = asked.request.source
        note = f"with the values at {source.span.at}"
        for finding in _found(Case(plan.with_vehicles(vehicles), catalog)):
            is_there = finding.span.is_in(source.node.span)
            yield finding if is_there else replace(finding, notes=(*finding.notes, note))


def _found_at_sets(case: Case) -> Iterator[Diagnostic]:
    """Yield the findings about the values of options that callbacks and flows set. For each, the
    mission is checked as if the value were written where the part is declared; what is then found
    elsewhere than at this value is left out, because the option doesn't have it from the start."""
    for name, node in sets_of(case):
        values = option_values(name, node, case.plan, case.catalog, Collector())
        options = ((*option.place, option.field, value) for option, value in values)
        changed = with_options(case.plan, options, node)
        if changed is not None:
            found = _found(Case(changed, case.catalog))
            yield from (one for one in found if one.span.is_in(node.span))
