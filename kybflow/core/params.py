"""Declares a record once: a mapping of YAML as a frozen dataclass whose fields are its keys.

A part's parameters (`@params`, `param`) and the records of the mission language (`@record`, `key`)
work alike. The annotation gives the type of a value, `key` its help, default and bounds. The YAML
decoder, the JSON Schema, the text that reads back, the tables of the docs, completion and the
run-time options all follow from this declaration.
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
"""The direction in which a safety parameter becomes stricter; for a choice, along its list."""
Named = Literal["vehicle", "estimator", "input", "group"]
"""What in the mission a text may name: another vehicle, one of the vehicle's estimators, an input,
or the group with which the vehicle does this together."""
Room = Literal["across", "up"]
"""The extent of the fence that a length is held against: its longest side, or its height."""
NamesLike = Literal["name", "dotted", "any"]
"""What the names of a mapping are like: `a`, `a.b`, or anything."""
Reads = Callable[[File], object]
"""A part's reader for a file; raises FileError when the part can't use it."""


@dataclass(frozen=True, eq=False)
class ValueType:
    """The type of a key's value. `shape` is its word in docs; a `fixed` value can't change during a
    run."""

    shape: str
    fixed: bool = False


_NOTHING = ValueType("nothing")


@dataclass(frozen=True, eq=False)
class Numbers(ValueType):
    """Numbers of one dimension: `size` is () for one, (3,) for a vector, (None, 3) for a path and
    (rows, columns) for a matrix. The value is a float, or tuples of them."""

    dimension: Dimension = NUMBER
    size: tuple[int | None, ...] = ()


@dataclass(frozen=True, eq=False)
class Choice(ValueType):
    """One of several words."""

    words: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ListOf(ValueType):
    """A list of values of one type, as a tuple."""

    item: ValueType = _NOTHING


@dataclass(frozen=True, eq=False)
class MappingOf(ValueType):
    """Values of one type by the author's names: a dict, or a tuple of records that know their
    names."""

    item: ValueType = _NOTHING
    as_dict: bool = True


@dataclass(frozen=True, eq=False)
class RecordOf(ValueType):
    """The mapping of another record. A `flat` record has its keys beside those of the record that
    holds it. `or_name`: its name may replace it."""

    cls: Any = None
    flat: bool = False
    or_name: bool = False


NAMED, FLAT, OR_NAME = ValueType("named"), ValueType("flat"), ValueType("name")
"""Marks: `Annotated[tuple[InputPlan, ...], NAMED]` is a mapping of names to records, which are kept
in order; `Annotated[Airframe, FLAT]` has its keys beside those of the record that holds it;
`Annotated[World, OR_NAME]` may be the name of one."""
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
    """One key of a record, or one parameter of a part. `key` declares it; name, type, optional and
    required follow from the declaration.

    name: the field's name in Python. type: the type of its value. optional: it may be null. default
    and bounds are SI; bounds hold for each number of a vector or matrix. is_definite: a matrix is
    symmetric and positive definite. read_only: it can't change during a run. tightens: in flight it
    may change in that direction only. names: the compiler checks that such a thing exists. reads:
    the compiler checks a file with this reader. limited_by: another parameter that it may not
    exceed, or the part never succeeds. room: the length has no effect where it is more than half of
    the fence's longest side (`across`), or more than its height (`up`). binary: the file need not
    be text. key: its spelling in YAML, where Python forbids the field's name. examples: values that
    editors offer. each: what each item of a list or a mapping is, with `each_examples`. least: the
    least number of items. needed: whether a file must have it; by default, a key without a default
    of a whole record. names_like: how the names of a mapping are formed.
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
        """scalar, vector, path, matrix, integer, integers (a list), boolean, text, names (a list),
        file, file path, choice, or that of a type of the language."""
        return self.type.shape

    @functools.cached_property
    def dimension(self) -> Dimension | None:
        """The dimension of its numbers; None for anything else."""
        return self.type.dimension if isinstance(self.type, Numbers) else None

    @functools.cached_property
    def choices(self) -> tuple[str, ...]:
        """The words of a choice; none for anything else."""
        return self.type.words if isinstance(self.type, Choice) else ()

    def numbers(self, value: Any) -> tuple[float, ...]:
        """Return every number of a value: of a vector, path or matrix in order, of a choice its
        place in the list; none for None and for what has no numbers."""
        if value is None:
            return ()
        if self.choices:
            return (float(self.choices.index(value)),)
        if isinstance(value, tuple):
            return tuple(number for item in value for number in self.numbers(item))
        return (float(value),) if isinstance(value, int | float) else ()

    def loosens(self, before: Any, after: Any) -> bool:
        """Return whether a safety parameter, or any number of it, is less strict than before."""
        if self.tightens is None or before is None or after is None:
            return False
        pairs = zip(self.numbers(before), self.numbers(after), strict=True)
        return any(b > a if self.tightens == "up" else b < a for b, a in pairs)

    def named(self, value: Any, what: Named) -> tuple[str, ...]:
        """Return the names of `what` that a value of this parameter has."""
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
        """Return why a value whose numbers are within bounds is wrong as a whole, or None: a matrix
        may have to be symmetric and positive definite."""
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
    """What declares a key: a dataclass's field with the facts that `make` takes."""

    def key(*args: _P.args, **facts: _P.kwargs) -> Any:
        field = make(*args, **facts)
        kept: dict[str, Any] = {"default": facts.get("default", dataclasses.MISSING)}
        if isinstance(field.default, dict):
            kept = {"default_factory": field.default.copy}
        return dataclasses.field(metadata={_KEY: field}, kw_only="default" in facts, **kept)

    return key


key = _declares(Field)
"""Declares one key of a record, with the facts of its `Field`."""
param = key
"""A part's parameter is a key of its mapping."""


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(key, param))
def params(cls: type[T]) -> type[T]:
    """Make `cls` a frozen dataclass whose fields are the parameters of a part."""
    return dataclass(frozen=True)(cls)


@dataclass_transform(
    frozen_default=True, kw_only_default=True, field_specifiers=(key, dataclasses.field)
)
def record(title: str = "", **facts: Any) -> Callable[[type[T]], type[T]]:
    """Make a class a frozen dataclass for a mapping of the language that is no part, called `title`
    in reports. Its keys may have `RESERVED` names, because it has no parameters beside them; the
    compiler computes fields without `key`. `facts`: see `Record`."""

    def made(cls: type[T]) -> type[T]:
        whole = dataclass(frozen=True)(cls)
        for name, fact in {**facts, "title": title, _LANGUAGE: True}.items():
            setattr(whole, name, fact)
        return whole

    return made


def type_of(field: Field) -> str:
    """Return the type in words with its SI unit: `length [m]`, `path of length [m]`, `on | off`."""
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
    """Return whether a file must have a key: a part's or a whole record's without a default. What
    other records lack, `like` may bring."""
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
    """Return what of `what` these parameters name, by the parameter's name."""
    return dict(names_in(parameters, what))


def names_in(parameters: Any, what: Named) -> Iterator[tuple[str, str]]:
    """Yield each name of `what` in these parameters, behind the parameter that has it."""
    for field in fields_with(parameters.__class__, "names"):
        for name in field.named(getattr(parameters, field.name), what):
            yield field.name, name


@functools.cache
def fields_with(cls: Any, fact: Literal["limited_by", "room", "names"]) -> tuple[Field, ...]:
    """Return the parameters of `cls` that declare `fact`."""
    return tuple(field for field in fields_of(cls) if getattr(field, fact) is not None)


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
    """(the type that `hint` declares, whether the value may be None)."""
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
    """The type that a mark of `Annotated` makes of a hint."""
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
    """The type of a hint without a mark."""
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
