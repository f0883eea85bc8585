"""A diagnostic is a value: a code, one short sentence, a span, notes and one hint. `render` turns
it into text."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from kybflow.dsl.diagnostics.spans import Span
from kybflow.parts.observables import chains_of


class Severity(Enum):
    ERROR = "error"
    WARNING = "warning"


class Related(NamedTuple):
    """Another location that is relevant to a finding. label: its role there, such as the fence that
    a path leaves, or the default of a parameter."""

    span: Span
    label: str


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One finding. label: the text written under the marked source. related, notes, help: further
    locations, remarks and a hint, one line each below it."""

    code: str
    message: str
    span: Span
    label: str = ""
    notes: tuple[str, ...] = ()
    help: str = ""
    severity: Severity = Severity.ERROR
    related: tuple[Related, ...] = ()

    @property
    def order(self) -> tuple[str, int, int, str]:
        return (self.span.file, self.span.line, self.span.column, self.code)


class Stopped(Exception):
    """Ends the compilation after a pass with errors."""


class Findings:
    """Collects the findings of a pass."""

    def __init__(self) -> None:
        self.all: list[Diagnostic] = []

    def report(
        self,
        code: str,
        message: str,
        span: Span,
        label: str = "",
        notes: tuple[str, ...] = (),
        help: str = "",
        related: tuple[Related, ...] = (),
        severity: Severity = Severity.ERROR,
    ) -> None:
        """Report an error."""
        self.all.append(Diagnostic(code, message, span, label, notes, help, severity, related))

    def warn(self, code: str, message: str, span: Span, help: str = "") -> None:
        """Report a warning."""
        self.report(code, message, span, help=help, severity=Severity.WARNING)

    def add(self, findings: Iterable[Diagnostic] | Diagnostic) -> None:
        """Add findings that were collected elsewhere, such as by a check or when a file was
        read."""
        self.all += [findings] if isinstance(findings, Diagnostic) else findings

    @property
    def has_errors(self) -> bool:
        return has_errors(self.all)

    def stop_if_errors(self) -> None:
        """Raise Stopped if there are errors."""
        if self.has_errors:
            raise Stopped


def in_order(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return each finding once, sorted by location. Of equal findings from several uses of a chain,
    the first is kept."""
    first: dict[tuple[object, ...], Diagnostic] = {}
    for diagnostic in diagnostics:
        first.setdefault((*diagnostic.order, diagnostic.message), diagnostic)
    return tuple(sorted(first.values(), key=lambda d: d.order))


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    return any(d.severity is Severity.ERROR for d in diagnostics)


def goals_like(name: str, states: Iterable[str]) -> list[str]:
    """Return the states and chains that `name` could have been meant for. If `name` has no dot, a
    chain stands for all its states."""
    if "." in name:
        return list(dict.fromkeys(own for s in states for own in (*chains_of(s), s)))
    return list(dict.fromkeys([state.partition(".")[0] for state in states]))
