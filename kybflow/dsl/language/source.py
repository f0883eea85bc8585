"""Records, which keep their source locations beside their values."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Self

from kybflow.dsl.diagnostics import Span, Text
from kybflow.dsl.reading.nodes import (
    Mapping,
    MappingEntry,
    Node,
    Scalar,
    entries_of,
    is_null,
    items_of,
)

NO_PLACE = Span("", 1, 1, 1, 1)
"""The span of values that are in no file."""


class Source(NamedTuple):
    """The source of a record. span: its location for reports. node: the mapping from which it was
    decoded. inherited: whether it came through `like`."""

    span: Span = NO_PLACE
    node: Mapping = Mapping({}, NO_PLACE)
    inherited: bool = False


NOWHERE = Source()


@functools.cache
def _worked_out(cls: Any) -> tuple[str, ...]:
    """Return the names of the cached properties of a class."""
    return tuple(
        name
        for base in cls.__mro__
        for name, value in vars(base).items()
        if isinstance(value, functools.cached_property)
    )


@dataclass(frozen=True)
class Record:
    """A decoded mapping of the language.

    title: its name in reports. like: the help of its key `like`, or empty if the record can't start
    from another one. others: the type of the values under any other key, None if other keys are not
    allowed. is_whole: whether a file must have the keys without a default, unless it has `like`.
    missing: the code of the finding for a missing key; a record with KYB108 is treated like a
    part's parameters and left out if one of them is wrong. least: the least number of keys. terse:
    whether its text omits defaults. block: whether its text has a line for each key. leading: the
    keys that come first.
    """

    title: ClassVar[str] = ""
    like: ClassVar[str] = ""
    others: ClassVar[object] = None
    is_whole: ClassVar[bool] = False
    missing: ClassVar[str] = "KYB102"
    least: ClassVar[int] = 0
    terse: ClassVar[bool] = False
    block: ClassVar[bool] = False
    leading: ClassVar[tuple[str, ...]] = ()

    source: Source = field(default=NOWHERE, kw_only=True, compare=False, repr=False)

    def but(self, **changes: Any) -> Self:
        """Return a copy with other values and without the cached properties."""
        copy: Self = object.__new__(self.__class__)
        values = copy.__dict__
        values.update(self.__dict__)
        own: Any = self.__class__
        for name in _worked_out(own):
            values.pop(name, None)
        values.update(changes)
        return copy

    @property
    def span(self) -> Span:
        """The source location for reports."""
        return self.source.span

    @property
    def inherited(self) -> bool:
        """Whether the record came through `like`."""
        return self.source.inherited

    def entry(self, key: str) -> MappingEntry | None:
        """Return a key with its value as written; None if the key is not written or null."""
        found = self.source.node.entries.get(key)
        return None if found is None or is_null(found.value) else found

    def is_written(self, key: str) -> bool:
        return key in self.source.node.entries

    def span_of(self, *keys: str) -> Span:
        """Return the location of a key's value. Several keys lead to a nested value:
        `span_of("start", "at")`. For a key that is not written, return the location of the
        innermost value that is."""
        node: Node = self.source.node
        span = self.source.span
        for key in keys:
            found = entries_of(node).get(key)
            if found is None:
                return span
            node = found.value
            span = node.span
        return span

    def key_span(self, key: str) -> Span:
        """Return the location of a key, or of the record if the key is not written."""
        found = self.source.node.entries.get(key)
        return self.source.span if found is None else found.key.span

    def text_of(self, key: str) -> Text | None:
        """Return the text of a key's value with its location, or None if there is none."""
        found = self.source.node.entries.get(key)
        if found is None or not isinstance(value := found.value, Scalar) or value.is_null:
            return None
        return value.as_text

    def pairs(self, key: str) -> Iterator[tuple[Text, Node]]:
        """Yield the key and the value of each entry of a mapping, with their locations."""
        written = self.entry(key)
        for entry in entries_of(None if written is None else written.value).values():
            yield entry.key.as_text, entry.value

    def texts_of(self, key: str) -> tuple[Text, ...]:
        """Return the texts of a list, each with its location."""
        found = self.entry(key)
        items = () if found is None else items_of(found.value)
        return tuple(item.as_text for item in items if isinstance(item, Scalar))
