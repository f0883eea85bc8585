"""Finds where a vehicle can come down without landing on another. World frame, metres.

A vehicle is under another when it is lower and their centres are horizontally closer than half of
both diameters and 15 cm. A place beside it is searched on circles around the vehicle, the nearest
first, and on each circle first in the direction away from the one below: inside the fence, and
with the way there and the way down clear of obstacles and of every vehicle that is known.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import atan2, cos, hypot, pi, sin

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Estimate
from kybflow.world.vehicle_context import VehicleContext

_MARGIN = 0.15
_CLEARANCE = 0.2
"""Distance of the vehicle's rim to the fence and to obstacles."""
_STEP, _CIRCLES = 0.25, 12
"""The step of the circles' radii, and their number."""
_DIRECTIONS = 16
_SAMPLES = 8
"""Points of a way that are checked."""

Fleet = Mapping[str, Estimate | None]


def vehicle_below(context: VehicleContext, here: Vec3, fleet: Fleet) -> str | None:
    """Return the name of the nearest vehicle under `here`, None if there is none."""
    found = [
        (apart, name)
        for name, other, apart in _others(context, here, fleet)
        if other[2] < here[2] and apart < _needed(context, name)
    ]
    return min(found)[1] if found else None


def place_beside(context: VehicleContext, here: Vec3, fleet: Fleet, below: str) -> Vec3 | None:
    """Return the nearest place at the height of `here` from which the vehicle can come down, None
    if there is none. below: the vehicle that is in the way."""
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
        near = min(needed, distance(here, other))  # one that is near already may stay as near
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
