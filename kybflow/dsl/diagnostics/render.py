"""Render findings for people and for programs. Colours are added by the command line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.diagnostics.spans import Span

_WIDEST = 160
"""Longer source lines are cut around the marked text, characters."""
_LONGEST = 500


def render(diagnostic: Diagnostic, texts: dict[str, str]) -> str:
    """Return the report of one finding:

    missions/courier.yaml:31:48 error[KYB203]: `release` can't follow `depart`
       31 |   depart:  {do: take_off, height: 1.2 m, then: release, failed: down}
          |                                                ^^^^^^^ needs a vehicle on the ground
          = `depart` (take_off) leaves the vehicle in the air
          = help: did you mean `deliver`?
    """
    return "\n".join(clipped(printable(line)) for line in _lines(diagnostic, texts))


def _lines(diagnostic: Diagnostic, texts: dict[str, str]) -> Iterator[str]:
    span = diagnostic.span
    yield (
        f"{span.file}:{span.line}:{span.column} "
        f"{diagnostic.severity.value}[{diagnostic.code}]: {diagnostic.message}"
    )
    yield from _source(span, diagnostic.label, texts)
    for other in diagnostic.related:
        if other.span.file == span.file:
            yield from _source(other.span, other.label, texts)
    for note in (*ways_to(span), *elsewhere(diagnostic), *diagnostic.notes):
        yield f"      = {note}"
    if diagnostic.help:
        yield f"      = help: {diagnostic.help}"


def _source(span: Span, label: str, texts: dict[str, str]) -> Iterator[str]:
    lines = texts.get(span.file, "").split("\n")
    if span.line > len(lines) or not lines[span.line - 1].strip():
        return
    line = lines[span.line - 1].rstrip("\r").replace("\t", " ")
    start = min(span.column - 1, len(line))
    end = span.end_column - 1 if span.end_line == span.line else len(line.rstrip())
    end = max(min(end, len(line)), start + 1)
    first = 0 if len(line) <= _WIDEST else max(0, min(start - 40, len(line) - _WIDEST))
    shown = line[first : first + _WIDEST].rstrip()
    if first:
        shown = "..." + shown[3:]
    if len(line) > first + _WIDEST:
        shown += "..."
    marks = "^" * min(end - start, _WIDEST - (start - first))
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
    return text if len(text) <= _LONGEST else f"{text[:200]} ... {text[-200:]}"


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
