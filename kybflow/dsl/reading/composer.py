"""Compose a node tree from text with the events of PyYAML's C parser.

PyYAML's own composer is not used because it recurses in C: 20,000 nested brackets would end the
process. The depth is bounded, and so is the number of nodes with every alias expanded. Tags, merge
keys and second documents are refused. Every node has its source location.
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

from kybflow.dsl.diagnostics.diagnostic import Findings
from kybflow.dsl.diagnostics.spans import Span
from kybflow.dsl.reading.nodes import (
    NAME,
    NAME_A_POINT,
    NO_COMMAS,
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    Sequence,
    is_cut,
)
from kybflow.dsl.reading.yaml_errors import CLOSE, not_yaml, without_colon

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
    "KYB015": "A key with a colon and nothing behind it, which is the same as not written.",
}
MAX_NODES = 100_000
MAX_DEPTH = 40
LONG = "a long path belongs in a table of its own, which `do: follow_trajectory` flies"
"""The hint for a file that is too large."""
_SHOWN = 60
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Unreadable(Exception):
    """Stops the composing of a text; the reason is already reported."""


def compose(text: str, file: str, found: Findings) -> Node | None:
    """Return the node tree of `text`, or None if it can't be composed; report what is wrong."""
    try:
        return _Composer(text, file, found).document(_Loader(text))
    except _Unreadable:
        return None
    except (yaml.YAMLError, UnicodeError) as error:
        found.add(not_yaml(error, text, file))
        return None


class _Composer:
    """Builds one tree from the parser's events. `_sizes` holds the number of nodes under each
    anchor."""

    def __init__(self, text: str, file: str, found: Findings) -> None:
        self._text, self._file, self._found = text, file, found
        self._anchors: dict[str, Node | None] = {}
        self._sizes: dict[str, int] = {}
        self._total = 0

    @functools.cached_property
    def _lines(self) -> list[str]:
        return self._text.splitlines()

    def document(self, loader: Any) -> Node:
        self._next_event = loader.get_event
        loader.get_event()
        if loader.check_event(StreamEndEvent):
            raise self._stopped("KYB005", f"`{self._file}` is empty", loader.get_event())
        loader.get_event()
        root = self._node(loader.get_event(), 0)
        loader.get_event()
        if not loader.check_event(StreamEndEvent):
            second = loader.get_event()
            hint = "a file holds one mission: remove `---`, or move the rest to a file of its own"
            raise self._stopped("KYB006", "a second document begins here", second, hint)
        return root

    def _node(self, event: Any, depth: int) -> Node:
        if isinstance(event, AliasEvent):
            return self._alias(event)
        self._total += 1
        if depth > MAX_DEPTH:
            message = f"nested deeper than {MAX_DEPTH} levels"
            raise self._stopped("KYB011", message, event, CLOSE)
        if self._total > MAX_NODES:
            raise self._too_many(event)
        if event.tag is not None and event.tag != "!":
            message, span = f"the tag `{event.tag}` is refused", self._span(event, event)
            self._found.report("KYB008", message, span, help="write the value without it")
        anchor = event.anchor
        if anchor is None:
            return self._content(event, depth)
        before, self._anchors[anchor] = self._total, None
        node = self._anchors[anchor] = self._content(event, depth)
        self._sizes[anchor] = self._total - before + 1
        return node

    def _alias(self, event: Any) -> Node:
        name = event.anchor
        node = self._anchors.get(name)
        if node is None:
            inside = f"`*{name}` is inside `&{name}`"
            message = inside if name in self._anchors else f"nothing is marked `&{name}`"
            raise self._stopped("KYB013", message, event)
        self._total += self._sizes[name]
        if self._total > MAX_NODES:
            raise self._too_many(event)
        return node

    def _too_many(self, event: Any) -> _Unreadable:
        return self._stopped("KYB012", f"more than {MAX_NODES} values", event, LONG)

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
                self._refuse_cut(next(reversed(entries.values())), key)
            value = self._node(self._next_event(), depth + 1)
            if isinstance(value, Scalar) and not value.text and self._is_bare(key, value):
                bare.append(key)
                continue
            if bare:
                without_colon(next(reversed(entries.values()), None), bare, self._found)
                bare = []
            self._enter(entries, key, value)
        if bare:
            without_colon(next(reversed(entries.values()), None), bare, self._found)
        return Mapping(entries, self._span(event, inner))

    def _is_bare(self, key: Node, value: Scalar) -> TypeGuard[Scalar]:
        """Return whether no colon follows a key, as after `5 m` in `{height: 1,5 m}`. Warn of a
        colon without a value."""
        if value.quoted or not isinstance(key, Scalar):
            return False
        line = self._lines[key.span.end_line - 1 : key.span.end_line]
        if line and not line[0][key.span.end_column - 1 :].lstrip().startswith(":"):
            return True
        message = f"`{key.text[:_SHOWN]}` has no value"
        hint = (
            "write one, indent what belongs to it, or remove it; `null` removes what `like` brings"
        )
        self._found.warn("KYB015", message, key.span, help=hint)
        return False

    def _refuse_cut(self, before: MappingEntry, key: Node) -> None:
        """Stop if YAML ended a condition at a comma inside its parentheses, because the rest is no
        mapping."""
        if is_cut(before.value):
            message = f"YAML ends `{before.key.text}` at the comma and reads a list as a key"
            self._found.report("KYB010", message, key.span, help=f"{NO_COMMAS}; {NAME_A_POINT}")
            raise _Unreadable

    def _enter(self, entries: dict[str, MappingEntry], key: Node, value: Node) -> None:
        if not isinstance(key, Scalar):
            what = "a list" if isinstance(key, Sequence) else "a mapping"
            self._found.report("KYB010", f"{what} can't be a key", key.span, help="a key is a name")
        elif key.text == "<<" and not key.quoted:
            hint = "start from another entry with `like: NAME`"
            self._found.report("KYB009", "YAML's merge key `<<` is refused", key.span, help=hint)
        elif key.text[-1:] == ":" and not key.quoted and NAME.match(name := key.text.rstrip(": ")):
            hint = f"write `{name}: ...`"
            self._found.report("KYB010", f"`{name}` has two colons", key.span, help=hint)
        elif key.text in entries:
            first, again = entries[key.text].key.span, key.span
            message = f"`{key.text}` is written twice"
            self._found.report("KYB007", message, again, "again", (f"first at {first.at}",))
            self._found.report("KYB007", message, first, "first", (f"again at {again.at}",))
        else:
            entries[key.text] = MappingEntry(key, value)

    def _stopped(self, code: str, message: str, event: Any, help: str = "") -> _Unreadable:
        """Report why composing stops at `event`, and return the exception to raise."""
        self._found.report(code, message, self._span(event, event), help=help)
        return _Unreadable()

    def _span(self, first: Any, last: Any) -> Span:
        start, end = first.start_mark, last.end_mark
        return Span(self._file, start.line + 1, start.column + 1, end.line + 1, end.column + 1)
