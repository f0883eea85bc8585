"""Turns a blocked vehicle to the right, around the obstacle that blocks it."""

from __future__ import annotations

from math import cos, sin

from kybflow.core.geometry import Vec3, dot, norm
from kybflow.flight.avoidance.barrier import Demand
from kybflow.flight.avoidance.clearance import bounded, walls
from kybflow.world.shapes import Box

_TURNING, _RETURNING, _FARTHEST = 1.5, 0.5, 1.9
"""Rates at which the angle grows and shrinks, rad/s, and the largest angle, rad."""
_SLOW = 0.05
"""The least wanted speed that counts as blocked, m/s."""
_INSIDE = 0.3
"""Distance of a detour from the fence, m."""
_IMMINENT = 1.0
"""Something ahead blocks the way if it allows less acceleration than this towards it, m/s^2."""


class Detour:
    """Turns the velocity of a blocked vehicle to the right, so that vehicles that meet head on pass
    each other, and vehicles that meet at one point go round it in the same direction.

    The angle grows by `_TURNING` while the vehicle makes less than half of the wanted speed towards
    its goal because of something ahead; otherwise it shrinks. A detour stays at least 30 cm inside
    the fence.
    """

    def __init__(self, fence: Box | None) -> None:
        self._angle = 0.0
        self._room = None if fence is None else fence.grown((-_INSIDE, -_INSIDE, 0.0))

    def turned(
        self, goal: Vec3, place: Vec3, velocity: Vec3, demands: list[Demand], dt: float
    ) -> Vec3:
        """Return the velocity to pursue instead of `goal` (m/s, world frame). place, velocity: the
        vehicle's position and velocity."""
        length = norm(goal)
        blocked = (
            length > _SLOW
            and dot(goal, velocity) < 0.5 * length * length
            and any(dot(d.normal, goal) < -0.3 * length and d.least > -_IMMINENT for d in demands)
        )
        change = _TURNING * dt if blocked else -_RETURNING * dt
        self._angle = min(max(self._angle + change, 0.0), _FARTHEST)
        if self._angle == 0.0:
            return goal
        c, s = cos(self._angle), sin(self._angle)
        x, y, z = goal
        turned = (c * x + s * y, c * y - s * x, z)
        return turned if self._room is None else bounded(turned, walls(place, self._room))
