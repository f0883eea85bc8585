"""Finds where a vehicle can descend without landing on another one, on the edge of an obstacle, or
against an object.
World frame, metres.

A vehicle is under another if it is lower and their centres are horizontally closer than half the
sum of their diameters plus 15 cm. An obstacle's edge is under a vehicle if, within half its
diameter plus 15 cm, the heights on which the vehicle would stand differ by more than 10 cm; a table
that carries all of that has no edge there, nor has the place of the vehicle's start. An object is
in the way if the path down comes as near to it as that, or as its bumper plus 15 cm. A place beside
it is searched on circles around the upper vehicle, the nearest first, and on each circle first in
the direction away from what is below. A place must be inside the fence, and the paths to it and
down from it must be clear of obstacles, objects and all known vehicles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import atan2, cos, hypot, pi, sin
from typing import NamedTuple

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import NO_OBJECTS, Estimate, SeenObjects
from kybflow.world.ground import STAND_HEIGHT
from kybflow.world.objects import Placement, WorldObject, distance_to, place_of
from kybflow.world.vehicle_context import LEGS, VehicleContext

_MARGIN = 0.15
_CLEARANCE = 0.2
"""Distance between the vehicle's rim and the fence or an obstacle."""
_STEP, _CIRCLES = 0.25, 12
"""The difference between the radii of two circles, and the number of circles."""
_DIRECTIONS = 16
_SAMPLES = 8
"""Points of a path that are checked."""
_EDGE = 0.1
"""Height of a step on which a vehicle can't stand."""

Fleet = Mapping[str, Estimate | None]


class Below(NamedTuple):
    """What a descending vehicle would land on. words: its description for a message. away: the
    direction away from it, rad, counterclockwise from x. is_fixed: whether it will not go away.
    where: it is below, or in the way down."""

    words: str
    away: float
    is_fixed: bool
    where: str = "below"


def what_is_below(
    context: VehicleContext, here: Vec3, fleet: Fleet, objects: SeenObjects = NO_OBJECTS
) -> Below | None:
    """Return the nearest vehicle under the position `here`, else an object beside the path down,
    else the edge of an obstacle under it, else None. objects: those that have been seen; others
    are where they start."""
    found = [
        (apart, name, other)
        for name, other, apart in _others(context, here, fleet)
        if other[2] < here[2] and apart < _needed(context, name)
    ]
    if not found:
        return _object_near(context, here, objects) or _edge_below(context, here)
    _, name, other = min(found)
    return Below(f"`{name}`", atan2(here[1] - other[1], here[0] - other[0]), False)


def _object_near(context: VehicleContext, here: Vec3, seen: SeenObjects) -> Below | None:
    """Return the first object that the way down from `here` touches, None without one."""
    down = [here, *_between(here, (*here[:2], context.start[2]))]
    for one, place in _placed(context, seen):
        if any(distance_to(one, place, p) < _reach(context) for p in down):
            x, y, _ = place.position
            return Below(
                f"the object `{one.name}`", atan2(here[1] - y, here[0] - x), True, "in the way"
            )
    return None


def _placed(context: VehicleContext, seen: SeenObjects) -> Iterator[tuple[WorldObject, Placement]]:
    """Yield the objects, each where it was seen last, or at its start."""
    for name, one in context.objects.items():
        yield one, place_of(context.objects, seen, name)


def _reach(context: VehicleContext) -> float:
    """Return how near to the path of a vehicle's centre something is in its way, m."""
    frame = context.airframe
    return max(0.5 * frame.diameter, frame.bumper or 0.0) + _MARGIN


def _edge_below(context: VehicleContext, here: Vec3) -> Below | None:
    """Return the edge of the highest obstacle under `here`, or None if that carries the whole
    vehicle."""
    x, y, z = here
    reach, start = 0.5 * context.airframe.diameter + _MARGIN, context.start
    under = {}
    for name, shape in context.obstacles.items():
        top = shape.top(x, y, reach)
        if _EDGE < top + LEGS <= z + STAND_HEIGHT and shape.distance((x, y, top)) < reach:
            under[name] = top
    if not under or hypot(x - start[0], y - start[1]) < _MARGIN:
        return None
    name = max(under, key=under.__getitem__)
    east = north = 0.0
    carried = True
    for i in range(_DIRECTIONS):
        cx, cy = cos(2.0 * pi * i / _DIRECTIONS), sin(2.0 * pi * i / _DIRECTIONS)
        px, py = x + reach * cx, y + reach * cy
        if all(context.obstacles[n].top(px, py, 0.0) < under[name] - _EDGE for n in under):
            east, north, carried = east + cx, north + cy, False
    return None if carried else Below(f"an edge of `{name}`", atan2(north, east), True)


def place_beside(
    context: VehicleContext,
    here: Vec3,
    fleet: Fleet,
    away: float,
    objects: SeenObjects = NO_OBJECTS,
) -> Vec3 | None:
    """Return the nearest position at the height of `here` from which the vehicle can descend, or
    None. away: the direction that is tried first, rad."""
    x, y, z = here
    for circle in range(1, _CIRCLES + 1):
        for turn in range(_DIRECTIONS):
            side = (turn + 1) // 2 * (-1) ** turn
            angle = away + side * 2.0 * pi / _DIRECTIONS
            radius = circle * _STEP
            place = (x + radius * cos(angle), y + radius * sin(angle), z)
            if _is_free(context, here, place, fleet, objects):
                return place
    return None


def _is_free(
    context: VehicleContext, here: Vec3, place: Vec3, fleet: Fleet, objects: SeenObjects
) -> bool:
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
    down = [*_between(place, ground)]
    reach = _reach(context)
    for one, at in _placed(context, objects):
        near = min(reach, distance_to(one, at, here))
        if any(distance_to(one, at, p) < near for p in way) or any(
            distance_to(one, at, p) < reach for p in down
        ):
            return False
    for shape in context.obstacles.values():
        near = min(keep, shape.distance(here))
        if any(shape.distance(p) < near for p in way) or any(
            shape.distance(p) < keep for p in down
        ):
            return False
    return True


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
