"""The obstacles that a vehicle keeps away from.

These are all obstacles of the world, except for those that may be touched. Moving obstacles and
other vehicles are modelled as balls; a vehicle's ball reaches to the tips of its rotors. An
obstacle that is no longer seen stays where it was seen last, and for one second grows by the
distance that it can have moved; then it counts as lost and keeps its size. A vehicle that reports
that it has no estimate lands somewhere near, and is forgotten after 20 s. Metres, world frame.
"""

from __future__ import annotations

from kybflow.core.geometry import norm
from kybflow.core.signals import NS, Estimate, SeenObstacle, Time
from kybflow.world.shapes import Shape
from kybflow.world.vehicle_context import VehicleContext, hull_of

LOST = 1.0
"""Seconds after which an unseen obstacle stops growing."""
_FORGOTTEN = 20 * NS
_DRIFT = 0.3
"""Least assumed speed of a vehicle whose position is unknown, m/s."""


class Obstacles:
    """The obstacles of one vehicle. solids: the fixed ones, by name. hulls: the radius of each
    other vehicle, by name."""

    def __init__(self, context: VehicleContext) -> None:
        self.solids: dict[str, Shape] = {
            name: shape
            for name, shape in context.obstacles.items()
            if name not in context.touchable
        }
        diameters = context.diameters.items()
        self.hulls = {name: hull_of(d) for name, d in diameters if name != context.vehicle}
        self._last: dict[str, Estimate] = {}

    def vehicle(self, name: str, known: Estimate | None, now: Time) -> SeenObstacle | None:
        """Return another vehicle as an obstacle with its assumed size, or None if it was never seen
        or is forgotten. known: its current estimate, None if it has none."""
        last = known or self._last.get(name)
        if last is None:
            return None
        time, position, velocity = last[:3]
        hull, speed = self.hulls[name], norm(velocity)
        if time == now:
            self._last[name] = last
            return SeenObstacle(now, position, velocity, hull, speed)
        if known is None and now - time > _FORGOTTEN:
            return None
        self._last[name] = last
        return grown(SeenObstacle(time, position, velocity, hull, max(speed, _DRIFT)), now)


def grown(seen: SeenObstacle, now: Time) -> SeenObstacle:
    """Return a moving obstacle enlarged by the distance that it can have moved since it was
    seen."""
    return seen._replace(radius=seen.radius + seen.speed * min((now - seen.time) / NS, LOST))
