"""The session: ideal vehicles in one world, and what they run into."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, combinations
from math import cos, pi, sin

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import NS, Time
from kybflow.drivers.kinematic.vehicle import IdealVehicle
from kybflow.parts import Link, Seat, Session
from kybflow.parts.link import Touch
from kybflow.world.shapes import Shape, Sphere

ROUND = tuple((cos(n * pi / 4), sin(n * pi / 4)) for n in range(8))
"""Where the edge of a vehicle is looked at."""
_Pair = tuple[IdealVehicle, str]


class KinematicWorld(Session):
    """Moves every vehicle, and what else moves, to each tick's end.

    Two vehicles touch where their centres are nearer to each other than an arm of each. A vehicle
    touches an obstacle with the disc of its hubs; its legs stand on one below.
    """

    def __init__(self, seats: Sequence[Seat]) -> None:
        self._vehicles = [IdealVehicle(seat) for seat in seats]
        self.links: dict[str, Link] = {v.context.vehicle: v for v in self._vehicles}
        self._now: Time = 0
        self._touching: frozenset[_Pair] = frozenset()
        self._pairs = tuple(
            (one, other, one.context.airframe.arm + other.context.airframe.arm)
            for one, other in combinations(self._vehicles, 2)
        )
        self._moving = {n: ball for seat in seats for n, ball in seat.context.moving.items()}

    def advance(self, now: Time) -> None:
        dt, self._now = (now - self._now) / NS, now
        for vehicle in self._vehicles:
            vehicle.move(now, dt)
        touching = frozenset(self._touches())
        if touching != self._touching:
            before, self._touching = self._touching, touching
            for vehicle, into in sorted(
                touching - before, key=lambda t: (t[0].context.vehicle, t[1])
            ):
                vehicle.tell_touch(Touch(into, carries=False))

    def close(self) -> None:
        """There is nothing to release."""

    def _touches(self) -> Iterator[_Pair]:
        balls = {
            name: Sphere(ball.at(self._now / NS), ball.radius)
            for name, ball in self._moving.items()
        }
        for one, other, apart in self._pairs:
            near = distance(one.state.position, other.state.position) < apart
            if near and not (one.is_down and other.is_down):
                yield one, other.context.vehicle
                yield other, one.context.vehicle
        for vehicle in self._vehicles:
            place, arm = vehicle.state.position, vehicle.context.airframe.arm
            for name, shape in chain(vehicle.context.obstacles.items(), balls.items()):
                if shape.distance(place) < arm and _meets(shape, place, arm):
                    yield vehicle, name


def _meets(shape: Shape, place: Vec3, arm: float) -> bool:
    """Return whether a vehicle at `place` is in a shape: its centre or the edge of its disc. Its
    legs stand on what is below."""
    x, y, z = place
    if shape.distance(place) < 0.0:
        return True
    return any(shape.distance((x + arm * c, y + arm * s, z)) < 0.0 for c, s in ROUND)
