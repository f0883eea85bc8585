"""Text to node tree, composed from the events of PyYAML's C parser.

PyYAML's own composer is not used because it recurses in C: 20,000 nested brackets would end the
process. Depth and the number of nodes with every alias expanded are bounded; tags, merge keys and
second documents are refused; every node has its place.
"""

from __future__ import annotations

import functools
from typing import Any, TypeGuard

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
    NAME_A_POINT,
    NO_COMMAS,
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    is_cut,
)
from kybflow.dsl.reading.slips import doubled_colon, empty, is_doubled, without_colon
from kybflow.dsl.reading.yaml_errors import CLOSE, not_yaml

CODES = {
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
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Unreadable(Exception):
    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(diagnostic.message)
        self.diagnostic = diagnostic


def compose(text: str, file: str) -> Collected[Node | None]:
    """The tree of `text`; None, and a finding, when it can't be had."""
    composer = _Composer(text, file)
    try:
        return Collected(composer.document(_Loader(text)), composer.found)
    except _Unreadable as stop:
        return Collected(None, [*composer.found, stop.diagnostic])
    except (yaml.YAMLError, UnicodeError) as error:
        return Collected(None, [*composer.found, not_yaml(error, text, file)])


class _Composer:
    """Builds one tree from the parser's events. `sizes` are the nodes under each anchor."""

    def __init__(self, text: str, file: str) -> None:
        self.file = file
        self._text = text
        self.found: list[Diagnostic] = []
        self.anchors: dict[str, Node | None] = {}
        self.sizes: dict[str, int] = {}
        self.total = 0

    @functools.cached_property
    def _lines(self) -> list[str]:
        return self._text.splitlines()

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
            raise self._stop("KYB011", f"nested deeper than {MAX_DEPTH} levels", event, CLOSE)
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
        bare: list[Scalar] = []
        while not isinstance(inner := self._next_event(), MappingEndEvent):
            key = self._node(inner, depth + 1)
            if entries and not isinstance(key, Scalar):
                self._cut(next(reversed(entries.values())), key)
            value = self._node(self._next_event(), depth + 1)
            if isinstance(value, Scalar) and not value.text and self._is_bare(key, value):
                bare.append(key)
                continue
            if bare:
                self._tell(entries, bare)
                bare = []
            self._enter(entries, key, value)
        self._tell(entries, bare)
        return Mapping(entries, self._span(event, inner))

    def _is_bare(self, key: Node, value: Scalar) -> TypeGuard[Scalar]:
        """Whether no colon follows a key, as in `{height: 1,5 m}`; reports one behind whose colon
        nothing stands."""
        if value.quoted or not isinstance(key, Scalar):
            return False
        line = self._lines[key.span.end_line - 1 : key.span.end_line]
        if line and not line[0][key.span.end_column - 1 :].lstrip().startswith(":"):
            return True
        self.found.append(empty(key))
        return False

    def _tell(self, entries: dict[str, MappingEntry], bare: list[Scalar]) -> None:
        """Report the keys without a colon behind the last of `entries`."""
        if bare:
            self.found += without_colon(next(reversed(entries.values()), None), bare)

    def _cut(self, before: MappingEntry, key: Node) -> None:
        """Stop where YAML ended a condition at its comma: what follows is no mapping."""
        if is_cut(before.value):
            name = before.key.text
            message = f"YAML ends `{name}` at the comma and reads a list as a key"
            hint = f"{NO_COMMAS}; {NAME_A_POINT}"
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
        elif key.text[-1:] == ":" and is_doubled(key):
            self.found.append(doubled_colon(key))
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
