"""Records of the language, which keep their source locations beside their values, and the types of
their values other than quantities, texts and lists: a part with its parameters, a condition, the
name of an event, a state with values. `RecordLayout` describes the keys of a record."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Self

from kybflow.core.params import Field, ListOf, RecordOf, ValueType, fields_of, is_needed
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
from kybflow.parts.events import AWAITED_EVENTS

NO_PLACE = Span("", 1, 1, 1, 1)
"""The span of values that are in no file."""
EMPTY = Mapping({}, NO_PLACE)


class Source(NamedTuple):
    """The source of a record. span: its location for reports. node: the mapping from which it was
    decoded. inherited: whether it came through `like`."""

    span: Span = NO_PLACE
    node: Mapping = EMPTY
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


@dataclass(frozen=True, eq=False)
class PartOf(ValueType):
    """The type of a part with its parameters. kind: the kind of the part. word: the key with its
    name. It is `do`, `inject` or `use`; with `use`, the name may also stand alone, and the key `as`
    is allowed. is_needed: whether that key is needed."""

    kind: str = ""
    word: str = "use"
    is_needed: bool = True


@dataclass(frozen=True, eq=False)
class AnyOf(ValueType):
    """The type of a value that is kept as written. kinds: the JSON types that it may have."""

    kinds: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class UsesOf(ListOf):
    """The type of a list of parts, or of records of parts, in which `{stack: NAME}` stands for
    several."""


CONDITION = ValueType("condition")
"""The type of an expression, which is `Unparsed` until its names are known."""
EVENT = ValueType("event")
STATE = ValueType("state")
"""The type of the name of a state or a phase."""
TITLE = ValueType("title")
"""The type of the name of a file's content, which also names the folder of a run."""
VERSION = ValueType("version")
REQUEST = ValueType("request")
"""The type of a requested state: `STATE`, or `{STATE: {PARAMETER: VALUE}}`."""
PHASE = ValueType("phase")
"""The type of a phase: `PHASE`, or `{FLOW: PHASE}`."""
SENSORS = ListOf("sensors", False, PartOf("part", False, "sensors"))
"""The type of one sensor, or a list of sensors."""
SCALARS = ("string", "number", "boolean")
OPTION_VALUE = AnyOf("value", kinds=(*SCALARS, "array"))
"""The type of an option's value, which is decoded by the declaration of the option."""
EVENT_FIELD = AnyOf("field", kinds=SCALARS)
"""The type of the value that a field of an event must have; the key is the field's name."""


def part_of(kind: str, word: str = "use", is_needed: bool = True) -> PartOf:
    """Return the type of a part: `Annotated[PartPlan, part_of("inputs")]`."""
    return PartOf("part", False, kind, word, is_needed)


def record_of(cls: Any) -> RecordOf:
    """Return the type of a record."""
    return RecordOf("mapping", False, cls)


class RecordLayout(NamedTuple):
    """The keys of a record.

    keys: every key that may be written, including those of a flat record, `like`, `as` and the name
    of its part. own: the keys that belong to a field. computed: the fields without a key. needed:
    the keys that a file must have unless it has `like`. required: the fields without a default.
    part, part_name: the part that the record names, and the field for that part. flat: the field
    with the flat record. others: the type of the values under any other key, None if other keys are
    not allowed. least: the least number of keys.
    """

    keys: dict[str, Field]
    own: dict[str, Field]
    computed: frozenset[str]
    needed: tuple[str, ...]
    required: tuple[Field, ...] = ()
    part: PartOf | None = None
    part_name: str = ""
    flat: Field | None = None
    others: ValueType | None = None
    least: int = 0


_ALIAS = Field("Another name, needed if the same part is used twice.", key="as")


@functools.cache
def layout_of(cls: Any) -> RecordLayout:
    """Return the layout of a record, or of a part's parameters."""
    fields, others = fields_of(cls), getattr(cls, "others", None)
    keys: dict[str, Field] = {}
    own: dict[str, Field] = {}
    part, part_name, flat = None, "", None
    if getattr(cls, "like", ""):
        keys["like"] = Field(cls.like, key="like")
    for one in fields:
        kind = one.type
        if isinstance(kind, RecordOf) and kind.flat:
            flat = one
            keys |= {inner.key: inner for inner in fields_of(kind.cls)}
        elif isinstance(kind, PartOf) and kind.word == one.key:
            part, part_name = kind, one.name
            keys |= part_layout(kind, one.help).keys
        else:
            keys[one.key] = own[one.key] = one
    if others is EVENT_FIELD:
        others = None
        for name in sorted({name for event in AWAITED_EVENTS.values() for name in event.fields}):
            about = f"Only events with this `{name}`."
            keys.setdefault(name, Field(about, type=EVENT_FIELD, key=name))
    needed = [f.key for f in fields if is_needed(cls, f)]
    if part is not None and not part.is_needed:
        needed = [key for key in needed if key != part.word]
    required = tuple(one for one in fields if one.required)
    least = getattr(cls, "least", 0)
    computed = frozenset(cls.__dataclass_fields__) - {one.name for one in fields}
    return RecordLayout(
        keys, own, computed, tuple(needed), required, part, part_name, flat, others, least
    )


@functools.cache
def part_layout(kind: PartOf, help: str = "Name of the part.") -> RecordLayout:
    """Return the layout of a part's mapping: the fixed keys, and the part's parameters as further
    keys."""
    keys = {kind.word: Field(help, key=kind.word)}
    if kind.word == "use":
        keys["as"] = _ALIAS
    return RecordLayout(keys, {}, frozenset(), (kind.word,) if kind.is_needed else (), part=kind)
