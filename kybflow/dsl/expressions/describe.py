"""Write an expression as text, for graphs and reports."""

from __future__ import annotations

from kybflow.core.units import DURATION, LENGTH, SPEED, Dimension, format_quantity
from kybflow.dsl.expressions import tree

_SMALL = {LENGTH: ("cm", 100.0), SPEED: ("cm/s", 100.0), DURATION: ("ms", 1000.0)}


def describe(expression: tree.Expression) -> str:
    """Return the expression as an author would write it. The text can be parsed again."""
    match expression:
        case tree.Compare(operator, left, right):
            return f"{shown_value(left)} {operator} {shown_value(right)}"
        case tree.InState(vehicle, state):
            return f"{vehicle} in {state}"
        case tree.GroupInState(quantifier, group, _, state):
            return f"{quantifier} {group} in {state}"
        case tree.And(parts):
            return " and ".join(_grouped(p, (tree.Or,)) for p in parts)
        case tree.Or(parts):
            return " or ".join(_grouped(p, (tree.Or,)) for p in parts)
        case tree.Not(part):
            grouped = (tree.And, tree.Or, tree.Compare, tree.InState, tree.GroupInState)
            return f"not {_grouped(part, grouped)}"
    return _expectation(expression)


def _expectation(expression: tree.Always | tree.Eventually | tree.Finally | tree.Finished) -> str:
    match expression:
        case tree.Always(condition):
            return f"always {describe(condition)}"
        case tree.Finally(condition):
            return f"finally {describe(condition)}"
        case tree.Finished(within):
            return f"finished within {quantity(within, DURATION)}"
        case tree.Eventually(condition, within):
            limit = "" if within is None else f" within {quantity(within, DURATION)}"
            return f"eventually {describe(condition)}{limit}"


def quantity(value: float, dimension: Dimension) -> str:
    """Return `value` (SI) in an easily readable unit: `5 cm`, not `0.05 m`."""
    unit, factor = _SMALL.get(dimension, ("", 0.0))
    if unit and 0.0 < abs(value) < 1.0:
        return f"{value * factor:.4g} {unit}"
    return format_quantity(value, dimension)


def _grouped(part: tree.Expression, loose: tuple[type, ...]) -> str:
    text = describe(part)
    return f"({text})" if isinstance(part, loose) else text


def shown_value(value: tree.Value | tree.Aggregate) -> str:
    """Return one side of a comparison as an author would write it."""
    match value:
        case tree.Quantity(number, dimension):
            return quantity(number, dimension)
        case tree.Word(text):
            return text
        case tree.Read(vehicle, name):
            return f"{vehicle}.{name}" if vehicle else name
        case tree.Axis(source, name):
            return f"{source}.{name}"
        case tree.MissionTime():
            return "time"
        case tree.Distance(a, b):
            return f"distance({_place(a)} to {_place(b)})"
        case tree.Separation(vehicles):
            return f"separation({' and '.join(vehicles)})"
        case tree.Aggregate(function, inner, _, state):
            return f"{function}({shown_value(inner)}{f' in {state}' if state else ''})"


def _place(place: tree.Location) -> str:
    if place.point is not None:
        return "[" + " ".join(f"{c:.6g}" for c in place.point) + "]"
    if place.vehicle is None:
        return "start"
    if place.payload:
        return f"{place.vehicle}.payload"
    return f"{place.vehicle}.start" if place.start else place.vehicle
