"""Derives the ranges of the vehicles' values from the fence, the airframe and the start: in any
flight, in a normal flight, and in the first tick."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, pi, sqrt
from typing import NamedTuple

from kybflow.core.geometry import GRAVITY, Vec3
from kybflow.dsl.checks.case import Case
from kybflow.dsl.expressions.reasoning import EVERYWHERE, Bounds, Envelopes, physical_bounds
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts.observables import Envelope
from kybflow.world.shapes import Box, Cylinder, MovingSphere, Shape, Sphere

_OFFSET = (0.05, 0.05, 0.05)
_SPEED, _TILT = 0.05, 0.2
"""In the first tick: the largest distance from the start per axis (`_OFFSET`), m; the largest
speed, m/s; the largest tilt, rad."""
_SHARE, _ROOM = 0.2, 0.3
"""How far outside the fence a normal flight may get: this share of its size, but at least this many
metres."""
_MIN_DISTANCE = 2.0
"""How far outside the fence any flight may get: its longest side, but at least this, m."""
_GUST_FACTOR = 3.0
"""The factor of the airframe's speed that gusts and failures can cause; in any flight, the speed of
a fall is added."""
_MAX_AGE_S = 10.0
"""The age of an estimate on which no vehicle still flies, s."""
_MIN_SPREAD, _LEAST_SPREAD = 1e-4, 1e-5
"""The spread of the best motion capture, and a spread below that of any system, m."""


class Reaches(NamedTuple):
    """Bounds of values. usual: in a normal flight. certain: in any flight. at_first: in the first
    tick."""

    usual: Bounds
    certain: Bounds
    at_first: Bounds


_STOP = 0.02
"""How far a joint gives way at its stop and how wrongly it is measured, m or rad."""


def reaches_of(case: Case) -> Callable[[str | None], Reaches]:
    """Return a function from the name of a vehicle to the bounds that apply to its conditions. For
    None, it returns those for conditions of no vehicle."""
    (found,) = case.cached(_reaches)
    return found


def _reaches(case: Case) -> list[Callable[[str | None], Reaches]]:
    vehicles, fence = case.plan.fleet.items(), case.plan.fence
    kinds = (
        {name: _usual(vehicle, fence) for name, vehicle in vehicles},
        {name: _certain(vehicle, fence) for name, vehicle in vehicles},
        {
            name: Envelope(v.start, *Box(v.start, v.start).grown(_OFFSET), _SPEED, _TILT)
            for name, v in vehicles
        },
    )
    plan, made = case.plan, dict[str | None, Reaches]()
    solids = {
        name: _box_of(shape) for name, shape in (*plan.obstacles.items(), *plan.moving.items())
    }
    joints = {n: one.joint for n, one in plan.objects.items() if one.joint is not None}
    moved = {n: (j.low - _STOP, j.high + _STOP) for n, j in joints.items()}
    at_start = {n: (j.start - _STOP, j.start + _STOP) for n, j in joints.items()}

    def reaches(own: str | None) -> Reaches:
        if own not in made:
            usual, certain, first = (
                Envelopes(kind, own, solids, ranges)
                for kind, ranges in zip(kinds, (moved, moved, at_start), strict=True)
            )
            longest = case.plan.time_limit
            at_first = physical_bounds(longest, first)
            made[own] = Reaches(
                physical_bounds(longest, usual, at_first),
                physical_bounds(longest, certain, at_first),
                at_first,
            )
        return made[own]

    return [reaches]


def _box_of(shape: Shape | MovingSphere) -> Box:
    """Return a box that contains an obstacle wherever it moves; everywhere for a large one."""
    match shape:
        case Box():
            return shape
        case Cylinder((x, y, z), radius, height):
            return Box((x - radius, y - radius, z), (x + radius, y + radius, z + height))
        case Sphere(at, radius):
            return Box(at, at).grown((radius,) * 3)
        case MovingSphere():
            sides = ((min(axis), max(axis)) for axis in zip(*shape.along, strict=True))
            (a, d), (b, e), (c, f) = sides
            return Box((a, b, c), (d, e, f)).grown((shape.radius,) * 3)
    return EVERYWHERE


def _usual(vehicle: VehiclePlan, fence: Box | None) -> Envelope:
    box = _around(vehicle, fence, lambda size: tuple(max(_ROOM, _SHARE * s) for s in size))
    speed, across = _fast(vehicle), hypot(*(EVERYWHERE if fence is None else fence).size)
    tilt = 0.5 * pi + vehicle.airframe.tilt
    return Envelope(vehicle.start, *box, speed, tilt, across, 2.0 * speed, _MAX_AGE_S, _MIN_SPREAD)


def _certain(vehicle: VehiclePlan, fence: Box | None) -> Envelope:
    box = _around(vehicle, fence, lambda size: (max(_MIN_DISTANCE, *size),) * 3)
    across, speed = hypot(*box.size), _fast(vehicle) + sqrt(2.0 * GRAVITY * box.size[2])
    return Envelope(vehicle.start, *box, speed, pi, across, 2.0 * speed, spread=_LEAST_SPREAD)


def _fast(vehicle: VehiclePlan) -> float:
    return _GUST_FACTOR * hypot(vehicle.airframe.speed, vehicle.airframe.climb)


def _around(
    vehicle: VehiclePlan, fence: Box | None, room: Callable[[Vec3], tuple[float, ...]]
) -> Box:
    """Return the box that contains the start and the fence with some room around it; everywhere if
    there is no fence."""
    if fence is None:
        return EVERYWHERE
    x, y, z = room(fence.size)
    low, high = fence.grown((x, y, z))
    (a, b, c), (d, e, f), start = low, high, vehicle.start
    return Box(
        (min(a, start[0]), min(b, start[1]), min(c, start[2])),
        (max(d, start[0]), max(e, start[1]), max(f, start[2])),
    )
