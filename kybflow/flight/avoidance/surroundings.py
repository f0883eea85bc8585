"""Finds what is near a vehicle: its obstacles (`kybflow.flight.avoidance.obstacles`), each with its
distance and the direction away from it.

The caller (`steer`, the processors) decides how near counts; a formation uses what vehicles publish
instead. A distant obstacle is checked again when it could have come near at 20 m/s, and after 0.1 s
at the latest. A hidden obstacle that moved away when it was last seen is believed to move away for
0.2 s. Metres, world frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from kybflow.core.geometry import UP, ZERO, Vec3, distance, dot, norm, scale, sub
from kybflow.core.signals import NS, SeenObstacle, Tick, Time
from kybflow.flight.avoidance.obstacles import LOST, Obstacles, grown
from kybflow.world.shapes import around
from kybflow.world.vehicle_context import VehicleContext

_CLOSING, _LATEST = 20.0, 0.1
"""Assumed closing speed of a distant obstacle, m/s, and the longest time between two checks, s."""
_BELIEVED = NS // 5
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
        return not (self._solids or self._vehicles or self._moves)

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
    if now - time > _BELIEVED and (now - time >= LOST * NS or dot(away, velocity) < 0.0):
        velocity = ZERO
    if apart <= 0.0:
        return Hazard(name, room, UP, velocity, 0.0, is_vehicle)
    outward = scale(away, 1.0 / apart)
    return Hazard(name, apart + room, outward, velocity, 1.0 / apart, is_vehicle)


def _until(gap: float) -> Time:
    """Return the time (ns) within which nothing can cross `gap` metres."""
    return round(min(gap / _CLOSING, _LATEST) * NS)
