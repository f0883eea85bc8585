"""The obstacles of a vehicle: what it keeps away from, whoever looks for it.

The world's obstacles count but for those that are there to be touched. Moving obstacles and other
vehicles count as balls; a vehicle's reaches to the tips of its rotors. What was seen some time ago
is still where it was seen, and larger by how far it can have gone, for a second; then it counts as
lost, and stays as large. A vehicle that says that it has no estimate lands somewhere there, and is
forgotten after 20 s. Metres, world frame.
"""

from __future__ import annotations

from kybflow.core.geometry import norm
from kybflow.core.signals import NS, Estimate, SeenObstacle, Time
from kybflow.world.shapes import Shape
from kybflow.world.vehicle_context import VehicleContext, hull_of

LOST = 1.0
"""Seconds after which what is not seen grows no more."""
_FORGOTTEN = 20 * NS
_DRIFT = 0.3
"""The least speed of a vehicle of which it isn't known where it is now, m/s."""


class Obstacles:
    """What one vehicle keeps away from. solids: what stands, by name. hulls: the radius of each
    other vehicle."""

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
        """Return another vehicle, of which this is `known` now, as large as it is taken to be; None
        where it was never seen, or is forgotten."""
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
    """Return what moves as large as it is taken to be."""
    return seen._replace(radius=seen.radius + seen.speed * min((now - seen.time) / NS, LOST))
