"""`@params`: a part's parameters, written once.

From the declaration come the decoding of the YAML, the JSON Schema, the table that `kybflow parts`
prints, and the option at run time: type and unit from the annotation, help, default and bounds from
`param`.
"""

from __future__ import annotations

import dataclasses
import functools
import types
from collections.abc import Callable
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
    get_type_hints,
)

from kybflow.core.errors import PartError
from kybflow.core.files import File, FilePath
from kybflow.core.units import Dimension, Vec3

T = TypeVar("T")
_KEY = "kybflow"
_ALONE = "_kybflow_alone"
RESERVED = frozenset(
    {
        "do", "use", "as", "then", "next", "failed", "within", "for", "at", "on", "inject", "when",
        "estimators",
    }
)  # fmt: skip
Tightens = Literal["up", "down"]
"""The direction in which a safety parameter becomes stricter; a choice becomes so along its
list."""
Named = Literal["vehicle", "estimator"]
"""What of the mission a text can be the name of: another vehicle, an estimator of the vehicle."""
Reads = Callable[[File], object]
"""What a part makes of a file; raises FileError for one that it can't use."""


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
) -> Any:
    """A parameter: its help, its default (SI) and its bounds (SI; for a vector they hold for each
    number). One that `tightens` changes in that direction only while its vehicle flies. A text that
    `names` something of the mission is checked to be such a name; a file is checked by what the
    part `reads` it with."""
    facts = _Facts(help, above, at_least, below, at_most, read_only, tightens, names, reads)
    return dataclasses.field(default=default, metadata={_KEY: facts}, kw_only=True)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(param,))
def params(cls: type[T]) -> type[T]:
    """Make `cls` a frozen value whose fields are parameters."""
    return dataclass(frozen=True)(cls)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(param,))
def declared(cls: type[T]) -> type[T]:
    """The same for a mapping of the language that is no part: no key stands beside its own, so that
    they may be called as they like."""
    whole = dataclass(frozen=True)(cls)
    setattr(whole, _ALONE, True)
    return whole


@dataclass(frozen=True, slots=True)
class Field:
    """One parameter, as the compiler, the schema and the options see it.

    shape is one of: scalar, vector, path (of vectors), integer, integers (a list of them), boolean,
    text, file, file path, choice.
    `dimension` is set for the first three; `choices` for the last.
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

    def loosens(self, before: Any, after: Any) -> bool:
        """Whether a safety parameter is less strict with `after` than with `before`; of a vector,
        in any of its numbers."""
        if self.tightens is None or before is None or after is None:
            return False
        if self.choices:
            before, after = self.choices.index(before), self.choices.index(after)
        pairs = zip(before, after, strict=True) if self.shape == "vector" else ((before, after),)
        return any(b > a if self.tightens == "up" else b < a for b, a in pairs)

    def outside(self, value: float) -> str | None:
        """Which bound `value` (SI) breaks, in words, or None."""
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
    """The type in words, with its SI unit: `length [m]`, `path of length [m]`, `warn | land`."""
    if field.choices:
        return " | ".join(field.choices)
    if field.dimension is None:
        return "list of integers" if field.shape == "integers" else field.shape
    name = field.dimension.name
    kind = f"{field.shape} of {name}" if field.shape in ("vector", "path") else name
    return f"{kind} [{field.dimension.si}]" if field.dimension.si else kind


@functools.cache
def fields_of(cls: Any) -> tuple[Field, ...]:
    """The parameters that `cls` declares, in order. Raises PartError when a declaration is
    wrong."""
    hints = get_type_hints(cls, include_extras=True)
    return tuple(_field(cls, f, hints[f.name]) for f in dataclasses.fields(cls))


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
        facts.tightens, facts.names, facts.reads,
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
