"""What is near a vehicle: the world's obstacles, moving obstacles and other vehicles, each with its
distance and the way out of it.

Whoever keeps away from it (`steer`, the processors) says how near is near; a formation looks for
itself, at what vehicles publish. What is far away is looked at again when it could have come near,
nothing closing in faster than 20 m/s, and after 0.1 s at the latest. A moving obstacle that is not
seen grows by how far it can have gone, for a second; then it counts as lost, and stays as large.
That it goes away is believed for 0.2 s. A vehicle that has lost its estimate, and lands somewhere
there, is taken for such an obstacle for 20 s. Metres, world frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from kybflow.core.geometry import UP, ZERO, Vec3, distance, dot, norm, scale, sub
from kybflow.core.signals import NS, Estimate, SeenObstacle, Tick, Time
from kybflow.world.shapes import around
from kybflow.world.vehicle_context import VehicleContext, hull_of

_CLOSING, _LATEST = 20.0, 0.1
"""m/s, s."""
_BELIEVED, _LOST, _FORGOTTEN = 0.2, 1.0, 20.0
"""Seconds after which what is not seen no longer counts as going away, grows no more, and is kept
away from no more where it is a vehicle."""
_DRIFT = 0.3
"""The least speed of a vehicle that knows no place, m/s."""


class SecondPoint(NamedTuple):
    """Another point to look from, and by how much less than from the first may be left from it."""

    point: Vec3
    slack: float


Reach = Callable[[float], float]


class Hazard(NamedTuple):
    """Something near a point. room: from the point to its surface, negative inside. outward: the
    unit vector out of it. velocity: of its own. curvature: by how much `outward` turns for each
    metre that is gone across it, 1/m, zero where that is unknown or has no end. is_vehicle: it may
    give way, too."""

    name: str
    room: float
    outward: Vec3
    velocity: Vec3 = ZERO
    curvature: float = 0.0
    is_vehicle: bool = False


class Nearby:
    """What is near one vehicle. others: the other vehicles that count, all where it is None."""

    def __init__(self, context: VehicleContext, others: Iterable[str] | None = None) -> None:
        self._context = context
        self._solids = tuple(
            (name, shape)
            for name, shape in context.obstacles.items()
            if name not in context.touchable
        )
        self._moves = bool(context.moving)
        self.count(others)

    def count(self, others: Iterable[str] | None) -> None:
        """Let these other vehicles count from now on, all where it is None."""
        self.others = others
        diameters, own = self._context.diameters, self._context.vehicle
        named = diameters if others is None else others
        self._hulls = {n: hull_of(diameters[n]) for n in named if n in diameters and n != own}
        self._later: dict[str, Time] = {}
        self._last: dict[str, Estimate] = {}

    @property
    def is_empty(self) -> bool:
        """Whether nothing can ever be near."""
        return not (self._solids or self._hulls or self._moves)

    def near(
        self,
        point: Vec3,
        speed: float,
        tick: Tick,
        reach_of: Reach,
        also: SecondPoint | None = None,
    ) -> Iterator[Hazard]:
        """Yield what is within reach of a point that moves at `speed`, as seen from `also` where
        that is nearer by more than its slack. reach_of: how far that is at a closing speed."""
        known, slack = also or SecondPoint(point, 0.0)
        if self._solids:
            yield from self._standing(point, reach_of(speed), tick.now, known, slack)
        now, later = tick.now, self._later
        for name, seen in tick.moving.items() if self._moves else ():
            yield from _seen(name, seen, point, now, reach_of(speed + seen.speed), known, slack)
        for name, hull in self._hulls.items():
            if now < later.get(name, 0):
                continue
            other = tick.fleet.get(name)
            if other is None:
                for seen in self._without_estimate(name, hull, now):
                    reach = reach_of(speed + seen.speed)
                    yield from _seen(name, seen, point, now, reach, known, slack)
                continue
            self._last[name] = other
            apart = distance(point, other.position)
            beyond = apart - hull - reach_of(speed + norm(other.velocity))
            if beyond > 0.0:
                later[name] = now + _until(beyond)
                continue
            if distance(known, other.position) + slack < apart:
                found = _ball(name, known, other.position, other.velocity, hull - slack)
            else:
                found = _ball(name, point, other.position, other.velocity, hull)
            yield found._replace(is_vehicle=True)

    def _without_estimate(self, name: str, hull: float, now: Time) -> Iterator[SeenObstacle]:
        """Yield a vehicle that has no estimate as where it was known last, unless that is long
        ago."""
        last = self._last.get(name)
        if last is not None and not is_forgotten(last, now):
            speed = max(norm(last.velocity), _DRIFT)
            yield SeenObstacle(last.time, last.position, last.velocity, hull, speed)

    def _standing(
        self, point: Vec3, reach: float, now: Time, known: Vec3, slack: float
    ) -> Iterator[Hazard]:
        """Yield the solids within reach of a point, as `near`."""
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


def is_forgotten(last: Estimate, now: Time) -> bool:
    """Return whether a vehicle without an estimate has come down since it had its last one."""
    return now - last.time > _FORGOTTEN * NS


def _seen(
    name: str, seen: SeenObstacle, point: Vec3, now: Time, reach: float, known: Vec3, slack: float
) -> Iterator[Hazard]:
    """Yield what was seen somewhere if it is within reach of a point, as `Nearby.near`."""
    unseen = min((now - seen.time) / NS, _LOST)
    radius = seen.radius + seen.speed * unseen
    if distance(point, seen.position) - radius > reach:
        return
    there = distance(known, seen.position) + slack < distance(point, seen.position)
    place, less = (known, slack) if there else (point, 0.0)
    found = _ball(name, place, seen.position, seen.velocity, radius - less)
    goes_away = dot(found.outward, seen.velocity) < 0.0
    gone = unseen >= _LOST or (goes_away and unseen > _BELIEVED)
    yield found._replace(velocity=ZERO) if gone else found


def _ball(name: str, point: Vec3, at: Vec3, velocity: Vec3, radius: float) -> Hazard:
    away = sub(point, at)
    apart = norm(away)
    if apart <= 0.0:
        return Hazard(name, -radius, UP, velocity)
    return Hazard(name, apart - radius, scale(away, 1.0 / apart), velocity, 1.0 / apart)


def _until(gap: float) -> Time:
    """How long nothing can cross `gap`, ns."""
    return round(min(gap / _CLOSING, _LATEST) * NS)
