"""The height of a vehicle above the ground: the floor, its start or an obstacle that can carry it.

It verifies a reported touchdown: in flight by the estimate, and at the end of a run by the
simulator's truth. Metres, world frame.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, sin

from kybflow.core.geometry import Quat, Vec3, tilt_of
from kybflow.core.signals import Estimate
from kybflow.world.vehicle_context import LEGS, VehicleContext

FLOOR = 0.0
START_MARGIN = 0.5
"""How far the ground of the vehicle's start extends beyond the vehicle's edge."""
STAND_HEIGHT = 0.05
"""Height above the ground beyond which a vehicle is in the air."""
HEIGHT_SIGMAS = 2.0
FRESH_S = 0.3
"""Age of an estimate, seconds, beyond which it proves nothing."""


def height_above_ground(
    context: VehicleContext, position: Vec3, attitude: Quat, tops: Iterable[float] = ()
) -> float:
    """Return the height of a vehicle above the highest ground below it. The height is that of the
    lowest arm, since a tilted vehicle may lie on one. tops: the heights at which the vehicle would
    stand on other things."""
    x, y, z = position
    reach = 0.5 * context.airframe.diameter
    sx, sy, start = context.start
    shapes = context.obstacles.values()
    found = [*tops, *(shape.top(x, y, reach) + LEGS for shape in shapes)]
    if max(abs(x - sx), abs(y - sy)) < reach + START_MARGIN:
        found.append(start)
    below = [top for top in (*found, FLOOR) if -inf < top <= z + STAND_HEIGHT]
    highest = max(below, default=FLOOR)
    return z - highest - reach * sin(tilt_of(attitude))


def height_in_the_air(context: VehicleContext, estimate: Estimate, tops: Iterable[float]) -> float:
    """Return the height above the ground if the estimate proves that the vehicle is in the air, or
    zero if it may be on the ground or the estimate is old."""
    if estimate.age > FRESH_S:
        return 0.0
    height = height_above_ground(context, estimate.position, estimate.attitude, tops)
    return height if height > STAND_HEIGHT + HEIGHT_SIGMAS * estimate.spread else 0.0
