"""How far a vehicle is above whatever could carry it: the floor, where it started, an obstacle.

A claim of touch-down is checked by it, against the estimate in flight and against the simulator's
truth at the end of a run. Metres, world frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, sin

from kybflow.core.geometry import Quat, Vec3, tilt_of
from kybflow.core.signals import Estimate
from kybflow.world.vehicle_context import LEGS, VehicleContext

FLOOR = 0.0
BESIDE = 0.5
"""How far beside its start, from its own edge, a vehicle may stand on what it started from."""
STANDS = 0.05
"""A vehicle that is higher than this above where it could stand is in the air."""
SPREADS = 2.0
FRESH = 0.3
"""Seconds; an older estimate contradicts nothing."""


def height_above_ground(
    context: VehicleContext, position: Vec3, attitude: Quat, tops: Iterable[float] = ()
) -> float:
    """Return how far a vehicle is above the highest place below it where it could stand; a tilted
    one may lie on an arm there. tops: the heights of vehicles that stand on something else."""
    x, y, z = position
    reach = 0.5 * context.airframe.diameter
    sx, sy, start = context.start
    shapes = context.obstacles.values()
    found = [*tops, *(shape.top(x, y, reach) + LEGS for shape in shapes)]
    if max(abs(x - sx), abs(y - sy)) < reach + BESIDE:
        found.append(start)
    below = [top for top in (*found, FLOOR) if -inf < top <= z + STANDS]
    highest = max(below, default=FLOOR)
    return z - highest - reach * sin(tilt_of(attitude))


def height_in_the_air(context: VehicleContext, estimate: Estimate, tops: Iterable[float]) -> float:
    """Return the height above the ground of a vehicle that must be in the air by its estimate; zero
    where it may be on the ground, and for an estimate that is old."""
    if estimate.age > FRESH:
        return 0.0
    height = height_above_ground(context, estimate.position, estimate.attitude, tops)
    return height if height > STANDS + SPREADS * estimate.spread else 0.0
