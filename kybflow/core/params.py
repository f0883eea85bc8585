"""Declare a part's parameters once, with `@params` and `param`.

The YAML decoder, the JSON Schema, the tables of `kybflow parts` and the run-time options all read
this declaration: type and unit from the annotation; help, default and bounds from `param`.
"""

from __future__ import annotations

import dataclasses
import functools
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
)

from kybflow.core.errors import PartError
from kybflow.core.files import File, FilePath
from kybflow.core.sources import hints_of
from kybflow.core.units import Dimension, Vec3

T = TypeVar("T")
_KEY = "kybflow"
_ALONE = "_kybflow_alone"
RESERVED = frozenset(
    {
        "do", "use", "as", "then", "next", "failed", "within", "for", "at", "on", "inject", "when",
        "estimators", "buttons", "dead_man", "silent_after", "stuck_after",
    }
)  # fmt: skip
Tightens = Literal["up", "down"]
"""The direction in which a safety parameter becomes stricter; for a choice, along its list."""
Named = Literal["vehicle", "estimator", "input", "group"]
"""What in the mission a text may name: another vehicle, one of the vehicle's estimators, an input,
or the group with which the vehicle does this together."""
Room = Literal["across", "up"]
"""The extent of the fence that a length is held against: its longest side, or its height."""
Reads = Callable[[File], object]
"""A part's reader for a file; raises FileError when the part can't use it."""
ITEMS = {"integers": "integer", "names": "text"}
"""The shapes that are lists, each with that of its items."""
FIXED = frozenset({"path", "file", "file path", "integers"})
"""The shapes whose values no flight changes."""


@dataclass(frozen=True, slots=True)
class _Facts:
    help: str
    above: float | None
    at_least: float | None
    below: float | None
    at_most: float | None
    read_only: bool
    tightens: Tightens | None
    names: Named | None
    reads: Reads | None
    limited_by: str | None
    room: Room | None
    binary: bool


def param(
    help: str,
    *,
    default: Any = dataclasses.MISSING,
    above: float | None = None,
    at_least: float | None = None,
    below: float | None = None,
    at_most: float | None = None,
    read_only: bool = False,
    tightens: Tightens | None = None,
    names: Named | None = None,
    reads: Reads | None = None,
    limited_by: str | None = None,
    room: Room | None = None,
    binary: bool = False,
) -> Any:
    """Declare one parameter of a `@params` class.

    default and bounds are SI; bounds hold for each component of a vector. read_only: it can't
    change during a run. tightens: in flight it may change in that direction only. names: the
    compiler checks that a text names such a thing. reads: the compiler checks a file with this
    reader. limited_by: the parameter beside it that it may not exceed, or the part never succeeds.
    room: the length says nothing where it is more than half of the fence's longest side (`across`),
    or more than its height (`up`). binary: the file need not be text.
    """
    facts = _Facts(
        help, above, at_least, below, at_most, read_only, tightens, names, reads, limited_by, room,
        binary,
    )  # fmt: skip
    return dataclasses.field(default=default, metadata={_KEY: facts}, kw_only=True)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(param,))
def params(cls: type[T]) -> type[T]:
    """Make `cls` a frozen dataclass whose fields are parameters."""
    return dataclass(frozen=True)(cls)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(param,))
def declared(cls: type[T]) -> type[T]:
    """Make `cls` a frozen dataclass for a mapping of the language that is no part. Its fields may
    have `RESERVED` names, because no other keys stand beside them."""
    whole = dataclass(frozen=True)(cls)
    setattr(whole, _ALONE, True)
    return whole


@dataclass(frozen=True, slots=True)
class Field:
    """One parameter, as the compiler, the schema and the options see it.

    shape: scalar, vector, path (of vectors), integer, integers (a list), boolean, text, names (a
    list), file, file path or choice. dimension: set for the first three. choices: set for the last.
    """

    name: str
    shape: str
    dimension: Dimension | None
    choices: tuple[str, ...]
    optional: bool
    required: bool
    default: Any
    help: str
    above: float | None
    at_least: float | None
    below: float | None
    at_most: float | None
    read_only: bool
    tightens: Tightens | None = None
    names: Named | None = None
    reads: Reads | None = None
    limited_by: str | None = None
    room: Room | None = None
    binary: bool = False

    def loosens(self, before: Any, after: Any) -> bool:
        """Return whether a safety parameter, or any number of it, is less strict than before."""
        if self.tightens is None or before is None or after is None:
            return False
        if self.choices:
            before, after = self.choices.index(before), self.choices.index(after)
        pairs = zip(before, after, strict=True) if self.shape == "vector" else ((before, after),)
        return any(b > a if self.tightens == "up" else b < a for b, a in pairs)

    def named(self, value: Any, what: Named) -> tuple[str, ...]:
        """Return the names of `what` that a value of this parameter has."""
        if self.names != what or value is None:
            return ()
        return (value,) if isinstance(value, str) else tuple(value)

    def outside(self, value: float) -> str | None:
        """Return which bound `value` (SI) violates, in words, or None."""
        if self.above is not None and not value > self.above:
            return f"must be above {self.above:g}"
        if self.at_least is not None and not value >= self.at_least:
            return f"must be at least {self.at_least:g}"
        if self.below is not None and not value < self.below:
            return f"must be below {self.below:g}"
        if self.at_most is not None and not value <= self.at_most:
            return f"must be at most {self.at_most:g}"
        return None


def type_of(field: Field) -> str:
    """Return the type in words with its SI unit: `length [m]`, `path of length [m]`, `on | off`."""
    if field.choices:
        return " | ".join(field.choices)
    if field.dimension is None:
        return f"list of {field.shape}" if field.shape in ITEMS else field.shape
    name = field.dimension.name
    kind = f"{field.shape} of {name}" if field.shape in ("vector", "path") else name
    return f"{kind} [{field.dimension.si}]" if field.dimension.si else kind


@functools.cache
def fields_of(cls: Any) -> tuple[Field, ...]:
    """Return the parameters of `cls`, in order. Raises PartError for a wrong declaration."""
    hints = hints_of(cls)
    return tuple(_field(cls, f, hints[f.name]) for f in dataclasses.fields(cls))


def named_in(parameters: Any, what: Named) -> dict[str, str]:
    """Return what of `what` these parameters name, by the parameter's name."""
    return dict(names_in(parameters, what))


def names_in(parameters: Any, what: Named) -> Iterator[tuple[str, str]]:
    """Yield each name of `what` in these parameters, behind the parameter that has it."""
    for field in _naming(parameters.__class__, what):
        for name in field.named(getattr(parameters, field.name), what):
            yield field.name, name


@functools.cache
def limited_fields(cls: Any) -> tuple[Field, ...]:
    """Return the parameters of `cls` that another one limits."""
    return tuple(f for f in fields_of(cls) if f.limited_by is not None)


@functools.cache
def fields_in_rooms(cls: Any) -> tuple[Field, ...]:
    """Return the parameters of `cls` that are held against the room."""
    return tuple(f for f in fields_of(cls) if f.room is not None)


@functools.cache
def _naming(cls: Any, what: Named) -> tuple[Field, ...]:
    return tuple(f for f in fields_of(cls) if f.names == what)


def _field(cls: type, field: dataclasses.Field[Any], hint: Any) -> Field:
    facts = field.metadata.get(_KEY)
    where = f"{cls.__module__}.{cls.__name__}.{field.name}"
    if facts is None:
        raise PartError(f"{where} is declared without `param(...)`")
    if field.name in RESERVED and not getattr(cls, _ALONE, False):
        raise PartError(f"{where}: a parameter may not be called `{field.name}`")
    hint, optional = _strip_optional(hint)
    shape, dimension, choices = _shape(where, hint)
    required = field.default is dataclasses.MISSING
    default = None if required else field.default
    return Field(
        field.name, shape, dimension, choices, optional, required, default,
        facts.help, facts.above, facts.at_least, facts.below, facts.at_most, facts.read_only,
        facts.tightens, facts.names, facts.reads, facts.limited_by, facts.room, facts.binary,
    )  # fmt: skip


def _strip_optional(hint: Any) -> tuple[Any, bool]:
    if get_origin(hint) in (Union, types.UnionType):
        rest = [a for a in get_args(hint) if a is not type(None)]
        if len(rest) == 1:
            return rest[0], True
    return hint, False


def _shape(where: str, hint: Any) -> tuple[str, Dimension | None, tuple[str, ...]]:
    simple = {
        int: "integer", tuple[int, ...]: "integers", bool: "boolean", str: "text", File: "file",
        tuple[str, ...]: "names",
        FilePath: "file path",
    }  # fmt: skip
    if hint in simple:
        return simple[hint], None, ()
    if get_origin(hint) is Literal:
        return "choice", None, tuple(get_args(hint))
    if get_origin(hint) is Annotated:
        base, dimension = get_args(hint)[:2]
        shapes = {float: "scalar", Vec3: "vector", tuple[Vec3, ...]: "path"}
        if base in shapes and isinstance(dimension, Dimension):
            return shapes[base], dimension, ()
    raise PartError(
        f"{where}: a parameter can't have the type {hint!r}; use the types of kybflow.core.units"
    )
