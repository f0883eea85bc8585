"""The place of a record in the text, kept beside its values."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Self

from kybflow.dsl.diagnostics.spans import Span, Text
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
"""The place of values that no file has."""


class Source(NamedTuple):
    """What a record was decoded from: the place to report, its mapping, and whether it came through
    `like`."""

    span: Span = NO_PLACE
    node: Mapping = Mapping({}, NO_PLACE)
    inherited: bool = False


NOWHERE = Source()


@functools.cache
def _worked_out(cls: Any) -> tuple[str, ...]:
    """The cached properties of a class."""
    return tuple(
        name
        for base in cls.__mro__
        for name, value in vars(base).items()
        if isinstance(value, functools.cached_property)
    )


@dataclass(frozen=True)
class Record:
    """A decoded mapping of the language.

    title: its name in reports. like: the help of its key `like`, where it may start from another.
    others: the type of values under any other key, where such keys are allowed. is_whole: a file
    must have its keys without a default, unless it has `like`. missing: the code for a key that is
    still missing; with KYB108 it is treated as a part's parameters and left out where one is wrong.
    least: the least number of keys. terse: its text leaves out defaults. block: its text has a line
    for each key.
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
        """A copy with other values and without cached properties."""
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
        """The place to report."""
        return self.source.span

    @property
    def inherited(self) -> bool:
        """Whether it came through `like`."""
        return self.source.inherited

    def entry(self, key: str) -> MappingEntry | None:
        """A key as it is written; None for one that is not, or is null."""
        found = self.source.node.entries.get(key)
        return None if found is None or is_null(found.value) else found

    def is_written(self, key: str) -> bool:
        return key in self.source.node.entries

    def span_of(self, *keys: str) -> Span:
        """The place of a key's value, `span_of("start", "at")` inside of it; the record's where it
        is not written."""
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
        """The place of a key; the record's where it is not written."""
        found = self.source.node.entries.get(key)
        return self.source.span if found is None else found.key.span

    def text_of(self, key: str) -> Text | None:
        """The text of a key's value with its place; None where there is none."""
        found = self.source.node.entries.get(key)
        if found is None or not isinstance(value := found.value, Scalar) or value.is_null:
            return None
        return value.as_text

    def pairs(self, key: str) -> Iterator[tuple[Text, Node]]:
        """(name, value) of each entry of a mapping, with their places."""
        written = self.entry(key)
        for entry in entries_of(None if written is None else written.value).values():
            yield entry.key.as_text, entry.value

    def texts_of(self, key: str) -> tuple[Text, ...]:
        """The texts of a list, each with its place."""
        found = self.entry(key)
        items = () if found is None else items_of(found.value)
        return tuple(item.as_text for item in items if isinstance(item, Scalar))
