"""Diagnostics: the spans of text that they mark, their messages, and their rendering for people and
programs.

A diagnostic is a value: a code, one short sentence, a span, notes and one hint. A span says where a
piece of text was written, and is kept through imports, `like` and parameters. Colours are added by
the command line. All other parts of the compiler report diagnostics; this module reports none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import Any, NamedTuple

from kybflow.parts.observables import chains_of

PREFIX = "world.points."
"""The prefix of the name of a point of the world."""
SET = "--set"
"""The file name in the spans of settings; each setting is one line of that file."""


class Span(NamedTuple):
    """A range of text in a file. Lines and columns count from 1; the end is just after the last
    character.

    via: the spans of the imports through which the file was reached, outermost first. used: the
    spans of the uses of the chain or flow that contains the text, outermost first. given: where the
    value that replaced a `$name` at this location was written. is_set: whether a file or `--set`
    sets that value, in contrast to a default. Comparisons of spans ignore `given` and `is_set`.
    """

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    via: tuple[Span, ...] = ()
    used: tuple[Span, ...] = ()
    given: Span | None = None
    is_set: bool = False

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Span) and self[:_COMPARED] == other[:_COMPARED]

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __hash__(self) -> int:
        return hash(self[:5])  # not `via` and `used`, whose spans contain further ones

    @property
    def value(self) -> Span | None:
        """Where a user wrote the value that replaced a `$name` of a chain or library here; None if
        the value is a default, or is written in this text itself."""
        given = self.given
        if given is None or not self.is_set or (given.file == self.file and not self.used):
            return None
        return given

    @property
    def at(self) -> str:
        """The location as `file:line`, for events and plans."""
        return f"{self.file}:{self.line}"

    def is_in(self, around: Span) -> bool:
        """Return whether the span lies entirely within `around`."""
        begins = (around.line, around.column) <= (self.line, self.column)
        ends = (self.end_line, self.end_column) <= (around.end_line, around.end_column)
        return self.file == around.file and begins and ends

    def beside(self, other: Span) -> str:
        """Return the location as shown in a report about `other`: the line, preceded by the file if
        it is another one."""
        return f"line {self.line}" if self.file == other.file else self.at


_COMPARED = Span._fields.index("given")


class Inset(NamedTuple):
    """A value that replaced a parameter in a text. start, end: the characters of the value in the
    text. written_start, written_end: the characters of `$name` in the text as written. given: where
    the value was written."""

    start: int
    end: int
    written_start: int
    written_end: int
    given: Span | None = None


class Text(NamedTuple):
    """The text of a scalar, with its span. verbatim: whether the columns of characters inside it
    can be computed (the text is in one line and without escapes). written: the text as its author
    wrote it, if parameters in it were replaced. insets: the values of these parameters."""

    text: str
    span: Span
    verbatim: bool = True
    written: str = ""
    insets: tuple[Inset, ...] = ()

    @property
    def as_written(self) -> str:
        """The text as its author wrote it, with `$name` not replaced."""
        return self.written or self.text

    def part(self, start: int, end: int) -> Span:
        """Return the span of the characters `start` to `end` of the text, or the whole span if
        their columns can't be computed."""
        if not self.verbatim or self.span.line != self.span.end_line:
            return self.span
        s = self.span
        first = self._written_at(start)
        last = max(self._written_at(end, is_end=True), first + 1)
        inside = (i.given for i in self.insets if i.start < end and start < i.end)
        place = Span(s.file, s.line, s.column + first, s.line, s.column + last, s.via, s.used)
        return place._replace(given=next(inside, None)) if self.insets else place

    def _written_at(self, position: int, is_end: bool = False) -> int:
        """Return the position in the text as written of the character at `position` in the text."""
        shift = 0
        for inset in self.insets:
            if is_end and inset.start < position <= inset.end:
                return inset.written_end
            if not is_end and inset.start <= position < inset.end:
                return inset.written_start
            if position <= inset.start:
                break
            shift = inset.written_end - inset.end
        return position + shift


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


class Collector:
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
    """Return each finding once, sorted by location. If several uses of a chain have equal findings,
    the first is kept."""
    first: dict[tuple[object, ...], Diagnostic] = {}
    for diagnostic in diagnostics:
        first.setdefault((*diagnostic.order, diagnostic.message), diagnostic)
    return tuple(sorted(first.values(), key=lambda d: d.order))


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    return any(d.severity is Severity.ERROR for d in diagnostics)


def goals_like(name: str, states: Iterable[str]) -> list[str]:
    """Return the states and chains that an unknown `name` could have been meant for. If `name` has
    no dot, the states of a chain are left out."""
    if "." in name:
        return list(dict.fromkeys(own for s in states for own in (*chains_of(s), s)))
    return list(dict.fromkeys([state.partition(".")[0] for state in states]))


_MAX_LINE = 160
"""Longer source lines are cut around the marked text, characters."""
_MAX_TEXT = 500


def render(diagnostic: Diagnostic, texts: dict[str, str]) -> str:
    """Return the report of one finding:

    missions/courier.yaml:31:48 error[KYB203]: `release` can't follow `depart`
       31 |   depart:  {do: take_off, height: 1.2 m, then: release, failed: down}
          |                                                ^^^^^^^ needs a vehicle on the ground
          = `depart` (take_off) leaves the vehicle in the air
          = help: did you mean `deliver`?
    """
    span = diagnostic.span
    place = f"{span.file}:{span.line}:{span.column}"
    lines = [f"{place} {diagnostic.severity.value}[{diagnostic.code}]: {diagnostic.message}"]
    lines += _source(span, diagnostic.label, texts)
    for other in diagnostic.related:
        if other.span.file == span.file:
            lines += _source(other.span, other.label, texts)
    notes = [*ways_to(span), *elsewhere(diagnostic), *diagnostic.notes]
    notes += [f"help: {diagnostic.help}"] if diagnostic.help else []
    lines += [f"      = {note}" for note in notes]
    return "\n".join(clipped(printable(line)) for line in lines)


@lru_cache(maxsize=8)
def lines_of(text: str) -> list[str]:
    """Return the lines of a file, which each of its findings looks up."""
    return text.split("\n")


def _source(span: Span, label: str, texts: dict[str, str]) -> Iterator[str]:
    lines = lines_of(texts.get(span.file, ""))
    if span.line > len(lines) or not lines[span.line - 1].strip():
        return
    line = lines[span.line - 1].rstrip("\r").replace("\t", " ")
    start = min(span.column - 1, len(line))
    end = span.end_column - 1 if span.end_line == span.line else len(line.rstrip())
    end = max(min(end, len(line)), start + 1)
    first = 0 if len(line) <= _MAX_LINE else max(0, min(start - 40, len(line) - _MAX_LINE))
    shown = line[first : first + _MAX_LINE].rstrip()
    if first:
        shown = "..." + shown[3:]
    if len(line) > first + _MAX_LINE:
        shown += "..."
    marks = "^" * min(end - start, _MAX_LINE - (start - first))
    yield f"{span.line:>5} | {shown}"
    yield f"      | {' ' * (start - first)}{marks} {label}".rstrip()


def ways_to(span: Span) -> Iterator[str]:
    """Yield a line for each import and each use through which the span was reached, nearest
    first."""
    for reached in reversed(span.via):
        yield f"imported from {reached.at}"
    for use in reversed(span.used):
        yield f"used at {use.at}"


def elsewhere(diagnostic: Diagnostic) -> Iterator[str]:
    """Yield a line for each related location in another file."""
    for other in diagnostic.related:
        if other.span.file != diagnostic.span.file:
            yield f"{other.label}: {other.span.at}"


def render_all(diagnostics: Iterable[Diagnostic], texts: dict[str, str]) -> list[str]:
    """Return every finding as `render` writes it, with an empty line after each."""
    return [render(diagnostic, texts) + "\n" for diagnostic in diagnostics]


def clipped(text: str) -> str:
    """Return `text` with its middle omitted if it is longer than 500 characters."""
    return text if len(text) <= _MAX_TEXT else f"{text[:200]} ... {text[-200:]}"


def printable(text: str) -> str:
    """Return `text` with control characters, and characters that can't be encoded, replaced by
    escapes."""
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "replace").decode() for c in text
    )


def to_json(diagnostic: Diagnostic) -> dict[str, Any]:
    """Return one finding as JSON values; lines and columns count from 1."""
    span = diagnostic.span
    return {
        "file": span.file,
        "line": span.line,
        "column": span.column,
        "end_line": span.end_line,
        "end_column": span.end_column,
        "severity": diagnostic.severity.value,
        "code": diagnostic.code,
        "message": clipped(diagnostic.message),
        "label": diagnostic.label,
        "notes": [clipped(note) for note in diagnostic.notes],
        "help": diagnostic.help,
        "related": [{"at": c.span.at, "label": clipped(c.label)} for c in diagnostic.related],
        "imported_from": [reached.at for reached in span.via],
        "used_at": [use.at for use in span.used],
    }
