"""Compiles conditions into closures over live views of the vehicles.

A comparison with an unavailable value is false, so its negation with `not` is true. A condition
that waits for something to stop should use the opposite comparison instead of `not`.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from itertools import combinations
from typing import Any

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import NO_INPUTS, InputReadings
from kybflow.dsl.expressions import tree
from kybflow.parts.observables import OBJECT_OBSERVABLES, OBSERVABLES, Unavailable, View, is_in

OPERATORS: Mapping[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


def reader_of(
    expression: tree.Expression,
    views: Mapping[str, View],
    own: str | None,
    now: Callable[[], float],
    inputs: InputReadings = NO_INPUTS,
) -> Callable[[], bool]:
    """Return a function without arguments that evaluates the condition.

    own: the vehicle whose values are read if the expression names none.
    now: returns the seconds since the start of the run.
    inputs: the readings of the input devices.
    Raises TypeError if `expression` is not a condition.
    """
    match expression:
        case tree.Compare(left=tree.Read(vehicle, name), right=tree.Quantity(bound, _)):
            view = views[vehicle or own or ""]
            return _against(OBSERVABLES[name].read, view, OPERATORS[expression.operator], bound)
        case tree.Compare(symbol, left, right):
            a, b = value_of(left, views, own, now, inputs), value_of(right, views, own, now, inputs)
            return _compared(OPERATORS[symbol], a, b)
        case tree.InState(vehicle, state):
            return _in_state(views[vehicle], state)
        case tree.GroupInState(quantifier, _, vehicles, state):
            inside = [_in_state(views[vehicle], state) for vehicle in vehicles]
            return _both(inside) if quantifier == "all" else _either(inside)
        case tree.And(parts):
            return _both([reader_of(part, views, own, now, inputs) for part in parts])
        case tree.Or(parts):
            return _either([reader_of(part, views, own, now, inputs) for part in parts])
        case tree.Not(part):
            inner = reader_of(part, views, own, now, inputs)
            return lambda: not inner()
    raise TypeError(f"{type(expression).__name__} is not a condition")


def value_of(
    value: tree.Value | tree.Aggregate,
    views: Mapping[str, View],
    own: str | None,
    now: Callable[[], float],
    inputs: InputReadings = NO_INPUTS,
) -> Callable[[], Any]:
    """Return a function that returns the value (SI), or raises Unavailable while it is unknown.
    The arguments are those of `bind`."""
    match value:
        case tree.Quantity(constant, _) | tree.Word(constant):
            return lambda: constant
        case tree.Read() | tree.ObjectRead():
            return _read(value, views, own)
        case tree.Axis(source, axis):
            return _axis(inputs, source, axis)
        case tree.MissionTime():
            return now
        case tree.Distance(a, b):
            return _distance(a, b, views, own)
        case tree.Separation(vehicles, obstacles):
            return _separation([views[vehicle] for vehicle in vehicles], obstacles)
        case tree.Clearance(vehicle, obstacles):
            return _clearance(views[vehicle], obstacles)
    raise TypeError(f"{type(value).__name__} is not a value of one tick")


def _distance(
    a: tree.Location, b: tree.Location, views: Mapping[str, View], own: str | None
) -> Callable[[], float]:
    if a.obstacle is not None:
        a, b = b, a
    here = _point_of(a, views, own)
    if b.obstacle is not None:
        view, obstacle = views[a.vehicle or own or next(iter(views))], b.obstacle
        return lambda: view.obstacle(obstacle).distance(here())
    there = _point_of(b, views, own)
    return lambda: distance(here(), there())


def _read(
    value: tree.Read | tree.ObjectRead, views: Mapping[str, View], own: str | None
) -> Callable[[], float | str]:
    if isinstance(value, tree.Read):
        view, read = views[value.vehicle or own or ""], OBSERVABLES[value.name].read
        return lambda: read(view)
    seer, name = views[own or next(iter(views))], value.object
    read_object = OBJECT_OBSERVABLES[value.name].read
    return lambda: read_object(seer.object(name))


def _axis(inputs: InputReadings, source: str, axis: str) -> Callable[[], float]:
    def deflection() -> float:
        reading = inputs[source]
        if reading is None:
            raise Unavailable
        return reading.axes[axis]

    return deflection


def _against(
    read: Callable[[View], float | str], view: View, holds: Callable[[Any, Any], bool], bound: float
) -> Callable[[], bool]:
    def condition() -> bool:
        try:
            return holds(read(view), bound)
        except Unavailable:
            return False

    return condition


def _compared(
    holds: Callable[[Any, Any], bool], a: Callable[[], Any], b: Callable[[], Any]
) -> Callable[[], bool]:
    def condition() -> bool:
        try:
            return holds(a(), b())
        except Unavailable:
            return False

    return condition


def _in_state(view: View, state: str) -> Callable[[], bool]:
    return lambda: is_in(view.behavior, state)


def _both(parts: list[Callable[[], bool]]) -> Callable[[], bool]:
    if len(parts) == 2:
        first, second = parts
        return lambda: first() and second()
    return lambda: all(part() for part in parts)


def _either(parts: list[Callable[[], bool]]) -> Callable[[], bool]:
    if len(parts) == 2:
        first, second = parts
        return lambda: first() or second()
    return lambda: any(part() for part in parts)


def _point_of(
    place: tree.Location, views: Mapping[str, View], own: str | None
) -> Callable[[], Vec3]:
    if place.point is not None:
        point = place.point
        return lambda: point
    if place.object is not None:
        seer, thing, surface = views[own or next(iter(views))], place.object, place.surface
        return lambda: seer.object_place(thing, surface)
    view = views[place.vehicle or own or ""]
    if place.start:
        return lambda: view.start
    if place.payload:
        return lambda: view.payload_place
    return lambda: view.state.position


def _separation(views: list[View], obstacles: tuple[str, ...]) -> Callable[[], float]:
    def smallest() -> float:
        positions = [view.state.position for view in views]
        apart = [distance(a, b) for a, b in combinations(positions, 2)]
        for name in obstacles:
            solid = views[0].obstacle(name)
            apart += [solid.distance(position) for position in positions]
        return min(apart)

    return smallest


def _clearance(view: View, obstacles: tuple[str, ...]) -> Callable[[], float]:
    def smallest() -> float:
        position = view.state.position
        return min(view.obstacle(name).distance(position) for name in obstacles) - view.hull

    return smallest
