"""A diagnostic is a value: a code, one terse sentence, a span, notes and one help line. Rendering
lives elsewhere."""

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
    """Another place that has a part in a finding, and what it is to it: the fence that a way
    leaves, the default of a parameter."""

    span: Span
    label: str


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One finding. `label` is written under the marked text; `related` places, `notes` and `help`
    below it, one line each."""

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
    """The sink of a pass: what reads a value reports here and returns its value."""

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
        """Report what was found elsewhere: by a check, in a file that was read before."""
        self.all += [findings] if isinstance(findings, Diagnostic) else findings

    @property
    def has_errors(self) -> bool:
        return has_errors(self.all)

    def stop_if_errors(self) -> None:
        """End the compilation here where there are errors. Raises Stopped."""
        if self.has_errors:
            raise Stopped


def in_order(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Each finding once, sorted by place. Where every use of a chain gets the same wrong, the
    first finding is kept."""
    first: dict[tuple[object, ...], Diagnostic] = {}
    for diagnostic in diagnostics:
        first.setdefault((*diagnostic.order, diagnostic.message), diagnostic)
    return tuple(sorted(first.values(), key=lambda d: d.order))


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    return any(d.severity is Severity.ERROR for d in diagnostics)


def goals_like(name: str, states: Iterable[str]) -> list[str]:
    """The states that could be meant by `name`: a chain's name stands for those inside of it,
    unless `name` speaks of one."""
    if "." in name:
        return list(dict.fromkeys(own for s in states for own in (*chains_of(s), s)))
    return list(dict.fromkeys([state.partition(".")[0] for state in states]))
