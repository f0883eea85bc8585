"""The node tree: a file as the reader understands it, before any interpretation, with a span on
every node.

A scalar is text; whether `10 s` is a duration or a name is decided by the schema. Nodes are shared
where a file uses an alias, and they never change.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from kybflow.core import names
from kybflow.dsl.diagnostics import Inset, Span, Text

_NULL = frozenset({"", "~", "null", "Null", "NULL"})
_TRUE = frozenset({"true", "True", "TRUE"})
_FALSE = frozenset({"false", "False", "FALSE"})
_INTEGER = re.compile(r"[+-]?\d{1,300}\Z", re.ASCII)
_FLOAT = re.compile(r"[+-]?(\d+\.\d*|\.\d+|\d+)([eE][+-]?\d+)?\Z", re.ASCII)
_NUMERIC = frozenset("+-.0123456789")
"""The characters with which a number may begin."""
NAME = re.compile(rf"{names.NAME}\Z")


NO_COMMAS = "the language has no commas: write `distance(a to b)`, `separation(a and b)`"
NAME_A_POINT = "write `points: {there: [1, 0, 1]}` under `world`, and `world.points.there` here"
"""The hint for a point that is written out in a condition."""
NO_POINT = "a condition can't contain the coordinates of a point"
_TWO = re.compile(r"(distance|separation)\(\s*([\w.$]+)\s*,\s*([\w.$]+)\s*\)")


def no_commas(text: str) -> str:
    """Return the hint for a comma in a condition: the function call in `text` written without the
    comma, or else general examples."""
    call = _TWO.search(text)
    if call is None:
        return NO_COMMAS
    word = "to" if call[1] == "distance" else "and"
    return f"the language has no commas: write `{call[1]}({call[2]} {word} {call[3]})`"


class Scalar(NamedTuple):
    """One value.

    quoted: whether the text was in quotes, so that it is never a number. parameter: the
    `$name`, or the arithmetic with one, that the whole scalar replaced, or empty; the span is then
    that of this text.
    written: the text before parameters inside it were replaced by their values, or empty. insets:
    the values of these parameters.
    """

    text: str
    span: Span
    quoted: bool = False
    parameter: str = ""
    written: str = ""
    insets: tuple[Inset, ...] = ()

    @property
    def is_null(self) -> bool:
        return not self.quoted and self.text in _NULL

    @property
    def as_text(self) -> Text:
        """The scalar as the text of an expression or a name. Columns inside it can be computed if
        the text is in one line and exactly as written."""
        s = self.span
        if self.parameter or s.line != s.end_line:
            return Text(self.text, s, verbatim=False, written=self.written)
        excess = s.end_column - s.column - len(self.written or self.text)
        if self.quoted and excess == 2:
            s = s._replace(column=s.column + 1, end_column=s.end_column - 1)
        verbatim = excess == (2 if self.quoted else 0)
        return Text(self.text, s, verbatim, self.written, self.insets)


class MappingEntry(NamedTuple):
    """One key of a mapping with its value. inherited: whether it came through `like` or the
    defaults. used: the locations of each `like` through which a flow has the entry, outermost
    first. depth: the number of `like` steps to its origin."""

    key: Scalar
    value: Node
    inherited: bool = False
    used: tuple[Span, ...] = ()
    depth: int = 0


class Mapping(NamedTuple):
    entries: dict[str, MappingEntry]
    span: Span

    def get(self, key: str) -> Node | None:
        """Return the value of `key`, or None if the key is not written or null."""
        entry = self.entries.get(key)
        if entry is None or (isinstance(entry.value, Scalar) and entry.value.is_null):
            return None
        return entry.value


class Sequence(NamedTuple):
    items: tuple[Node, ...]
    span: Span


Node = Scalar | Mapping | Sequence


def to_json(node: Node) -> Any:
    """Return the node as JSON values for `jsonschema`, with scalars typed by the core schema of
    YAML 1.2.

    Infinities and NaN remain text, because no quantity is written that way.
    """
    if isinstance(node, Scalar):
        return _scalar_to_json(node)
    if isinstance(node, Mapping):
        return {key: to_json(entry.value) for key, entry in node.entries.items()}
    return [to_json(item) for item in node.items]


def _scalar_to_json(node: Scalar) -> str | int | float | bool | None:
    text = node.text
    if node.quoted:
        return text
    if text in _NULL:
        return None
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if text[0] not in _NUMERIC:
        return text
    if _INTEGER.match(text):
        return int(text)
    return float(text) if _FLOAT.match(text) else text


def describe(node: Node) -> str:
    """Return the kind of a node in words, for `... but this is ...`."""
    if isinstance(node, Mapping):
        return "a mapping"
    if isinstance(node, Sequence):
        return "a list"
    if node.is_null:
        return "nothing"
    value = _scalar_to_json(node)
    if isinstance(value, bool):
        return "a boolean"
    return "text" if isinstance(value, str) else "a number"


def shown_node(node: Node, most: int = 60) -> str:
    """Return the kind of a node in words with its text or length, such as `the number `7`` or `a
    list of 2`."""
    kind = describe(node)
    if isinstance(node, Sequence):
        size = len(node.items)
        return f"{kind} with one element" if size == 1 else f"{kind} of {size}"
    if not isinstance(node, Scalar) or not node.text:
        return kind
    return f"the {kind.removeprefix('a ')} `{node.text[:most]}`"


def is_null(node: Node) -> bool:
    return isinstance(node, Scalar) and node.is_null


def is_cut(node: Node) -> bool:
    """Return whether YAML ended a plain text at a comma inside parentheses."""
    return isinstance(node, Scalar) and node.text.count("(") > node.text.count(")")


def entries_of(node: Node | None) -> dict[str, MappingEntry]:
    """Return the entries of a mapping; empty for anything else."""
    return node.entries if isinstance(node, Mapping) else {}


def items_of(node: Node | None) -> tuple[Node, ...]:
    """Return the items of a list; empty for anything else."""
    return node.items if isinstance(node, Sequence) else ()


def head_of(node: Node) -> Span:
    """Return the location at which to report a missing key: the first key of the mapping, or else
    the node."""
    if isinstance(node, Mapping) and node.entries:
        return next(iter(node.entries.values())).key.span
    return node.span


def scalars_in(*nodes: Node) -> Iterator[Scalar]:
    """Yield every scalar under `nodes`; the contents of an aliased mapping or list are visited
    once."""
    waiting, seen = list(nodes), set[int]()
    while waiting:
        top = waiting.pop()
        if isinstance(top, Scalar):
            yield top
        elif id(top) not in seen:
            seen.add(id(top))
            waiting += [entry.value for entry in entries_of(top).values()] or items_of(top)


def count(node: Node, limit: int) -> int:
    """Return the number of nodes under `node` with aliases expanded; stop counting just above
    `limit`."""
    total, waiting = 0, [node]
    while waiting and total <= limit:
        total += 1
        top = waiting.pop()
        if isinstance(top, Mapping):
            waiting += [entry.value for entry in top.entries.values()]
        elif isinstance(top, Sequence):
            waiting += top.items
    return total
