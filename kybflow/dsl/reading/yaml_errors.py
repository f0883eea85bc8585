"""Collector about text that is not the YAML that its author intended.

`not_yaml` explains why the parser stopped. `without_colon` explains keys without a value. The
parser produces them for a decimal comma, a comma in a text or a forgotten colon, because a plain
value inside `{...}` ends at a comma.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from kybflow.core.names import name_flaw
from kybflow.core.text import as_typed, character_name, in_typographic_quotes, unseen
from kybflow.dsl.diagnostics import Collector, Diagnostic, Span
from kybflow.dsl.reading.nodes import (
    NAME,
    NAME_A_POINT,
    NO_POINT,
    MappingEntry,
    Node,
    Scalar,
    is_cut,
    no_commas,
)

CODES = {
    "KYB004": "The file is not YAML.",
    "KYB014": "A key has no colon: a decimal comma, a comma in a text or a forgotten colon.",
    "KYB016": "A character comes from a word processor or can't be seen, or a name mixes "
    "letters of several scripts.",
}
_SPECIAL = {"*": "an alias", "&": "an anchor", "!": "a tag", "%": "a directive"}
_OPEN = {
    "while parsing a flow mapping": ("{", "}"),
    "while parsing a flow sequence": ("[", "]"),
}
_TOO_DEEP = "exceeded maximum nesting depth"
"""The parser's own nesting error; in a long line of brackets it comes before ours, because the
parser reads ahead."""
CLOSE = "remove brackets that are too many, or close those opened earlier"
_DASHES = re.compile(r"(?:- +)*")
_KEY = re.compile(r"\s*(?:- +)*([^\s:]+):\s")
_APART = re.compile(r"- +(?=[\d.])")
"""A minus sign and its number with a space between them."""
_CALL = re.compile(r"\w\([^()]*\Z")
"""A function call up to the opening parenthesis and part of its argument."""
_SHOWN_LETTERS = 60
CONDITIONS = frozenset({"when", "healthy"})
"""The keys whose values are conditions."""
_TEXTS = frozenset({"log", "stop", "summary", "help"})
"""The keys whose values are texts for people."""
_COMPARED = re.compile(r"[<>=]|\w in \w")
_JOINED = re.compile(r"([A-Za-z_]\w*):(\S.*)\Z", re.ASCII | re.DOTALL)
"""A key and its value without a space after the colon, which YAML reads as one word."""
_TWO_WORDS = re.compile(r"([A-Za-z_]\w*)(?:\s*=\s*|\s+)([^\s=<>].*)\Z", re.ASCII | re.DOTALL)
"""A key and its value without a colon."""
_LAST_NUMBER = re.compile(r"(?:^|.*[\s<>=(\[])[-+]?\d+\Z", re.DOTALL)
_DIGITS = re.compile(r"\d+(?!\w*[.:])")
_BARE = re.compile(r"[-+]?\d+(\.\d*)?\Z", re.ASCII)
LACKS_COLON = re.compile(r"([A-Za-z_]\w*) *[{\[]", re.ASCII)
"""A key and the beginning of its value without a colon between them."""
_THOUSANDS = re.compile(r"\d{3}\b")
_IN_PARENTHESES = re.compile(r"\([-+\d.][^()]*\)\Z")
"""A list in the notation of other languages, in parentheses."""


class _Stop(NamedTuple):
    """Where the parser stopped. lines: the lines of the file. row, column: the position, from 0.
    began: the row and column at which the value or block that it was reading begins."""

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
        """Whether nothing but spaces precedes the position in its line."""
        return not self.line[: self.column].strip()

    @property
    def character(self) -> str:
        return self.line[self.column : self.column + 1]

    @property
    def escape(self) -> str:
        return self.line[self.column : self.column + 2]

    @property
    def began_line(self) -> int:
        return self.began[0] + 1 if self.began else 0

    @property
    def sign(self) -> str:
        """The first character of the value that the parser was reading."""
        if self.began is None:
            return ""
        row, column = self.began
        return self.lines[row][column : column + 1]

    @property
    def special(self) -> str | None:
        return _SPECIAL.get(self.sign)

    def finding(
        self, message: str, help: str, at: tuple[int, int] | None = None, width: int = 1
    ) -> Diagnostic:
        row, column = at or (self.row, self.column)
        span = Span(self.file, row + 1, column + 1, row + 1, column + 1 + width)
        return Diagnostic("KYB004", message, span, help=help)


def not_yaml(error: Exception, text: str, file: str) -> Diagnostic:
    """Return the finding that explains why the parser stopped in `text`."""
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
    for row in (stop.row, _above(stop.lines, stop.row)):
        if row is not None and (strange := _strange_indent(file, stop.lines, row)):
            return strange
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


_INDENT = "indent with spaces of the keyboard"


def _strange_indent(file: str, lines: list[str], row: int) -> Diagnostic | None:
    """Return KYB016 if a line is indented with another character than spaces and tabs."""
    line = lines[row] if row < len(lines) else ""
    at = unseen(line)
    if at is None or line[:at].strip():
        return None
    span = Span(file, row + 1, at + 1, row + 1, at + 2)
    message = f"{character_name(line[at])} indents this line"
    return Diagnostic("KYB016", message, span, help=_INDENT)


def strange_characters(node: Scalar, found: Collector, key: str = "") -> None:
    """Report a key or value without quotes that contains a character that can't be seen, or is in
    the quotes of a word processor. key: the key of a value. Texts for people are left alone."""
    text, span = node.text, node.span
    if text.isascii() or node.quoted or key in _TEXTS:
        return
    at = unseen(text)
    if in_typographic_quotes(text):
        message, at = f"`{text[0]}` is no quote of YAML and would belong to the text", 0
        hint = f'write `"{text[1:-1][:_SHOWN_LETTERS]}"`'
    elif at is not None and not (key and text.strip() == text and text[at].isspace()):
        rest = (text[:at] + text[at + 1 :]).strip()[:_SHOWN_LETTERS]
        where = "before" if at == 0 else "behind" if at == len(text) - 1 else "in"
        message, hint = f"{character_name(text[at])} is {where} `{rest}`", f"write `{rest}`"
        if at == 0 and text[0].isspace():
            hint = _INDENT
    else:
        return
    if span.line == span.end_line:
        column = span.column + at
        span = span._replace(column=column, end_column=column + 1)
    found.report("KYB016", message, span, help=hint)


def strange_names(key: Scalar, value: Node, found: Collector) -> None:
    """Report a key, or the name of a mission or library, that is not the name that it seems."""
    named = [key]
    if key.text in _TITLED and isinstance(value, Scalar):
        named.append(value)
    for name in named:
        if not name.quoted and (unseen(name.text) is not None or in_typographic_quotes(name.text)):
            continue  # that is reported
        flaw = next(filter(None, map(name_flaw, name.text.split("."))), "")
        if flaw:
            message = f"`{name.text[:_SHOWN_LETTERS]}` can't be a name: {flaw}"
            found.report("KYB016", message, name.span, help=_ONE_SCRIPT)


_TITLED = ("mission", "library")
_ONE_SCRIPT = "use the letters of one script, such as a to z, digits and `_`"


def _colonless(stop: _Stop, row: int) -> Diagnostic:
    line = stop.lines[row]
    text, place = line.strip(), (row, _indent(line))
    shown, width = text[:_SHOWN_LETTERS], len(text)
    if re.match(r"-\w", text):
        return stop.finding("a space is missing after `-`", f"write `- {shown[1:]}`", place)
    hint = missing_colon(text)
    if joined := re.match(r"(\w+:)\S", text):
        return stop.finding(f"a space is missing after `{joined[1]}`", hint, place, width)
    message = f"a colon is missing in `{shown}`" if hint else f"`{shown}` is not a `key: value`"
    if NAME.match(text) and not name_flaw(text):
        message, hint = f"a colon is missing after `{shown}`", f"write `{shown}:`"
    return stop.finding(message, hint or "write `key: value`", place, width)


def _second_colon(stop: _Stop) -> Diagnostic | None:
    """Explain a colon in the value of a key, in the same line or below it."""
    if cut := LACKS_COLON.match(stop.line.strip()):
        text, indent = stop.line.strip(), _indent(stop.line)
        message = f"a colon is missing after `{cut[1]}`"
        hint = f"write `{cut[1]}: {text[cut.end(1) :].strip()[:_SHOWN_LETTERS]}`"
        return stop.finding(message, hint, (stop.row, indent), len(cut[1]))
    if first := _KEY.match(stop.line[: stop.column]):
        message = f"a second colon after `{first[1]}:`"
        return stop.finding(message, "put the value in quotes, or its keys in `{...}`")
    above = _above(stop.lines, stop.row)
    if above is None:
        return None
    if _indent(stop.lines[above]) >= _indent(stop.line) or not _KEY.match(stop.lines[above]):
        return _colonless(stop, above)
    return _too_deep(stop, above)


def _too_deep(stop: _Stop, above: int) -> Diagnostic:
    """Explain a line that is indented more than the one above it, which already has a value."""
    key, outer = stop.line.strip().partition(":")[0], _KEY.match(stop.lines[above])
    wanted, own = _columns(stop.lines[above])[-1], _indent(stop.line)
    has = f"`{outer[1]}` on line {above + 1} has a value" if outer else "no key is above it"
    message = f"`{key[:_SHOWN_LETTERS]}` is indented too deep: {has}"
    hint = f"indent it by {wanted}, like line {above + 1}, or that line by {own}"
    return stop.finding(message, hint, (stop.row, own), len(key))


def _deeper(stop: _Stop) -> Diagnostic | None:
    above = _above(stop.lines, stop.row)
    if above is None or not _KEY.match(stop.lines[above]):
        return None
    return _too_deep(stop, above) if _indent(stop.lines[above]) < _indent(stop.line) else None


def _indentation(stop: _Stop) -> Diagnostic | None:
    """Explain a line whose indentation matches none of the blocks above it."""
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
    message = f"this is indented by {indent}, but the block that began on line {row + 1} by {inner}"
    hint = f"indent it by {inner}, or by {outer} for the block that began on line {first + 1}"
    return stop.finding(message, hint)


def _key_in_list(stop: _Stop) -> Diagnostic | None:
    if stop.began is None or not stop.is_first:
        return None
    row, above = stop.began[0] + 1, _above(stop.lines, stop.row)
    message = f"this is not an entry of the list that began on line {row}"
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
        hint = f"write `{_APART.sub('-', number)[:_SHOWN_LETTERS]}`"
        return stop.finding("there is a space between the minus sign and the number", hint)
    if stop.character == "-":
        hint = "begin the list on the next line, or write it as `[...]`"
        return stop.finding("a list can't begin here", hint)
    return None


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


_Explainer = Callable[[_Stop], Diagnostic | None]


def _when(
    holds: Callable[[_Stop], object], message: str, help: str, at_began: bool = False
) -> _Explainer:
    """Return an explainer with a fixed message and hint, for the stops for which `holds` is true.
    `{0}` in the message stands for the stop."""

    def explain(stop: _Stop) -> Diagnostic | None:
        place = stop.began if at_began else None
        return stop.finding(message.format(stop), help, place) if holds(stop) else None

    return explain


_CLOSES_NOTHING = _when(
    lambda s: s.character in {"]", "}"}, "this `{0.character}` closes nothing", "remove it"
)
_VALUE_ENDED = _when(
    lambda s: not s.is_first, "the value has ended before this",
    "put the whole value in quotes; inside '...' a quote is written twice",
)  # fmt: skip
_QUOTE = _when(
    lambda s: s.began, "this quote is never closed", "close it with the same quote", at_began=True
)
_SPECIAL_WORD = _when(
    lambda s: s.special, "`{0.sign}` begins {0.special} of YAML",
    "put the value in quotes if you mean the text", at_began=True,
)  # fmt: skip
_EXPLAINERS: dict[str, tuple[_Explainer, ...]] = {
    "could not find expected ':'": (lambda s: s.began and _colonless(s, s.began[0]),),
    "mapping values are not allowed in this context": (_second_colon,),
    "did not find expected key": (
        _CLOSES_NOTHING, _VALUE_ENDED,
        _when(lambda s: s.began and s.line.lstrip().startswith("- "),
              "this list entry is inside the mapping that begins on line {0.began_line}",
              "write `key: value`, or indent it under a key"),
        _when(lambda s: s.character == ":",
              "there is no name before this colon", "write `key: value`"),
        _indentation, _deeper,
    ),
    "did not find expected '-' indicator": (
        _CLOSES_NOTHING, _VALUE_ENDED, _indentation, _key_in_list,
    ),
    "block sequence entries are not allowed in this context": (_dash_in_value,),
    "did not find expected node content": (
        _dash_in_value,
        _when(lambda s: s.character in {",", "]", "}"},
              "there is nothing before this `{0.character}`", "remove it, or write a value"),
    ),
    "found character that cannot start any token": (
        _when(lambda s: s.character,
              "no value of YAML begins with `{0.character}`", "put the value in quotes"),
    ),
    "found unexpected end of stream": (_QUOTE,),
    "found unexpected document indicator": (_QUOTE,),
    "found unknown escape character": (
        _when(lambda s: s.escape, "`{0.escape}` is not an escape of YAML",
              "put a text with a backslash in single quotes"),
    ),
    "did not find expected <document start>": (_left_of_the_first,),
    "did not find expected comment or line break": (
        _when(lambda s: s.began,
              "`{0.sign}` at the beginning of a value begins a text of several lines",
              "put the value in quotes, or begin it with something else", at_began=True),
    ),
    "did not find expected alphabetic or numeric character": (_SPECIAL_WORD,),
    "did not find expected whitespace or line break": (_SPECIAL_WORD,),
    "did not find the expected '>'": (_SPECIAL_WORD,),
    "did not find expected digit or '.' character": (_SPECIAL_WORD,),
    "could not find expected directive name": (_SPECIAL_WORD,),
    "found undefined tag handle": (_SPECIAL_WORD,),
}  # fmt: skip
"""The explainers of each problem of the parser; the first that returns a finding is used."""


def _is_content(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _above(lines: list[str], row: int) -> int | None:
    """Return the row of the nearest line above that is neither empty nor a comment."""
    return next((r for r in range(min(row, len(lines)) - 1, -1, -1) if _is_content(lines[r])), None)


def _columns(line: str) -> tuple[int, ...]:
    """Return the columns at which blocks begin in a line: its dashes and its content."""
    begin, found = _indent(line), []
    dashes = _DASHES.match(line, begin)
    end = dashes.end() if dashes else begin
    found = [begin + i for i, c in enumerate(line[begin:end]) if c == "-"]
    return (*found, end)


def _blocks(lines: list[str], row: int) -> Iterator[tuple[int, int]]:
    """Yield the row and column at which each block around a line begins, innermost first."""
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
    """Return KYB004 for a bracket that is not closed: at what can't follow inside it, or at the
    bracket if the file ends there."""
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
        message, hint = NO_POINT, NAME_A_POINT
    return replace(stop.finding(message, hint), notes=notes)


def _never_closed(opening: str, opened: Span, lines: list[str], hint: str) -> Diagnostic:
    """Return KYB004 for a bracket that is open at the end of the file. If a line inside it leaves a
    bracket open and the next line is not indented further, that bracket is reported instead,
    because the closing bracket meant for the outer one has closed it."""
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
    """Return the column of the first bracket `opening` that a line leaves open, or None."""
    stack: list[int] = []
    for column, character in enumerate(line.partition(" #")[0]):
        if character in "{[":
            stack.append(column)
        elif character in "}]" and stack:
            stack.pop()
    return next((column for column in stack if line[column] == opening), None)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def without_colon(before: MappingEntry | None, keys: Sequence[Scalar], found: Collector) -> None:
    """Report successive keys without a colon in one mapping. before: the entry that precedes them,
    or None."""
    name, value = (before.key.text, before.value) if before else ("", None)
    text, first = value.text if isinstance(value, Scalar) else "", keys[0].text
    row = [text, *(key.text for key in keys)]
    listed = ", ".join(row)
    is_list = _IN_PARENTHESES.match(listed) is not None
    is_row = len(keys) > 1 and all(map(_BARE.match, row))
    hint = ""
    if is_list:
        hint = f"write `{name}: [{listed[1:-1]}]`"
    elif value is not None and is_cut(value):
        hint = no_commas(f"{text}, {first}")
    elif _LAST_NUMBER.match(text) and _DIGITS.match(first):
        hint = f"write `{name}: {text}.{first}`, with a decimal point"
        if is_row:
            hint = f"write `{name}: [{listed}]` for a list"
        elif _THOUSANDS.match(first):
            hint = f"{hint}, or `{name}: {text}{first}` where thousands are meant"
    elif name in _TEXTS and text:
        hint = "put the text in quotes"
    elif name in CONDITIONS or _COMPARED.search(first):
        hint = "" if _COMPARED.search(first) else missing_colon(first)
        hint = hint or "the language has no commas: write `and` where both must hold"
        name = name if name in CONDITIONS else "when"
    if hint and text:
        message = f"YAML ends `{name}` at the comma and reads `{first[:_SHOWN_LETTERS]}` as a key"
        notes = (f"`{name}` is `{text}`",)
        found.report("KYB014", message, keys[0].span, notes=notes, help=hint)
        keys = () if is_list or is_row else keys[1:]
    for key in keys:
        _without_value(key, found)


def _without_value(key: Scalar, found: Collector) -> None:
    shown = key.text[:_SHOWN_LETTERS]
    if not key.quoted and (joined := _JOINED.match(key.text)):
        message = f"a space is missing after `{joined[1]}:`"
        found.report("KYB010", message, key.span, help=f"write `{joined[1]}: {joined[2]}`")
    elif hint := missing_colon(key.text):
        found.report("KYB014", f"a colon is missing in `{shown}`", key.span, help=hint)
    else:
        hint = f"write `{shown}: VALUE`; put a list in `[...]`, a text with braces in quotes"
        found.report("KYB014", f"the key `{shown}` has no value", key.span, help=hint)


def missing_colon(text: str) -> str:
    """Return the hint for a text that is probably a key and its value, such as `height 1 m` or
    `height=1 m`, or that has the colon of another keyboard; otherwise an empty string."""
    typed = as_typed(text)
    parts = _JOINED.match(typed) or _TWO_WORDS.match(typed)
    return f"write `{parts[1]}: {parts[2].strip()[:_SHOWN_LETTERS]}`" if parts else ""
