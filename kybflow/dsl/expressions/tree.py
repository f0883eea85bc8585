"""The tree of a condition, an estimator's health or an expectation: frozen, in SI, with names that
are known to exist. `kybflow.dsl.expressions.parse` makes it, `kybflow.runtime.conditions` binds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from kybflow.core.geometry import Vec3
from kybflow.core.units import Dimension
from kybflow.dsl.diagnostics.spans import Text

ComparisonOperator = Literal["<", "<=", ">", ">=", "==", "!="]
Quantifier = Literal["all", "any"]
Function = Literal["mean", "max", "min", "rms"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity in SI; `dimension` is that of what it is compared with."""

    value: float
    dimension: Dimension


@dataclass(frozen=True, slots=True)
class Word:
    """A bare name that another name is compared with: `b.behavior == hover`."""

    text: str


@dataclass(frozen=True, slots=True)
class Read:
    """One of kybflow.parts.observables.OBSERVABLES, of `vehicle`; None is the vehicle that asks."""

    vehicle: str | None
    name: str


@dataclass(frozen=True, slots=True)
class Axis:
    """An axis of an input, -1 to 1."""

    input: str
    name: str


@dataclass(frozen=True, slots=True)
class MissionTime:
    """Seconds since the start of the run."""


@dataclass(frozen=True, slots=True)
class Location:
    """A point: where `vehicle` is, or its start pose, or its payload, or `point` (metres, world).

    Without a point, `vehicle` None is the vehicle that asks.
    """

    vehicle: str | None
    start: bool = False
    point: Vec3 | None = None
    payload: bool = False


@dataclass(frozen=True, slots=True)
class Distance:
    """Metres between two places."""

    a: Location
    b: Location


@dataclass(frozen=True, slots=True)
class Separation:
    """The smallest distance between any two of `vehicles`, metres."""

    vehicles: tuple[str, ...]


Value = Quantity | Word | Read | Axis | MissionTime | Distance | Separation


@dataclass(frozen=True, slots=True)
class InState:
    vehicle: str
    state: str


@dataclass(frozen=True, slots=True)
class GroupInState:
    """Whether all or any of `vehicles`, which are `group`, are in `state`."""

    quantifier: Quantifier
    group: str
    vehicles: tuple[str, ...]
    state: str


@dataclass(frozen=True, slots=True)
class Aggregate:
    """A statistic of `value` over the run, or over the ticks in which `vehicle` is in `state`."""

    function: Function
    value: Read | Distance | Separation
    vehicle: str | None = None
    state: str | None = None


@dataclass(frozen=True, slots=True)
class Compare:
    """In an expectation the left side is an aggregate, the right one an aggregate or a number."""

    operator: ComparisonOperator
    left: Value | Aggregate
    right: Value | Aggregate


@dataclass(frozen=True, slots=True)
class And:
    parts: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class Or:
    parts: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class Not:
    part: Condition


Condition = Compare | InState | GroupInState | And | Or | Not


@dataclass(frozen=True, slots=True)
class Always:
    condition: Condition


@dataclass(frozen=True, slots=True)
class Eventually:
    """Holds when the condition held once, at the latest `within` seconds after the start."""

    condition: Condition
    within: float | None = None


@dataclass(frozen=True, slots=True)
class Finally:
    """Holds when the condition holds in the last tick."""

    condition: Condition


@dataclass(frozen=True, slots=True)
class Finished:
    """Holds when the run ended by itself within so many seconds."""

    within: float


class Unparsed(NamedTuple):
    """A condition as written: names are not known yet, so it is not parsed."""

    text: Text


Expression = Condition | Always | Eventually | Finally | Finished
