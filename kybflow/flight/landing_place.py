"""Finds where a vehicle can descend without landing on another one. World frame, metres.

A vehicle is under another if it is lower and their centres are horizontally closer than half the
sum of their diameters plus 15 cm. A place beside it is searched on circles around the upper
vehicle, the nearest first, and on each circle first in the direction away from the vehicle below. A
place must be inside the fence, and the paths to it and down from it must be clear of obstacles and
of all known vehicles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import atan2, cos, hypot, pi, sin

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Estimate
from kybflow.world.vehicle_context import VehicleContext

_MARGIN = 0.15
_CLEARANCE = 0.2
"""Distance between the vehicle's rim and the fence or an obstacle."""
_STEP, _CIRCLES = 0.25, 12
"""The difference between the radii of two circles, and the number of circles."""
_DIRECTIONS = 16
_SAMPLES = 8
"""Points of a path that are checked."""

Fleet = Mapping[str, Estimate | None]


def vehicle_below(context: VehicleContext, here: Vec3, fleet: Fleet) -> str | None:
    """Return the name of the nearest vehicle under the position `here`, or None."""
    found = [
        (apart, name)
        for name, other, apart in _others(context, here, fleet)
        if other[2] < here[2] and apart < _needed(context, name)
    ]
    return min(found)[1] if found else None


def place_beside(context: VehicleContext, here: Vec3, fleet: Fleet, below: str) -> Vec3 | None:
    """Return the nearest position at the height of `here` from which the vehicle can descend, or
    None. below: the name of the vehicle that is in the way."""
    other = fleet[below]
    x, y, z = here
    away = 0.0 if other is None else atan2(y - other.position[1], x - other.position[0])
    for circle in range(1, _CIRCLES + 1):
        for turn in range(_DIRECTIONS):
            side = (turn + 1) // 2 * (-1) ** turn
            angle = away + side * 2.0 * pi / _DIRECTIONS
            radius = circle * _STEP
            place = (x + radius * cos(angle), y + radius * sin(angle), z)
            if _is_free(context, here, place, fleet):
                return place
    return None


def _is_free(context: VehicleContext, here: Vec3, place: Vec3, fleet: Fleet) -> bool:
    way = [*_between(here, place)]
    for name, other, apart in _others(context, place, fleet):
        needed = _needed(context, name)
        near = min(needed, distance(here, other))  # one that is already near may stay so
        if apart < needed or any(distance(p, other) < near for p in way):
            return False
    keep = 0.5 * context.airframe.diameter + _CLEARANCE
    fence, ground = context.fence, (*place[:2], context.start[2])
    if fence is not None and not all(
        low + keep <= at <= high - keep
        for low, at, high in zip(fence.low[:2], place[:2], fence.high[:2], strict=True)
    ):
        return False
    points = [*way, *_between(place, ground)]
    return all(shape.distance(p) >= keep for shape in context.obstacles.values() for p in points)


def _others(context: VehicleContext, here: Vec3, fleet: Fleet) -> Iterator[tuple[str, Vec3, float]]:
    """Yield the name, position and horizontal distance of each other vehicle with an estimate."""
    for name, other in fleet.items():
        if other is not None and name != context.vehicle:
            x, y, _ = other.position
            yield name, other.position, hypot(here[0] - x, here[1] - y)


def _needed(context: VehicleContext, other: str) -> float:
    own = context.airframe.diameter
    return 0.5 * (own + context.diameters.get(other, own)) + _MARGIN


def _between(a: Vec3, b: Vec3) -> Iterator[Vec3]:
    for i in range(1, _SAMPLES + 1):
        s = i / _SAMPLES
        yield a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])
