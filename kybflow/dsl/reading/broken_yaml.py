"""What the parser of YAML could not read, in words: a tab, a bracket that stays open, and the rest
as it says it."""

from __future__ import annotations

from typing import Any

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.reading.source import Span

_OPEN = {
    "while parsing a flow mapping": ("{", "}"),
    "while parsing a flow sequence": ("[", "]"),
}


def not_yaml(error: Exception, text: str, file: str) -> Diagnostic:
    """The finding for what stopped the parser in `text`."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is None:
        reason = getattr(error, "reason", None) or "a character that no text file has"
        position = getattr(error, "position", 0)
        line = text.count("\n", 0, position) + 1 if isinstance(position, int) else 1
        return Diagnostic("KYB004", f"this is not YAML: {reason}", Span(file, line, 1, line, 2))
    span = _span(file, mark)
    lines = text.splitlines()
    line_text = lines[mark.line] if mark.line < len(lines) else ""
    at_fault = line_text[: _indent(line_text)] + line_text[mark.column : mark.column + 1]
    if "\t" in at_fault:  # elsewhere it is a space like any other
        return Diagnostic("KYB004", "a tab can't indent YAML", span, help="indent with spaces")
    context, began = getattr(error, "context", None), getattr(error, "context_mark", None)
    if context in _OPEN and began is not None:
        return _left_open(_OPEN[context], _span(file, began), span, lines)
    is_entry = line_text.lstrip().startswith("- ")
    if context == "while parsing a block mapping" and is_entry and began is not None:
        where = f"a list entry inside of the mapping that begins in line {began.line + 1}"
        return Diagnostic(
            "KYB004", where, span, help="write `key: value`, or indent it under a key"
        )
    problem = getattr(error, "problem", None) or "it can't be understood"
    notes = (context,) if context else ()
    return Diagnostic("KYB004", f"this is not YAML: {problem}", span, notes=notes)


def _span(file: str, mark: Any) -> Span:
    """The character at a mark."""
    return Span(file, mark.line + 1, mark.column + 1, mark.line + 1, mark.column + 2)


def _left_open(brackets: tuple[str, str], opened: Span, stop: Span, lines: list[str]) -> Diagnostic:
    """KYB004 for a bracket that stays open, at what can't follow in it, or at itself where nothing
    follows."""
    opening, closing = brackets
    is_end = stop.line > len(lines) or not "".join(lines[stop.line - 1 :]).strip()
    if is_end:
        return _never_closed(opening, opened, lines, f"close it with `{closing}`")
    where = "" if opened.line == stop.line else f" of line {opened.line}"
    return Diagnostic(
        "KYB004",
        f"the `{opening}`{where} is still open: a `,` or `{closing}` is missing before this",
        stop,
        notes=(f"`{opening}` opened at {opened.at}:{opened.column}",),
        help=f"close it with `{closing}`, or put a `,` between its entries",
    )


def _never_closed(opening: str, opened: Span, lines: list[str], hint: str) -> Diagnostic:
    """KYB004 at a bracket that the end of the file leaves open; rather at one inside of it behind
    which the next line begins anew: the bracket that was meant for the outer one closes that."""
    for number in range(opened.line + 1, len(lines)):
        line, below = lines[number - 1], lines[number]
        column = _left_open_in(line, opening)
        anew = below.strip() and below.strip()[0] not in "]}" and _indent(below) <= _indent(line)
        if column is not None and anew:
            span = Span(opened.file, number, column + 1, number, column + 2)
            message = f"a `{opening}` is never closed, most likely this one"
            note = f"the end of the file leaves the `{opening}` of line {opened.line} open"
            return Diagnostic("KYB004", message, span, notes=(note,), help=hint)
    return Diagnostic("KYB004", f"this `{opening}` is never closed", opened, help=hint)


def _left_open_in(line: str, opening: str) -> int | None:
    """The column of the first bracket that a line leaves open; None where it leaves none."""
    stack: list[int] = []
    for column, character in enumerate(line.partition(" #")[0]):
        if character in "{[":
            stack.append(column)
        elif character in "}]" and stack:
            stack.pop()
    return next((column for column in stack if line[column] == opening), None)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())
