"""What can be proven of a mission before take-off: one family of checks a file, one function a
check, its code first in its docstring.

A check is found, not listed: it is every public function of a module here with the signature
`(case: Case) -> Iterator[Diagnostic]`. Only the compiler calls them.
"""

from __future__ import annotations

import functools
import importlib
import pkgutil
import re
from collections.abc import Callable, Container, Iterable, Iterator
from inspect import isfunction
from types import ModuleType
from typing import TYPE_CHECKING

from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnosed, Diagnostic
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.document import Document

if TYPE_CHECKING:
    from kybflow.parts.catalog import Catalog

CheckFunction = Callable[[Case], Iterator[Diagnostic]]
_SIGNATURE = {"case": "Case", "return": "Iterator[Diagnostic]"}
_NAMED = re.compile(r"`([^`]*)`")


@functools.cache
def checks() -> tuple[CheckFunction, ...]:
    """Every check, by module and in the order in which each module has them."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = (importlib.import_module(f"{__name__}.{name}") for name in names)
    return tuple(one for module in modules for one in checks_in(module))


def checks_in(module: ModuleType) -> Iterator[CheckFunction]:
    """The checks that a module defines."""
    for name, value in vars(module).items():
        if not isfunction(value) or name.startswith("_") or value.__module__ != module.__name__:
            continue
        if value.__annotations__ == _SIGNATURE:
            yield value


def check(document: Document, catalog: Catalog) -> Diagnosed[None]:
    """Everything that the checks find in `document`, in no order."""
    case = Case(document, catalog)
    findings = (finding for one in checks() for finding in one(case))
    yield from _deduplicated(findings, document.vehicles)


def _deduplicated(found: Iterable[Diagnostic], vehicles: Container[str]) -> list[Diagnostic]:
    """Report each mistake once: several vehicles may share it, and several paths may lead to it.
    The first finding is kept."""

    def blank(match: re.Match[str]) -> str:
        return "" if match[1] in vehicles else match[0]

    first: dict[tuple[str, Span, str], Diagnostic] = {}
    for finding in found:
        message = _NAMED.sub(blank, finding.message)
        first.setdefault((finding.code, finding.span, message), finding)
    return list(first.values())
