"""What stopped YAML's parser, in words: what stands there, which line began the block, and what to
change."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.reading.nodes import NAME_A_POINT
from kybflow.dsl.reading.slips import missing_colon

CODES = {
    "KYB004": "The file is not YAML.",
}
_OPEN = {
    "while parsing a flow mapping": ("{", "}"),
    "while parsing a flow sequence": ("[", "]"),
}
_TOO_DEEP = "exceeded maximum nesting depth"
"""The parser's own limit, which reading ahead reaches first in a long line of brackets."""
CLOSE = "close the brackets that were opened before"
_DASHES = re.compile(r"(?:- +)*")
_KEY = re.compile(r"\s*(?:- +)*([^\s:]+):\s")
_APART = re.compile(r"- +(?=[\d.])")
"""A sign and its number, with a space between."""
_CALL = re.compile(r"\w\([^()]*\Z")
"""What stands before the argument of a function."""
_SHOWN = 60


class _Stop(NamedTuple):
    """Where the parser stopped: the lines of the file, the place as row and column from 0, and the
    place at which began what it was reading."""

    file: str
    lines: list[str]
    row: int
    column: int
    began: tuple[int, int] | None

    @property
    def line(self) -> str:
        return self.lines[self.row] if self.row < len(self.lines) else ""

    @property
    def is_first(self) -> bool:
        """Whether nothing stands before the place in its line."""
        return not self.line[: self.column].strip()

    @property
    def character(self) -> str:
        return self.line[self.column : self.column + 1]

    def finding(
        self, message: str, help: str, at: tuple[int, int] | None = None, width: int = 1
    ) -> Diagnostic:
        row, column = at or (self.row, self.column)
        span = Span(self.file, row + 1, column + 1, row + 1, column + 1 + width)
        return Diagnostic("KYB004", message, span, help=help)


def not_yaml(error: Exception, text: str, file: str) -> Diagnostic:
    """The finding for what stopped the parser in `text`."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is None:
        reason = getattr(error, "reason", None) or "a character that no text file has"
        position = getattr(error, "position", 0)
        line = text.count("\n", 0, position) + 1 if isinstance(position, int) else 1
        return Diagnostic("KYB004", f"this is not YAML: {reason}", Span(file, line, 1, line, 2))
    context, began = getattr(error, "context", None), getattr(error, "context_mark", None)
    problem = getattr(error, "problem", None) or "it can't be understood"
    start = None if began is None else (began.line, began.column)
    stop = _Stop(file, text.splitlines(), mark.line, mark.column, start)
    at_fault = stop.line[: _indent(stop.line)] + stop.character
    if problem == _TOO_DEEP:
        return replace(stop.finding("nested deeper than a mission needs", CLOSE), code="KYB011")
    if "\t" in at_fault:  # elsewhere it is a space like any other
        return stop.finding("a tab can't indent YAML", "indent with spaces")
    if context in _OPEN and start is not None:
        return _left_open(_OPEN[context], start, stop)
    explained = next((d for e in _EXPLAINERS.get(problem, ()) if (d := e(stop))), None)
    if explained is None:
        notes = (context,) if context else ()
        return replace(stop.finding(f"this is not YAML: {problem}", ""), notes=notes)
    return explained


def _no_colon(stop: _Stop) -> Diagnostic | None:
    """A line of a block without a colon: the parser stops in the next one."""
    return None if stop.began is None else _colonless(stop, stop.began[0])


def _colonless(stop: _Stop, row: int) -> Diagnostic:
    line = stop.lines[row]
    text, place = line.strip(), (row, _indent(line))
    shown, width = text[:_SHOWN], len(text)
    if re.match(r"-\w", text):
        return stop.finding("a space is missing after `-`", f"write `- {shown[1:]}`", place)
    hint = missing_colon(text)
    if joined := re.match(r"(\w+:)\S", text):
        return stop.finding(f"a space is missing after `{joined[1]}`", hint, place, width)
    message = f"a colon is missing in `{shown}`" if hint else f"`{shown}` is no `key: value`"
    return stop.finding(message, hint or "write `key: value`", place, width)


def _second_colon(stop: _Stop) -> Diagnostic | None:
    """A colon in the value of a key, which stands in the same line, or begins in one above."""
    if first := _KEY.match(stop.line[: stop.column]):
        message = f"a second colon behind `{first[1]}:`"
        return stop.finding(message, "put the value in quotes, or its keys in `{...}`")
    above = _above(stop.lines, stop.row)
    if above is None:
        return None
    if _indent(stop.lines[above]) >= _indent(stop.line) or not _KEY.match(stop.lines[above]):
        return _colonless(stop, above)
    return _too_deep(stop, above)


def _too_deep(stop: _Stop, above: int) -> Diagnostic:
    """A line that is indented more than the one above it, which has a value already."""
    key, outer = stop.line.strip().partition(":")[0], _KEY.match(stop.lines[above])
    wanted, own = _columns(stop.lines[above])[-1], _indent(stop.line)
    has = f"`{outer[1]}` of line {above + 1} has a value" if outer else "the line above is no key"
    message = f"`{key[:_SHOWN]}` is indented too deep: {has}"
    hint = f"indent it by {wanted}, as line {above + 1}, or that one by {own}"
    return stop.finding(message, hint, (stop.row, own), len(key))


def _deeper(stop: _Stop) -> Diagnostic | None:
    above = _above(stop.lines, stop.row)
    if above is None or not _KEY.match(stop.lines[above]):
        return None
    return _too_deep(stop, above) if _indent(stop.lines[above]) < _indent(stop.line) else None


def _closes_nothing(stop: _Stop) -> Diagnostic | None:
    if stop.character and stop.character in "]}":
        return stop.finding(f"this `{stop.character}` closes nothing", "remove it")
    return None


def _behind_a_value(stop: _Stop) -> Diagnostic | None:
    if stop.is_first:
        return None
    hint = "put the whole value in quotes; inside of '...' a quote is written twice"
    return stop.finding("the value has ended before this", hint)


def _entry_in_mapping(stop: _Stop) -> Diagnostic | None:
    if stop.began is None or not stop.line.lstrip().startswith("- "):
        return None
    where = f"a list entry inside of the mapping that begins in line {stop.began[0] + 1}"
    return stop.finding(where, "write `key: value`, or indent it under a key")


def _nameless(stop: _Stop) -> Diagnostic | None:
    if stop.character == ":":
        return stop.finding("no name stands before this colon", "write `key: value`")
    return None


def _indentation(stop: _Stop) -> Diagnostic | None:
    """A line that is indented like none of the blocks above it."""
    indent = _indent(stop.line)
    deeper = around = None
    for row, column in _blocks(stop.lines, stop.row):
        if column > indent:
            deeper = (row, column)
        elif around is None:
            around = (row, column)
    if deeper is None or around is None or around[1] == indent:
        return None
    (row, inner), (first, outer) = deeper, around
    message = f"this is indented by {indent}, but the block that began at line {row + 1} by {inner}"
    hint = f"indent it by {inner}, or by {outer} for the block that began at line {first + 1}"
    return stop.finding(message, hint)


def _key_in_list(stop: _Stop) -> Diagnostic | None:
    if stop.began is None or not stop.is_first:
        return None
    row, above = stop.began[0] + 1, _above(stop.lines, stop.row)
    message = f"this is no entry of the list that began at line {row}"
    hint = "begin it with `- `"
    if above is not None:
        hint += (
            f", or indent it by {_columns(stop.lines[above])[-1]} to go on with line {above + 1}"
        )
    return stop.finding(message, hint)


def _dash_in_value(stop: _Stop) -> Diagnostic | None:
    rest = stop.line[stop.column :]
    if _APART.match(rest):
        number = re.split(r"[,\]}]", rest)[0].strip()
        hint = f"write `{_APART.sub('-', number)[:_SHOWN]}`"
        return stop.finding("a space stands between the minus sign and its number", hint)
    if stop.character == "-":
        hint = "begin the list in the next line, or write it as `[...]`"
        return stop.finding("a list can't begin here", hint)
    return None


def _nothing_between(stop: _Stop) -> Diagnostic | None:
    if stop.character and stop.character in ",]}":
        return stop.finding(
            f"nothing stands before this `{stop.character}`", "remove it, or write a value"
        )
    return None


def _special_character(stop: _Stop) -> Diagnostic | None:
    message = f"no value of YAML begins with `{stop.character}`"
    return stop.finding(message, "put the value in quotes") if stop.character else None


def _quote(stop: _Stop) -> Diagnostic | None:
    hint = "close it with the same quote"
    return stop.finding("this quote is never closed", hint, stop.began) if stop.began else None


def _special_word(stop: _Stop) -> Diagnostic | None:
    if stop.began is None:
        return None
    sign = stop.lines[stop.began[0]][stop.began[1] : stop.began[1] + 1]
    what = {"*": "an alias", "&": "an anchor", "!": "a tag", "%": "a directive"}.get(sign)
    if what is None:
        return None
    message = f"`{sign}` begins {what} of YAML"
    return stop.finding(message, "put the value in quotes if you mean the text", stop.began)


def _escape(stop: _Stop) -> Diagnostic | None:
    wrong = stop.line[stop.column : stop.column + 2]
    message = f"`{wrong}` is no escape of YAML"
    return stop.finding(message, "put a text with a backslash in single quotes")


def _left_of_the_first(stop: _Stop) -> Diagnostic | None:
    first = next((r for r, line in enumerate(stop.lines) if _is_content(line)), 0)
    indent = _indent(stop.lines[first]) if stop.lines else 0
    if not stop.is_first or indent <= stop.column:
        return stop.finding(
            "the file's value has ended before this",
            "a mission is one mapping: `key: value`, line by line",
        )
    message = f"this is indented by {stop.column}, but line {first + 1} by {indent}"
    return stop.finding(message, "indent both alike")


def _block_text(stop: _Stop) -> Diagnostic | None:
    if stop.began is None:
        return None
    sign = stop.lines[stop.began[0]][stop.began[1] : stop.began[1] + 1]
    message = f"`{sign}` at the beginning of a value begins a text of several lines"
    return stop.finding(
        message, "put the value in quotes, or begin it with something else", stop.began
    )


_EXPLAINERS: dict[str, tuple[Callable[[_Stop], Diagnostic | None], ...]] = {
    "could not find expected ':'": (_no_colon,),
    "mapping values are not allowed in this context": (_second_colon,),
    "did not find expected key": (
        _closes_nothing, _behind_a_value, _entry_in_mapping, _nameless, _indentation, _deeper,
    ),
    "did not find expected '-' indicator": (
        _closes_nothing, _behind_a_value, _indentation, _key_in_list,
    ),
    "block sequence entries are not allowed in this context": (_dash_in_value,),
    "did not find expected node content": (_dash_in_value, _nothing_between),
    "found character that cannot start any token": (_special_character,),
    "found unexpected end of stream": (_quote,),
    "found unexpected document indicator": (_quote,),
    "did not find expected alphabetic or numeric character": (_special_word,),
    "found unknown escape character": (_escape,),
    "did not find expected <document start>": (_left_of_the_first,),
    "did not find expected comment or line break": (_block_text,),
    "did not find expected whitespace or line break": (_special_word,),
    "did not find the expected '>'": (_special_word,),
    "did not find expected digit or '.' character": (_special_word,),
    "could not find expected directive name": (_special_word,),
    "found undefined tag handle": (_special_word,),
}  # fmt: skip
"""What each problem of the parser can mean, asked in order."""


def _is_content(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _above(lines: list[str], row: int) -> int | None:
    """The nearest line above with anything but a comment."""
    return next((r for r in range(min(row, len(lines)) - 1, -1, -1) if _is_content(lines[r])), None)


def _columns(line: str) -> tuple[int, ...]:
    """The columns at which blocks begin in a line: its dashes and what is behind them."""
    begin, found = _indent(line), []
    dashes = _DASHES.match(line, begin)
    end = dashes.end() if dashes else begin
    found = [begin + i for i, c in enumerate(line[begin:end]) if c == "-"]
    return (*found, end)


def _blocks(lines: list[str], row: int) -> Iterator[tuple[int, int]]:
    """The blocks that are open above a line, the innermost first: the row at which each began and
    its column."""
    open_at: tuple[int, int] | None = None
    for above in range(row - 1, -1, -1):
        if not _is_content(lines[above]):
            continue
        for column in reversed(_columns(lines[above])):
            if open_at is None or column < open_at[1]:
                if open_at is not None:
                    yield open_at
                open_at = (above, column)
            elif column == open_at[1]:
                open_at = (above, column)
    if open_at is not None:
        yield open_at


def _left_open(brackets: tuple[str, str], began: tuple[int, int], stop: _Stop) -> Diagnostic:
    """KYB004 for a bracket that stays open, at what can't follow in it, or at itself where nothing
    follows."""
    opening, closing = brackets
    row, column = began
    if not "".join(stop.lines[stop.row :]).strip():
        opened = Span(stop.file, row + 1, column + 1, row + 1, column + 2)
        return _never_closed(opening, opened, stop.lines, f"close it with `{closing}`")
    where = "" if row == stop.row else f" of line {row + 1}"
    message = f"the `{opening}`{where} is still open: a `,` or `{closing}` is missing before this"
    notes = (f"`{opening}` opened at {stop.file}:{row + 1}:{column + 1}",)
    hint = f"close it with `{closing}`, or put a `,` between its entries"
    if stop.character == "[" and _CALL.search(stop.line[: stop.column]):
        hint = NAME_A_POINT
    return replace(stop.finding(message, hint), notes=notes)


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
