"""The types of values of the language other than quantities, texts and lists: a part with its
parameters, a condition, the name of an event, a state with values. `RecordLayout` describes the
keys of a record."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

from kybflow.core.params import Field, ListOf, RecordOf, ValueType, fields_of, is_needed
from kybflow.parts.events import AWAITED_EVENTS


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


_ALIAS = Field("A name of its own, when the same part is used twice.", key="as")


@functools.cache
def layout_of(cls: Any) -> RecordLayout:
    """Return the layout of a record, or of a part's parameters."""
    fields, others = fields_of(cls), getattr(cls, "others", None)
    keys: dict[str, Field] = {}
    own: dict[str, Field] = {}
    part, part_name, flat = None, "", None
    if getattr(cls, "like", ""):
        keys["like"] = Field(cls.like, key="like")
    for field in fields:
        kind = field.type
        if isinstance(kind, RecordOf) and kind.flat:
            flat = field
            keys |= {inner.key: inner for inner in fields_of(kind.cls)}
        elif isinstance(kind, PartOf) and kind.word == field.key:
            part, part_name = kind, field.name
            keys |= part_layout(kind, field.help).keys
        else:
            keys[field.key] = own[field.key] = field
    if others is EVENT_FIELD:
        others = None
        for name in sorted({name for event in AWAITED_EVENTS.values() for name in event.fields}):
            about = f"Only when the event's `{name}` is this."
            keys.setdefault(name, Field(about, type=EVENT_FIELD, key=name))
    needed = [f.key for f in fields if is_needed(cls, f)]
    if part is not None and not part.is_needed:
        needed = [key for key in needed if key != part.word]
    required = tuple(field for field in fields if field.required)
    least = getattr(cls, "least", 0)
    computed = frozenset(cls.__dataclass_fields__) - {field.name for field in fields}
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
