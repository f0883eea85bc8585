"""Text to node tree, composed from the events of PyYAML's C parser.

PyYAML's own composer is not used because it recurses in C: 20,000 nested brackets would end the
process. Depth and the number of nodes with every alias expanded are bounded; tags, merge keys and
second documents are refused; every node has its place.
"""

from __future__ import annotations

import re
from typing import Any

import yaml
from yaml.events import (
    AliasEvent,
    MappingEndEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

from kybflow.dsl.diagnostics.diagnostic import Collected, Diagnostic
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.reading.nodes import (
    NO_COMMAS,
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    is_cut,
    is_null,
)

CODES = {
    "KYB004": "The file is not YAML.",
    "KYB005": "The file is empty.",
    "KYB006": "A file holds one document, not several.",
    "KYB007": "A mapping has the same key twice.",
    "KYB008": "YAML tags are refused: a mission holds values, never objects.",
    "KYB009": "YAML's merge key is refused: `like` says the same with one rule.",
    "KYB010": "A key is not a plain name.",
    "KYB011": "Nested deeper than a mission needs.",
    "KYB012": "More values than a mission may have, counted with every alias expanded.",
    "KYB013": "An alias that nothing defines, or that contains itself.",
}
MAX_NODES = 100_000
MAX_DEPTH = 40
LONG = "a long path belongs in a table of its own, which `do: follow_trajectory` flies"
"""The way out of a file that is too large."""
_JOINED = re.compile(r"([A-Za-z_]\w*):(\S.*)\Z", re.ASCII)
"""What YAML takes for one word: a key and its value without a space between."""
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Unreadable(Exception):
    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(diagnostic.message)
        self.diagnostic = diagnostic


def compose(text: str, file: str) -> Collected[Node | None]:
    """The tree of `text`; None, and a finding, when it can't be had."""
    composer = _Composer(file)
    try:
        return Collected(composer.document(_Loader(text)), composer.found)
    except _Unreadable as stop:
        return Collected(None, [*composer.found, stop.diagnostic])
    except (yaml.YAMLError, UnicodeError) as error:
        return Collected(None, [*composer.found, _not_yaml(error, text, file)])


class _Composer:
    """Builds one tree from the parser's events. `sizes` are the nodes under each anchor."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.found: list[Diagnostic] = []
        self.anchors: dict[str, Node | None] = {}
        self.sizes: dict[str, int] = {}
        self.total = 0

    def document(self, loader: Any) -> Node:
        self._next_event = loader.get_event
        loader.get_event()
        if loader.check_event(StreamEndEvent):
            raise self._stop("KYB005", f"`{self.file}` is empty", loader.get_event())
        loader.get_event()
        root = self._node(loader.get_event(), 0)
        loader.get_event()
        if not loader.check_event(StreamEndEvent):
            second = loader.get_event()
            raise self._stop("KYB006", "a second document begins here", second)
        return root

    def _node(self, event: Any, depth: int) -> Node:
        if isinstance(event, AliasEvent):
            return self._alias(event)
        self.total += 1
        if depth > MAX_DEPTH:
            hint = "close the brackets that were opened before"
            raise self._stop("KYB011", f"nested deeper than {MAX_DEPTH} levels", event, hint)
        if self.total > MAX_NODES:
            raise self._too_many(event)
        if event.tag is not None and event.tag != "!":
            self._refuse(
                "KYB008", f"the tag `{event.tag}` is refused", event, "write the value without it"
            )
        anchor = event.anchor
        if anchor is None:
            return self._content(event, depth)
        before, self.anchors[anchor] = self.total, None
        node = self.anchors[anchor] = self._content(event, depth)
        self.sizes[anchor] = self.total - before + 1
        return node

    def _content(self, event: Any, depth: int) -> Node:
        if isinstance(event, ScalarEvent):
            return Scalar(event.value, self._span(event, event), event.style not in (None, ""))
        if isinstance(event, SequenceStartEvent):
            items: list[Node] = []
            while not isinstance(inner := self._next_event(), SequenceEndEvent):
                items.append(self._node(inner, depth + 1))
            return Sequence(tuple(items), self._span(event, inner))
        entries: dict[str, MappingEntry] = {}
        while not isinstance(inner := self._next_event(), MappingEndEvent):
            key = self._node(inner, depth + 1)
            if entries and not isinstance(key, Scalar):
                self._cut(next(reversed(entries.values())), key)
            value = self._node(self._next_event(), depth + 1)
            self._enter(entries, key, value)
        return Mapping(entries, self._span(event, inner))

    def _cut(self, before: MappingEntry, key: Node) -> None:
        """Stop where YAML ended a condition at its comma: what follows is no mapping."""
        if is_cut(before.value):
            name = before.key.text
            message = f"YAML ends `{name}` at the comma and reads a list as a key"
            hint = f"{NO_COMMAS}; a point is `$point`, a parameter of the type `position`"
            raise _Unreadable(Diagnostic("KYB010", message, key.span, help=hint))

    def _enter(self, entries: dict[str, MappingEntry], key: Node, value: Node) -> None:
        if not isinstance(key, Scalar):
            what = "a list" if isinstance(key, Sequence) else "a mapping"
            self.found.append(
                Diagnostic("KYB010", f"{what} can't be a key", key.span, help="a key is a name")
            )
        elif key.text == "<<" and not key.quoted:
            self.found.append(
                Diagnostic(
                    "KYB009",
                    "YAML's merge key `<<` is refused",
                    key.span,
                    help="start from another entry with `like: NAME`",
                )
            )
        elif is_null(value) and not key.quoted and (joined := _JOINED.match(key.text)):
            message = f"a space is missing after `{joined[1]}:`"
            hint = f"write `{joined[1]}: {joined[2]}`"
            self.found.append(Diagnostic("KYB010", message, key.span, help=hint))
        elif key.text in entries:
            first = entries[key.text].key.span
            message = f"`{key.text}` is written twice"
            self.found += [
                Diagnostic("KYB007", message, key.span, "again", (f"first at {first.at}",)),
                Diagnostic("KYB007", message, first, "first", (f"again at {key.span.at}",)),
            ]
        else:
            entries[key.text] = MappingEntry(key, value)

    def _alias(self, event: Any) -> Node:
        name = event.anchor
        node = self.anchors.get(name)
        if name not in self.anchors:
            raise self._stop("KYB013", f"nothing is marked `&{name}`", event)
        if node is None:
            raise self._stop("KYB013", f"`*{name}` is inside of `&{name}`", event)
        self.total += self.sizes[name]
        if self.total > MAX_NODES:
            raise self._too_many(event)
        return node

    def _too_many(self, event: Any) -> _Unreadable:
        return self._stop("KYB012", f"more than {MAX_NODES} values", event, LONG)

    def _refuse(self, code: str, message: str, event: Any, help: str) -> None:
        self.found.append(Diagnostic(code, message, self._span(event, event), help=help))

    def _stop(self, code: str, message: str, event: Any, help: str = "") -> _Unreadable:
        return _Unreadable(Diagnostic(code, message, self._span(event, event), help=help))

    def _span(self, first: Any, last: Any) -> Span:
        start, end = first.start_mark, last.end_mark
        return Span(self.file, start.line + 1, start.column + 1, end.line + 1, end.column + 1)


_OPEN = {
    "while parsing a flow mapping": ("{", "}"),
    "while parsing a flow sequence": ("[", "]"),
}


def _not_yaml(error: Exception, text: str, file: str) -> Diagnostic:
    """The finding for what stopped the parser in `text`."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is None:
        reason = getattr(error, "reason", None) or "a character that no text file has"
        position = getattr(error, "position", 0)
        line = text.count("\n", 0, position) + 1 if isinstance(position, int) else 1
        return Diagnostic("KYB004", f"this is not YAML: {reason}", Span(file, line, 1, line, 2))
    span = _mark_span(file, mark)
    lines = text.splitlines()
    line_text = lines[mark.line] if mark.line < len(lines) else ""
    at_fault = line_text[: _indent(line_text)] + line_text[mark.column : mark.column + 1]
    if "\t" in at_fault:  # elsewhere it is a space like any other
        return Diagnostic("KYB004", "a tab can't indent YAML", span, help="indent with spaces")
    context, began = getattr(error, "context", None), getattr(error, "context_mark", None)
    if context in _OPEN and began is not None:
        return _left_open(_OPEN[context], _mark_span(file, began), span, lines)
    is_entry = line_text.lstrip().startswith("- ")
    if context == "while parsing a block mapping" and is_entry and began is not None:
        where = f"a list entry inside of the mapping that begins in line {began.line + 1}"
        return Diagnostic(
            "KYB004", where, span, help="write `key: value`, or indent it under a key"
        )
    problem = getattr(error, "problem", None) or "it can't be understood"
    notes = (context,) if context else ()
    return Diagnostic("KYB004", f"this is not YAML: {problem}", span, notes=notes)


def _mark_span(file: str, mark: Any) -> Span:
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
