"""An expression back to text, for graphs and reports."""

from __future__ import annotations

from kybflow.core.units import DURATION, LENGTH, SPEED, Dimension, format_quantity
from kybflow.dsl.expressions.tree import (
    Aggregate,
    Always,
    And,
    Compare,
    Distance,
    Eventually,
    Expression,
    Finally,
    Finished,
    GroupInState,
    InState,
    Location,
    MissionTime,
    Not,
    Or,
    Quantity,
    Read,
    Separation,
    Value,
    Word,
)

_SMALL = {LENGTH: ("cm", 100.0), SPEED: ("cm/s", 100.0), DURATION: ("ms", 1000.0)}


def describe(expression: Expression) -> str:
    """The expression as a person would write it; what it says can be parsed again."""
    match expression:
        case Compare(operator, left, right):
            return f"{_value(left)} {operator} {_value(right)}"
        case InState(vehicle, state):
            return f"{vehicle} in {state}"
        case GroupInState(quantifier, group, _, state):
            return f"{quantifier} {group} in {state}"
        case And(parts):
            return " and ".join(_grouped(p, (Or,)) for p in parts)
        case Or(parts):
            return " or ".join(_grouped(p, (Or,)) for p in parts)
        case Not(part):
            return f"not {_grouped(part, (And, Or, Compare, InState, GroupInState))}"
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
    """`value` (SI) in a unit in which it is easily read: `5 cm`, not `0.05 m`."""
    unit, factor = _SMALL.get(dimension, ("", 0.0))
    if unit and 0.0 < abs(value) < 1.0:
        return f"{value * factor:.4g} {unit}"
    return format_quantity(value, dimension)


def _grouped(part: Expression, loose: tuple[type, ...]) -> str:
    text = describe(part)
    return f"({text})" if isinstance(part, loose) else text


def _value(value: Value | Aggregate) -> str:
    match value:
        case Quantity(number, dimension):
            return quantity(number, dimension)
        case Word(text):
            return text
        case Read(vehicle, name):
            return f"{vehicle}.{name}" if vehicle else name
        case MissionTime():
            return "time"
        case Distance(a, b):
            return f"distance({_place(a)} to {_place(b)})"
        case Separation(vehicles):
            return f"separation({' and '.join(vehicles)})"
        case Aggregate(function, inner, _, state):
            return f"{function}({_value(inner)}{f' in {state}' if state else ''})"


def _place(place: Location) -> str:
    if place.point is not None:
        return "[" + " ".join(f"{c:.6g}" for c in place.point) + "]"
    if place.vehicle is None:
        return "start"
    if place.payload:
        return f"{place.vehicle}.payload"
    return f"{place.vehicle}.start" if place.start else place.vehicle
