"""The tree of a condition, an estimator's health or an expectation: frozen, in SI, with names that
exist. `kybflow.dsl.expressions.parse` builds it, and `kybflow.runtime.conditions` makes functions
of it that the runtime evaluates. `describe` writes a tree as text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from kybflow.core.geometry import Vec3
from kybflow.core.units import DURATION, LENGTH, SPEED, Dimension, format_quantity
from kybflow.dsl.diagnostics import Text

ComparisonOperator = Literal["<", "<=", ">", ">=", "==", "!="]
Quantifier = Literal["all", "any"]
Function = Literal["mean", "max", "min", "rms"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A quantity in SI. dimension: the dimension of the value with which it is compared."""

    value: float
    dimension: Dimension


@dataclass(frozen=True, slots=True)
class Word:
    """A bare name with which another name is compared: `b.behavior == hover`."""

    text: str


@dataclass(frozen=True, slots=True)
class Read:
    """An observable of a vehicle. vehicle: its name; None for the vehicle whose condition this is.
    name: a key of `kybflow.parts.observables.OBSERVABLES`."""

    vehicle: str | None
    name: str


@dataclass(frozen=True, slots=True)
class ObjectRead:
    """A value of an object of the world. object: its name. name: a key of
    `kybflow.parts.observables.OBJECT_OBSERVABLES`."""

    object: str
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
    """A place in the world: the position of a vehicle, of its start or of its payload, fixed
    coordinates, an obstacle, or the centre of an object or of its surface.

    vehicle: its name; None for the vehicle whose condition this is. start: whether the vehicle's
    start is meant. payload: whether the vehicle's payload is meant. point: the fixed coordinates,
    metres. obstacle, object: the name of the obstacle or the object. All are None if a vehicle is
    meant. surface: that of the object; empty for the object itself.
    """

    vehicle: str | None
    start: bool = False
    point: Vec3 | None = None
    payload: bool = False
    obstacle: str | None = None
    object: str | None = None
    surface: str = ""


@dataclass(frozen=True, slots=True)
class Distance:
    """The distance between two locations, metres; from an obstacle, the distance from its surface,
    negative inside. At most one of them is an obstacle."""

    a: Location
    b: Location


@dataclass(frozen=True, slots=True)
class Separation:
    """The smallest distance between any two of `vehicles`, and between any of them and the surface
    of any of `obstacles`, metres."""

    vehicles: tuple[str, ...]
    obstacles: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Clearance:
    """The smallest distance between the rotor tips of a vehicle and the surface of any of
    `obstacles`, metres; negative if they overlap."""

    vehicle: str
    obstacles: tuple[str, ...]


Measured = Read | ObjectRead | Distance | Separation | Clearance
"""The values of which there are statistics."""
Value = Quantity | Word | Axis | MissionTime | Measured


@dataclass(frozen=True, slots=True)
class InState:
    vehicle: str
    state: str


@dataclass(frozen=True, slots=True)
class GroupInState:
    """Whether all or any of the vehicles of a group are in a state."""

    quantifier: Quantifier
    group: str
    vehicles: tuple[str, ...]
    state: str


@dataclass(frozen=True, slots=True)
class Aggregate:
    """A statistic of `value` over the run, or over the ticks in which `vehicle` is in `state`."""

    function: Function
    value: Measured
    vehicle: str | None = None
    state: str | None = None


@dataclass(frozen=True, slots=True)
class Compare:
    """A comparison. In an expectation without `always`, `eventually` or `finally`, the left side is
    an aggregate and the right side an aggregate or a number."""

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
    """Holds if the condition held at least once, at most `within` seconds after the start."""

    condition: Condition
    within: float | None = None


@dataclass(frozen=True, slots=True)
class Finally:
    """Holds if the condition holds in the last tick."""

    condition: Condition


@dataclass(frozen=True, slots=True)
class Finished:
    """Holds if the run ended by itself within this many seconds."""

    within: float


class Unparsed(NamedTuple):
    """A condition as written, which is parsed when its names are known."""

    text: Text


Expression = Condition | Always | Eventually | Finally | Finished


_SMALL = {LENGTH: ("cm", 100.0), SPEED: ("cm/s", 100.0), DURATION: ("ms", 1000.0)}


def describe(expression: Expression) -> str:
    """Return the expression as an author would write it. The text can be parsed again."""
    match expression:
        case Compare(operator, left, right):
            return f"{shown_value(left)} {operator} {shown_value(right)}"
        case InState(vehicle, state):
            return f"{vehicle} in {state}"
        case GroupInState(quantifier, group, _, state):
            return f"{quantifier} {group} in {state}"
        case And(parts):
            return " and ".join(_grouped(p, (Or,)) for p in parts)
        case Or(parts):
            return " or ".join(_grouped(p, (Or,)) for p in parts)
        case Not(part):
            grouped = (And, Or, Compare, InState, GroupInState)
            return f"not {_grouped(part, grouped)}"
    return _expectation(expression)


def _expectation(expression: Always | Eventually | Finally | Finished) -> str:
    match expression:
        case Always(condition):
            return f"always {describe(condition)}"
        case Finally(condition):
            return f"finally {describe(condition)}"
        case Finished(within):
            return f"finished within {quantity(within, DURATION)}"
        case Eventually(condition, within):
            limit = "" if within is None else f" within {quantity(within, DURATION)}"
            return f"eventually {describe(condition)}{limit}"


def quantity(value: float, dimension: Dimension) -> str:
    """Return `value` (SI) in an easily readable unit: `5 cm`, not `0.05 m`."""
    unit, factor = _SMALL.get(dimension, ("", 0.0))
    if unit and 0.0 < abs(value) < 1.0:
        return f"{value * factor:.4g} {unit}"
    return format_quantity(value, dimension)


def _grouped(part: Expression, loose: tuple[type, ...]) -> str:
    text = describe(part)
    return f"({text})" if isinstance(part, loose) else text


def shown_value(value: Value | Aggregate) -> str:
    """Return one side of a comparison as an author would write it."""
    match value:
        case Quantity(number, dimension):
            return quantity(number, dimension)
        case Word(text):
            return text
        case ObjectRead(vehicle, name) | Read(vehicle, name) | Axis(vehicle, name):
            return f"{vehicle}.{name}" if vehicle else name
        case MissionTime():
            return "time"
        case Distance(a, b):
            return f"distance({_place(a)} to {_place(b)})"
        case Separation(vehicles, obstacles):
            return f"separation({' and '.join((*vehicles, *obstacles))})"
        case Clearance(vehicle, _):
            return f"clearance({vehicle})"
        case Aggregate(function, inner, vehicle, state):
            of = f"{vehicle}." if isinstance(inner, ObjectRead) else ""
            return f"{function}({shown_value(inner)}{f' in {of}{state}' if state else ''})"


def _place(place: Location) -> str:
    if place.point is not None:
        return "[" + " ".join(f"{c:.6g}" for c in place.point) + "]"
    if place.obstacle is not None:
        return place.obstacle
    if place.object is not None:
        return f"{place.object}.{place.surface}" if place.surface else place.object
    if place.vehicle is None:
        return "start"
    if place.payload:
        return f"{place.vehicle}.payload"
    return f"{place.vehicle}.start" if place.start else place.vehicle
