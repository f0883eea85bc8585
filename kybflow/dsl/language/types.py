"""What a value of the language may be beside quantities, texts and lists: `use: NAME` with a part's
parameters beside it, a condition, the name of an event, a state with values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from kybflow.core.params import ListOf, RecordOf, ValueType


@dataclass(frozen=True, eq=False)
class PartOf(ValueType):
    """A part of a kind, whose parameters are keys beside its name. `word` is the key that names it:
    `use`, which may stand alone as a text and has `as` beside it, `do` or `inject`."""

    kind: str = ""
    word: str = "use"
    is_needed: bool = True


@dataclass(frozen=True, eq=False)
class AnyOf(ValueType):
    """A value that is kept as it is written, of one of these types of JSON."""

    kinds: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class UsesOf(ListOf):
    """A list of parts, or of records of parts, in which `{stack: NAME}` stands for several."""


CONDITION = ValueType("condition")
"""An expression; `Unparsed` until its names are known."""
EVENT = ValueType("event")
STATE = ValueType("state")
"""The name of a state or a phase."""
TITLE = ValueType("title")
"""The name of a file's content; a run's folder is called by it."""
VERSION = ValueType("version")
REQUEST = ValueType("request")
"""A state, or `{STATE: {PARAMETER: VALUE}}`."""
PHASE = ValueType("phase")
"""A phase, or `{FLOW: PHASE}`."""
SENSORS = ListOf("sensors", False, PartOf("part", False, "sensors"))
"""One sensor, or a list of them."""
SCALARS = ("string", "number", "boolean")
OPTION_VALUE = AnyOf("value", kinds=(*SCALARS, "array"))
"""The value of an option, which only the option can decode."""
EVENT_FIELD = AnyOf("field", kinds=SCALARS)
"""What the field of an event must be; the key is the field's name."""


def part_of(kind: str, word: str = "use", is_needed: bool = True) -> PartOf:
    """Return the type of a part: `Annotated[PartPlan, part_of("inputs")]`."""
    return PartOf("part", False, kind, word, is_needed)


def record_of(cls: Any) -> RecordOf:
    """Return the type of a record."""
    return RecordOf("mapping", False, cls)
