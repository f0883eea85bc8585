"""Finds what is near a vehicle: its obstacles (`Obstacles`) and the world's objects, each with its
distance and the direction away from it.

The caller (`steer`, the processors) decides how near counts; a formation uses what vehicles publish
instead. A distant obstacle is checked again when it could have come near at 20 m/s, and after 0.1 s
at the latest. A hidden obstacle that moved away when it was last seen is believed to move away for
0.2 s. An object is where it was seen last, or at its start; while it is hidden it grows as moving
obstacles do, by its speed. Metres, world frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import inf
from typing import NamedTuple

from kybflow.core.geometry import UP, ZERO, Vec3, distance, dot, norm, scale, sub
from kybflow.core.signals import NS, Estimate, SeenObstacle, Tick, Time
from kybflow.world.objects import base_of, place_of, seen_object, solids_of
from kybflow.world.shapes import Shape, around
from kybflow.world.vehicle_context import VehicleContext, hull_of

GROWTH_S = 1.0
"""Seconds after which an unseen obstacle stops growing."""
_MEMORY_NS = 20 * NS
_DRIFT_SPEED = 0.3
"""Least assumed speed of a vehicle whose position is unknown, m/s."""


class Obstacles:
    """The obstacles that a vehicle keeps away from.

    These are all obstacles of the world, except for those that may be touched. Moving obstacles
    and other vehicles are modelled as balls; a vehicle's ball reaches to the tips of its
    rotors. An obstacle that is no longer seen stays where it was seen last, and for one second
    grows by the distance that it can have moved; then it counts as lost and keeps its size. A
    vehicle that reports that it has no estimate lands somewhere near, and is forgotten after 20
    s. Metres, world frame.

    solids: the fixed obstacles, by name. hulls: the radius of each
    other vehicle, by name.
    """

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
        if known is None and now - time > _MEMORY_NS:
            return None
        self._last[name] = last
        return grown(SeenObstacle(time, position, velocity, hull, max(speed, _DRIFT_SPEED)), now)


def grown(seen: SeenObstacle, now: Time) -> SeenObstacle:
    """Return a moving obstacle enlarged by the distance that it can have moved since it was
    seen."""
    return seen._replace(radius=seen.radius + seen.speed * min((now - seen.time) / NS, GROWTH_S))


_CLOSING_SPEED, _MAX_PAUSE_S = 20.0, 0.1
"""Assumed closing speed of a distant obstacle, m/s, and the longest time between two checks, s."""
_RETREAT_NS = NS // 5
"""How long an unseen obstacle counts as moving away, ns."""


class SecondPoint(NamedTuple):
    """A second point from which distances count. slack: by how much less room may be left from it
    than from the first point, metres."""

    point: Vec3
    slack: float


Reach = Callable[[float], float]


class Hazard(NamedTuple):
    """Something near a point. room: the distance from the point to its surface, negative inside.
    outward: the unit vector away from it. velocity: the hazard's velocity. curvature: by how much
    `outward` turns per metre of movement across it, 1/m; zero if unknown or infinite. is_vehicle:
    whether it is a vehicle that may give way too."""

    name: str
    room: float
    outward: Vec3
    velocity: Vec3 = ZERO
    curvature: float = 0.0
    is_vehicle: bool = False


class Nearby:
    """Finds what is near one vehicle. others: the other vehicles to consider, None for all."""

    def __init__(self, context: VehicleContext, others: Iterable[str] | None = None) -> None:
        self._obstacles = Obstacles(context)
        self._solids = tuple(self._obstacles.solids.items())
        self._objects = context.objects
        self._bases = [(name, base_of(context.objects, name)) for name in context.objects]
        self._moves = bool(context.moving)
        self.count(others)

    def count(self, others: Iterable[str] | None) -> None:
        """Consider these other vehicles from now on, None for all."""
        self.others = others
        known = self._obstacles.hulls
        self._vehicles = tuple(known if others is None else (n for n in others if n in known))
        self._later: dict[str, Time] = {}

    @property
    def is_empty(self) -> bool:
        """Whether nothing can ever be near."""
        return not (self._solids or self._vehicles or self._moves or self._objects)

    def near(
        self,
        point: Vec3,
        speed: float,
        tick: Tick,
        reach_of: Reach,
        also: SecondPoint | None = None,
    ) -> Iterator[Hazard]:
        """Yield what is within reach of a point that moves at `speed`. Distances count from `also`
        if they are shorter from there by more than its slack. reach_of: returns the reach for a
        closing speed."""
        known, slack = also or SecondPoint(point, 0.0)
        if self._solids:
            yield from self._standing(point, reach_of(speed), tick.now, known, slack)
        if self._objects:
            yield from self._touchable(point, speed, tick, reach_of, known, slack)
        now, later = tick.now, self._later
        for name, seen, is_vehicle in self._moving(tick):
            apart = distance(point, seen.position)
            beyond = apart - seen.radius - reach_of(speed + seen.speed)
            if beyond > 0.0:
                later[name] = now + _until(beyond)
            elif distance(known, seen.position) + slack < apart:
                yield _ball(name, known, seen, slack, now, is_vehicle)
            else:
                yield _ball(name, point, seen, 0.0, now, is_vehicle)

    def _moving(self, tick: Tick) -> Iterator[tuple[str, SeenObstacle, bool]]:
        """Yield the moving obstacles to check, and for each whether it may give way, as a vehicle
        with an estimate may."""
        now, later = tick.now, self._later
        for name, seen in tick.moving.items() if self._moves else ():
            if now >= later.get(name, 0):
                yield name, grown(seen, now), False
        for name in self._vehicles:
            if now >= later.get(name, 0):
                known = tick.fleet.get(name)
                vehicle = self._obstacles.vehicle(name, known, now)
                if vehicle is not None:
                    yield name, vehicle, known is not None

    def _touchable(
        self, point: Vec3, speed: float, tick: Tick, reach_of: Reach, known: Vec3, slack: float
    ) -> Iterator[Hazard]:
        """Yield the objects, as `near` does, except for what is joined with the object that the
        vehicle's behavior means to touch."""
        now, later, objects = tick.now, self._later, self._objects
        meant = base_of(objects, tick.touches) if tick.touches else None
        for name, base in self._bases:
            if base == meant or now < later.get(name, 0):
                continue
            seen, velocity, hidden_s = seen_object(objects, tick.objects, name), ZERO, 0.0
            if seen is not None:
                velocity, hidden_s = seen.velocity, min((now - seen.time) / NS, GROWTH_S)
            growth = norm(velocity) * hidden_s
            if hidden_s > _RETREAT_NS / NS:
                velocity = ZERO
            reach, nearest = reach_of(speed + norm(velocity)), inf
            for box in solids_of(objects[name], place_of(objects, tick.objects, name)):
                room, there = box.distance(point), box.distance(known) + slack
                place, room = (known, there) if there < room else (point, room)
                nearest = min(nearest, room - growth)
                if room - growth <= reach:
                    yield Hazard(name, room - growth, box.outward(place), velocity)
            if nearest > reach:
                later[name] = now + _until(nearest - reach)

    def _standing(
        self, point: Vec3, reach: float, now: Time, known: Vec3, slack: float
    ) -> Iterator[Hazard]:
        """Yield the solids within `reach` of a point, with the second point `known` as in
        `near`."""
        later = self._later
        for name, shape in self._solids:
            if now < later.get(name, 0):
                continue
            room = shape.distance(point)
            if room > reach:
                later[name] = now + _until(room - reach)
                continue
            there = shape.distance(known) + slack
            place, more = (known, slack) if there < room else (point, 0.0)
            for apart, outward in around(shape, place, reach):
                yield Hazard(name, apart + more, outward)


def _ball(
    name: str, point: Vec3, seen: SeenObstacle, slack: float, now: Time, is_vehicle: bool
) -> Hazard:
    time, position, velocity, radius, _ = seen
    away = sub(point, position)
    apart, room = norm(away), slack - radius
    if now - time > _RETREAT_NS and (now - time >= GROWTH_S * NS or dot(away, velocity) < 0.0):
        velocity = ZERO
    if apart <= 0.0:
        return Hazard(name, room, UP, velocity, 0.0, is_vehicle)
    outward = scale(away, 1.0 / apart)
    return Hazard(name, apart + room, outward, velocity, 1.0 / apart, is_vehicle)


def _until(gap: float) -> Time:
    """Return the time (ns) within which nothing can cross `gap` metres."""
    return round(min(gap / _CLOSING_SPEED, _MAX_PAUSE_S) * NS)
