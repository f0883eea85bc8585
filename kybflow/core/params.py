"""Declarations of records. A record is a mapping in YAML; its class is a frozen dataclass whose
fields are the keys of the mapping.

A part's parameters (`@params`, `param`) and the records of the mission language (`@record`, `key`)
work alike. The annotation of a field gives the type of its value; `key` gives its help, default and
bounds. The YAML decoder, the JSON Schema, the YAML writer, the tables of the docs, completion and
the run-time options all follow from this declaration.
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
    ParamSpec,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
)

from kybflow.core.errors import PartError
from kybflow.core.files import File, FilePath
from kybflow.core.matrices import asymmetry, is_positive_definite
from kybflow.core.sources import hints_of
from kybflow.core.units import NUMBER, Dimension, MatrixOf, RowsOfNumbers, Vec3

T = TypeVar("T")
_KEY = "kybflow"
_LANGUAGE = "_kybflow_language"
RESERVED = frozenset(
    {
        "do", "use", "as", "then", "next", "failed", "within", "for", "at", "on", "inject", "when",
        "estimators", "buttons", "dead_man", "silent_after", "stuck_after", "healthy",
        "recover_after", "for_at_most",
    }
)  # fmt: skip
Tightens = Literal["up", "down"]
"""The direction in which a safety parameter becomes stricter; for a choice, the direction along its
list of words."""
Named = Literal["vehicle", "estimator", "input", "group", "object", "surface"]
"""What a text parameter may name: another vehicle, one of the vehicle's estimators, an input, the
group of vehicles that fly the behavior together, an object of the world, or a surface,
`OBJECT.SURFACE`, that the behavior means to touch."""
Room = Literal["across", "up", "floor"]
"""The extent of the fence with which a length is compared: its longest side, or its height. A
`floor` is a height below which the behavior doesn't fly."""
NamesLike = Literal["name", "dotted", "any"]
"""Which names a mapping may have as keys: `a`, `a` and `a.b`, or any text."""
Reads = Callable[[File], object]
"""A function of a part that parses a file; raises FileError if the part can't use the file."""


@dataclass(frozen=True, eq=False)
class ValueType:
    """The type of a key's value. shape: the word for it in docs. fixed: whether the value can't
    change during a run."""

    shape: str
    fixed: bool = False


_NOTHING = ValueType("nothing")


@dataclass(frozen=True, eq=False)
class Numbers(ValueType):
    """One or more numbers of one dimension. size: () for a scalar, (3,) for a vector, (None, 3) for
    a path, (rows, columns) for a matrix. The value is a float, or nested tuples of floats."""

    dimension: Dimension = NUMBER
    size: tuple[int | None, ...] = ()


@dataclass(frozen=True, eq=False)
class Choice(ValueType):
    """A choice of one of several words."""

    words: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ListOf(ValueType):
    """A list of values of one type, decoded as a tuple."""

    item: ValueType = _NOTHING


@dataclass(frozen=True, eq=False)
class MappingOf(ValueType):
    """A mapping from names that the author chooses to values of one type, decoded as a dict, or as
    a tuple of records that hold their names."""

    item: ValueType = _NOTHING
    as_dict: bool = True


@dataclass(frozen=True, eq=False)
class RecordOf(ValueType):
    """A nested record. flat: its keys are written beside those of the containing record, instead of
    in their own mapping. or_name: the name of such a record may replace it."""

    cls: Any = None
    flat: bool = False
    or_name: bool = False


NAMED, FLAT, OR_NAME = ValueType("named"), ValueType("flat"), ValueType("name")
"""Markers for annotations. `Annotated[tuple[InputPlan, ...], NAMED]` is a mapping from names to
records, kept in order. The keys of `Annotated[Airframe, FLAT]` are written beside those of the
containing record. `Annotated[World, OR_NAME]` may be written as a record or as the name of one."""
INTEGER, BOOLEAN, TEXT = ValueType("integer"), ValueType("boolean"), ValueType("text")
_SEVERAL = {INTEGER: "integers", TEXT: "names"}
FILE, FILE_PATH = ValueType("file", True), ValueType("file path", True)
_TYPES: dict[Any, ValueType] = {
    int: INTEGER,
    bool: BOOLEAN,
    str: TEXT,
    File: FILE,
    FilePath: FILE_PATH,
    tuple[int, ...]: ListOf("integers", True, INTEGER),
    tuple[str, ...]: ListOf("names", False, TEXT),
}
_SIZES: dict[Any, tuple[str, tuple[int | None, ...]]] = {
    float: ("scalar", ()),
    Vec3: ("vector", (3,)),
    tuple[Vec3, ...]: ("path", (None, 3)),
}


def numbers(dimension: Dimension, shape: str = "scalar") -> Numbers:
    """Return the type of a scalar, a vector or a path of `dimension`."""
    size = next(size for name, size in _SIZES.values() if name == shape)
    return Numbers(shape, shape == "path", dimension, size)


@dataclass(frozen=True)
class Field:
    """One key of a record, or one parameter of a part. `key` declares it; `name`, `type`,
    `optional` and `required` follow from the declaration.

    name: the field's name in Python. type: the type of its value. optional: whether the value may
    be null. default, above, at_least, below, at_most: the default and the bounds in SI; the bounds
    apply to each number of a vector or matrix. is_definite: whether a matrix must be symmetric and
    positive definite. read_only: whether the value can't change during a run. tightens: the only
    direction in which the value may change in flight. names: what the value names; the compiler
    checks that it exists. reads: the function with which the compiler checks a file. limited_by:
    another parameter of the part that this one must not exceed, because the part would never
    succeed. only_with: another parameter without which this one has no effect. only_for: the
    values of that parameter with which it has one; by default any but null. room: the extent of the
    fence with which the length is compared; the length has no effect if it is more than half of
    the longest side (`across`) or more than the height (`up`). A `floor` is also compared with the
    height at which the behavior is entered.
    binary: whether the file may be other than text. key: the key in YAML, if it differs from the
    name. examples: values that editors offer. each, each_examples: the help and the examples for
    each item of a list or mapping. least: the least number of items. needed: whether a file must
    have the key; by default, a key without a default in a whole record is needed. names_like: which
    names the mapping may have as keys.
    """

    help: str = ""
    _: dataclasses.KW_ONLY
    name: str = ""
    type: ValueType = TEXT
    optional: bool = False
    required: bool = False
    default: Any = None
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    is_definite: bool = False
    read_only: bool = False
    tightens: Tightens | None = None
    names: Named | None = None
    reads: Reads | None = None
    limited_by: str | None = None
    only_with: str | None = None
    only_for: tuple[str, ...] = ()
    room: Room | None = None
    binary: bool = False
    key: str = ""
    examples: tuple[Any, ...] = ()
    each: str = ""
    each_examples: tuple[Any, ...] = ()
    least: int = 0
    needed: bool | None = None
    names_like: NamesLike = "name"

    @functools.cached_property
    def shape(self) -> str:
        """The word for the type of the value: scalar, vector, path, matrix, integer, integers (a
        list), boolean, text, names (a list), file, file path, choice, or a word of the mission
        language."""
        return self.type.shape

    @functools.cached_property
    def dimension(self) -> Dimension | None:
        """The dimension of the field's numbers; None for any other type."""
        return self.type.dimension if isinstance(self.type, Numbers) else None

    @functools.cached_property
    def choices(self) -> tuple[str, ...]:
        """The words of a choice; empty for any other type."""
        return self.type.words if isinstance(self.type, Choice) else ()

    def numbers(self, value: Any) -> tuple[float, ...]:
        """Return every number of a value: the entries of a vector, path or matrix in order, or the
        index of a choice in its list. The result is empty for None and for values without
        numbers."""
        if value is None:
            return ()
        if self.choices:
            return (float(self.choices.index(value)),)
        if isinstance(value, tuple):
            return tuple(number for item in value for number in self.numbers(item))
        return (float(value),) if isinstance(value, int | float) else ()

    def loosens(self, before: Any, after: Any) -> bool:
        """Return whether a safety parameter, or any of its numbers, is less strict after than
        before."""
        if self.tightens is None or before is None or after is None:
            return False
        pairs = zip(self.numbers(before), self.numbers(after), strict=True)
        return any(b > a if self.tightens == "up" else b < a for b, a in pairs)

    def named(self, value: Any, what: Named) -> tuple[str, ...]:
        """Return the names of the given kind that a value of this parameter contains."""
        if self.names != what or value is None:
            return ()
        return (value,) if isinstance(value, str) else tuple(value)

    def is_within(self, value: float) -> bool:
        """Return whether `value` (SI) is within the bounds."""
        return (
            (self.above is None or value > self.above)
            and (self.at_least is None or value >= self.at_least)
            and (self.below is None or value < self.below)
            and (self.at_most is None or value <= self.at_most)
        )

    def flaw(self, value: Any) -> str | None:
        """Return why a value is invalid although each of its numbers is within the bounds, or None.
        A matrix may have to be symmetric and positive definite."""
        if not self.is_definite or value is None:
            return None
        if (place := asymmetry(value)) is not None:
            i, j = place
            return (
                f"must be symmetric, but row {i + 1} has {value[i][j]:g} in column {j + 1}"
                f" and row {j + 1} has {value[j][i]:g} in column {i + 1}"
            )
        if not is_positive_definite(value):
            return "must be positive definite, with every eigenvalue above 0"
        return None


_P = ParamSpec("_P")


def _declares(make: Callable[_P, Field]) -> Callable[_P, Any]:
    """Return a function that takes the arguments of `make` and declares a dataclass field with the
    `Field` that `make` returns."""

    def key(*args: _P.args, **facts: _P.kwargs) -> Any:
        field = make(*args, **facts)
        kept: dict[str, Any] = {"default": facts.get("default", dataclasses.MISSING)}
        if isinstance(field.default, dict):
            kept = {"default_factory": field.default.copy}
        return dataclasses.field(metadata={_KEY: field}, kw_only="default" in facts, **kept)

    return key


key = _declares(Field)
"""Declare one key of a record. The arguments are the fields of `Field`."""
param = key
"""Declare one parameter of a part; identical to `key`."""


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(key, param))
def params(cls: type[T]) -> type[T]:
    """Make `cls` a frozen dataclass whose fields are the parameters of a part."""
    return dataclass(frozen=True)(cls)


@dataclass_transform(
    frozen_default=True, kw_only_default=True, field_specifiers=(key, dataclasses.field)
)
def record(title: str = "", **facts: Any) -> Callable[[type[T]], type[T]]:
    """Return a decorator that makes a class a frozen dataclass for one mapping of the mission
    language.

    title: what reports call the mapping. facts: class attributes, described in `Record`. The keys
    may have `RESERVED` names, unlike the parameters of a part. Fields without `key` are computed by
    the compiler.
    """

    def made(cls: type[T]) -> type[T]:
        whole = dataclass(frozen=True)(cls)
        for name, fact in {**facts, "title": title, _LANGUAGE: True}.items():
            setattr(whole, name, fact)
        return whole

    return made


def type_of(field: Field) -> str:
    """Return a field's type in words with its SI unit: `length [m]`, `path of length [m]`, `on |
    off`."""
    kind = field.type
    if isinstance(kind, Choice):
        return " | ".join(kind.words)
    if isinstance(kind, Numbers):
        name = kind.dimension.name
        if kind.shape == "matrix":
            definite = "positive definite " if field.is_definite else ""
            name = f"{definite}{kind.size[0]} x {kind.size[1]} matrix of {name}"
        elif kind.size:
            name = f"{kind.shape} of {name}"
        return f"{name} [{kind.dimension.si}]" if kind.dimension.si else name
    if isinstance(kind, ListOf):
        return f"list of {_SEVERAL.get(kind.item, kind.item.shape)}"
    return kind.shape


def is_needed(cls: Any, field: Field) -> bool:
    """Return whether a file must have a key. A key without a default is needed in a part or a whole
    record; in other records, `like` may provide it."""
    if field.needed is not None:
        return field.needed
    return field.required and getattr(cls, "is_whole", True)


@functools.cache
def fields_of(cls: Any) -> tuple[Field, ...]:
    """Return the keys of a record, in order. Raises PartError for a wrong declaration."""
    hints = hints_of(cls)
    is_language = getattr(cls, _LANGUAGE, False)
    declared = [f for f in dataclasses.fields(cls) if _KEY in f.metadata or not is_language]
    fields = [_field(cls, f, hints[f.name], is_language) for f in declared]
    first = getattr(cls, "leading", ())
    return tuple(sorted(fields, key=lambda f: first.index(f.key) if f.key in first else len(first)))


def named_in(parameters: Any, what: Named) -> dict[str, str]:
    """Return the names of the given kind in these parameters, by the name of the parameter."""
    return dict(names_in(parameters, what))


def names_in(parameters: Any, what: Named) -> Iterator[tuple[str, str]]:
    """Yield (parameter, name) for each name of the given kind in these parameters."""
    for field in fields_with(parameters.__class__, "names"):
        for name in field.named(getattr(parameters, field.name), what):
            yield field.name, name


@functools.cache
def fields_with(
    cls: Any, *facts: Literal["limited_by", "only_with", "room", "names"]
) -> tuple[Field, ...]:
    """Return the parameters of `cls` that declare any of the facts."""
    return tuple(f for f in fields_of(cls) if any(getattr(f, fact) for fact in facts))


def _field(cls: type, declared: dataclasses.Field[Any], hint: Any, is_language: bool) -> Field:
    facts: Field | None = declared.metadata.get(_KEY)
    where = f"{cls.__module__}.{cls.__name__}.{declared.name}"
    if facts is None:
        raise PartError(f"{where} is declared without `param(...)`")
    if declared.name in RESERVED and not is_language:
        raise PartError(f"{where}: a parameter may not be called `{declared.name}`")
    kind, optional = _type(where, hint)
    sides = kind.size if isinstance(kind, Numbers) and kind.shape == "matrix" else ()
    if facts.is_definite and len(set(sides)) != 1:
        raise PartError(f"{where}: only a square matrix is positive definite")
    default, factory = declared.default, declared.default_factory
    if factory is not dataclasses.MISSING:
        default = factory()
    required = default is dataclasses.MISSING
    return dataclasses.replace(
        facts, name=declared.name, key=facts.key or declared.name, type=kind, optional=optional,
        required=required, default=None if required else default,
    )  # fmt: skip


def _type(where: str, hint: Any) -> tuple[ValueType, bool]:
    """Return the type that `hint` declares, and whether the value may be None. Raises PartError for
    a hint that declares no type."""
    if _is_optional(hint):
        rest = [a for a in get_args(hint) if a is not type(None)]
        if len(rest) == 1:
            return _type(where, rest[0])[0], True
    marks = hint.__metadata__ if get_origin(hint) is Annotated else ()
    plain = get_args(hint)[0] if marks else hint
    kind = _marked(where, plain, marks[0]) if marks else _plain(where, plain)
    if kind is None:
        raise PartError(
            f"{where}: a parameter can't have the type {hint!r}; "
            "use the types of kybflow.core.units"
        )
    return kind, _is_optional(plain)


def _marked(where: str, hint: Any, mark: Any) -> ValueType | None:
    """Return the type that a hint has with a marker of `Annotated`; None if the two don't match."""
    if mark is FLAT or mark is OR_NAME:
        return RecordOf("mapping", False, hint, mark is FLAT, mark is OR_NAME)
    if mark is NAMED:
        return MappingOf("mapping", False, _type(where, get_args(hint)[0])[0], False)
    if isinstance(mark, ValueType):
        return mark
    if hint == RowsOfNumbers and isinstance(mark, MatrixOf):
        return Numbers("matrix", False, mark.dimension, (mark.rows, mark.columns))
    if hint in _SIZES and isinstance(mark, Dimension):
        return numbers(mark, _SIZES[hint][0])
    return None


def _plain(where: str, hint: Any) -> ValueType | None:
    """Return the type of a hint without a marker; None if there is no such type."""
    if hint in _TYPES:
        return _TYPES[hint]
    if getattr(hint, _LANGUAGE, False):
        return RecordOf("mapping", False, hint)
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Literal:
        return Choice("choice", False, arguments)
    if origin is dict:
        return MappingOf("mapping", False, _type(where, arguments[1])[0])
    if origin is tuple and arguments[1:] == (...,):
        return ListOf("list", True, _type(where, arguments[0])[0])
    return None


def _is_optional(hint: Any) -> bool:
    return get_origin(hint) in (Union, types.UnionType) and type(None) in get_args(hint)
