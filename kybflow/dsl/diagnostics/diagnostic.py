"""A diagnostic is a value: a code, one terse sentence, a span, notes and one help line. Rendering
lives elsewhere."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum

from kybflow.dsl.reading.source import Span
from kybflow.parts.observables import chains_of


class Severity(Enum):
    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One finding. `label` is written under the marked text, `notes` and `help` below it, one line
    each."""

    code: str
    message: str
    span: Span
    label: str = ""
    notes: tuple[str, ...] = ()
    help: str = ""
    severity: Severity = Severity.ERROR

    @property
    def order(self) -> tuple[str, int, int, str]:
        return (self.span.file, self.span.line, self.span.column, self.code)


def in_order(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Each finding once, sorted by place: what every use of a chain gets wrong is told for the
    first."""
    first: dict[tuple[object, ...], Diagnostic] = {}
    for diagnostic in diagnostics:
        first.setdefault((*diagnostic.order, diagnostic.message), diagnostic)
    return tuple(sorted(first.values(), key=lambda d: d.order))


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    return any(d.severity is Severity.ERROR for d in diagnostics)


_LONGEST = 80
_COMPARED = 300
"""Comparing a name with thousands of others, thousands of times, would never end."""


def _around(names: list[str], place: int) -> list[str]:
    if len(names) <= _COMPARED:
        return names
    return names[max(0, place - _COMPARED // 2) : place + _COMPARED // 2]


def goals_like(name: str, states: Iterable[str]) -> list[str]:
    """The states that could be meant by `name`: a chain's name stands for those inside of it,
    unless `name` speaks of one."""
    if "." in name:
        return list(dict.fromkeys(own for s in states for own in (*chains_of(s), s)))
    return list(dict.fromkeys([state.partition(".")[0] for state in states]))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The help line for an unknown name: the nearest known one, or all of them when none is near
    and they are few."""
    names = sorted(set(known))
    place = bisect(names, name)
    near = get_close_matches(name[:_LONGEST], _around(names, place), n=1, cutoff=0.6)
    if near:
        return f"did you mean `{near[0]}`?"
    if not names:
        return ""
    shown = ", ".join(f"`{n}`" for n in names[:12])
    return f"known here: {shown}{', ...' if len(names) > 12 else ''}"
