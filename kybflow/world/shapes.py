"""Solid shapes of the world: the fence's box and the obstacles, of which a ball may move. Metres,
world frame (ENU).

Each shape has a distance from a point, negative inside, and an outward direction: the unit vector
along which this distance grows fastest, upwards if all directions are equal.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import pairwise
from math import hypot, inf, sqrt
from typing import NamedTuple

from kybflow.core.geometry import UP, Vec3, add, distance, scale, sub
from kybflow.core.params import key, record
from kybflow.core.units import Length, Path, Speed
from kybflow.world.scanned import Columns, PointCloud


def _unit(x: float, y: float, z: float) -> Vec3:
    length = hypot(x, y, z)
    return (x / length, y / length, z / length) if length > 0.0 else UP


class Box(NamedTuple):
    """An axis-aligned box."""

    low: Vec3
    high: Vec3

    def contains(self, p: Vec3) -> bool:
        """Return whether `p` is inside or on the surface."""
        (x, y, z), (x0, y0, z0), (x1, y1, z1) = p, self.low, self.high
        return x0 <= x <= x1 and y0 <= y <= y1 and z0 <= z <= z1

    def outside_by(self, p: Vec3) -> float:
        """Return how far `p` is outside the box along the worst axis; negative inside."""
        low, high = self.low, self.high
        return max(
            low[0] - p[0], p[0] - high[0], low[1] - p[1], p[1] - high[1], low[2] - p[2],
            p[2] - high[2],
        )  # fmt: skip

    @property
    def size(self) -> Vec3:
        """The extent of the box along each axis."""
        return sub(self.high, self.low)

    def grown(self, by: Vec3) -> Box:
        """Return the box extended by `by` on each side."""
        return Box(sub(self.low, by), add(self.high, by))

    def distance(self, p: Vec3) -> float:
        """Return the distance from the surface to `p`; negative inside."""
        inside = self.outside_by(p)
        if inside <= 0.0:
            return inside
        x, y, z = (
            max(low - a, a - high, 0.0) for low, a, high in zip(self.low, p, self.high, strict=True)
        )
        return sqrt(x * x + y * y + z * z)

    def outward(self, p: Vec3) -> Vec3:
        """Return the outward direction of the box at `p`."""
        (x, y, z), (x0, y0, z0), (x1, y1, z1) = p, self.low, self.high
        if not self.contains(p):
            return _unit(x - min(max(x, x0), x1), y - min(max(y, y0), y1), z - min(max(z, z0), z1))
        faces = (
            (x - x0, (-1.0, 0.0, 0.0)), (x1 - x, (1.0, 0.0, 0.0)),
            (y - y0, (0.0, -1.0, 0.0)), (y1 - y, (0.0, 1.0, 0.0)),
            (z - z0, (0.0, 0.0, -1.0)), (z1 - z, UP),
        )  # fmt: skip
        return min(faces, key=lambda face: face[0])[1]

    def top(self, x: float, y: float, reach: float) -> float:
        """Return the height at which an object at (x, y) rests on the box, if the object extends
        `reach` to each side; -inf beside the box."""
        (x0, y0, _), (x1, y1, z1) = self.low, self.high
        beside = max(x0 - x, x - x1, y0 - y, y - y1)
        return z1 if beside <= reach else -inf


class Cylinder(NamedTuple):
    """An upright cylinder; `at` is the centre of its base."""

    at: Vec3
    radius: float
    height: float

    def distance(self, p: Vec3) -> float:
        """Return the distance from the surface to `p`; negative inside."""
        aside = hypot(p[0] - self.at[0], p[1] - self.at[1]) - self.radius
        above = max(self.at[2] - p[2], p[2] - self.at[2] - self.height)
        if aside <= 0.0 or above <= 0.0:
            return max(aside, above)
        return hypot(aside, above)

    def outward(self, p: Vec3) -> Vec3:
        """Return the outward direction of the cylinder at `p`."""
        x, y = p[0] - self.at[0], p[1] - self.at[1]
        aside, middle = hypot(x, y), self.at[2] + 0.5 * self.height
        out, above = aside - self.radius, abs(p[2] - middle) - 0.5 * self.height
        up = 1.0 if p[2] >= middle else -1.0
        if out <= 0.0 and (above > out or aside == 0.0):
            return (0.0, 0.0, up)
        level = max(out, 0.0) if above > 0.0 else 1.0
        return _unit(level * x / aside, level * y / aside, up * max(above, 0.0))

    def top(self, x: float, y: float, reach: float) -> float:
        """Return the height at which an object at (x, y) rests on the cylinder, as in `Box.top`."""
        aside = hypot(x - self.at[0], y - self.at[1]) - self.radius
        return self.at[2] + self.height if aside <= reach else -inf


class Sphere(NamedTuple):
    """A ball with its centre at `at`."""

    at: Vec3
    radius: float

    def distance(self, p: Vec3) -> float:
        """Return the distance from the surface to `p`; negative inside."""
        return distance(p, self.at) - self.radius

    def outward(self, p: Vec3) -> Vec3:
        """Return the outward direction of the ball at `p`."""
        return _unit(*sub(p, self.at))

    def top(self, x: float, y: float, reach: float) -> float:
        """Return the height of the ball's upper surface at (x, y), on which an object can rest, as
        in `Box.top`."""
        aside = max(hypot(x - self.at[0], y - self.at[1]) - reach, 0.0)
        if aside > self.radius:
            return -inf
        return self.at[2] + sqrt(self.radius**2 - aside**2)


MIN_NORMAL = 0.7
"""The least upward component of the normal of a surface on which a vehicle can stand."""


class Plane(NamedTuple):
    """An infinite wall through `at`, solid behind; the unit vector `facing` points out of it."""

    at: Vec3
    facing: Vec3

    def distance(self, p: Vec3) -> float:
        """Return the distance from the wall to `p`; negative behind it."""
        return sum((a - b) * n for a, b, n in zip(p, self.at, self.facing, strict=True))

    def outward(self, p: Vec3) -> Vec3:
        """Return the outward direction of the wall, which is the same everywhere."""
        return self.facing

    def top(self, x: float, y: float, reach: float) -> float:
        """Return the height of the plane at (x, y); -inf if it is a wall or a ceiling, not a
        floor."""
        (ax, ay, az), (nx, ny, nz) = self.at, self.facing
        return az - (nx * (x - ax) + ny * (y - ay)) / nz if nz > MIN_NORMAL else -inf


Convex = Box | Cylinder | Sphere | Plane
Scanned = PointCloud | Columns
Shape = Convex | Scanned


def around(shape: Shape, p: Vec3, reach: float) -> Iterable[tuple[float, Vec3]]:
    """Return (distance, outward direction) of each surface of a shape within `reach` of `p`; a
    convex shape has at most one."""
    if isinstance(shape, PointCloud | Columns):
        return shape.around(p, reach)
    room = shape.distance(p)
    return ((room, shape.outward(p)),) if room <= reach else ()


def parts_of(shape: Shape) -> Iterator[Convex]:
    """Yield the convex parts of a shape."""
    match shape:
        case PointCloud(points, radius):
            yield from (Sphere(point, radius) for point in points)
        case Columns(places, radius, low, high):
            yield from (Cylinder((x, y, low), radius, high - low) for x, y in places)
        case _:
            yield shape


_ACCELERATION = 1.5
"""Acceleration after and before each stop, m/s^2."""


@record("moving_sphere", is_whole=False)
class MovingSphere:
    """A ball that moves along a path and back.

    It moves along straight lines through the points `along` and stops at each.
    """

    along: Path = key("Its path through these points, in simulation.")
    radius: Length = key("Its radius.", above=0.0)
    speed: Speed = key("Its greatest speed.", above=0.0, at_most=2.0)
    body: str | None = key(
        "Its name in motion capture; by default that of the obstacle.", default=None
    )

    def at(self, seconds: float) -> Vec3:
        """Return the position of the centre this long after the start."""
        whole = sum(leg.duration for leg in self._legs)
        left = seconds % whole if whole > 0.0 else 0.0
        for leg in self._legs:
            if left < leg.duration:
                return leg.at(left)
            left -= leg.duration
        return self.along[0]

    @cached_property
    def _legs(self) -> tuple[_Leg, ...]:
        there = [_Leg.between(a, b, self.speed) for a, b in pairwise(self.along)]
        return (*there, *(leg.turned() for leg in reversed(there)))


class _Leg(NamedTuple):
    """A straight line from rest to rest. The speed rises to `speed` within `ramp` seconds, and
    falls again within as many."""

    start: Vec3
    end: Vec3
    speed: float
    ramp: float
    duration: float

    @classmethod
    def between(cls, start: Vec3, end: Vec3, speed: float) -> _Leg:
        length = distance(start, end)
        speed = min(speed, sqrt(_ACCELERATION * length))
        ramp = speed / _ACCELERATION
        return cls(start, end, speed, ramp, length / speed + ramp if speed > 0.0 else 0.0)

    def turned(self) -> _Leg:
        return self._replace(start=self.end, end=self.start)

    def at(self, time: float) -> Vec3:
        left = self.duration - time
        if time < self.ramp:
            gone = 0.5 * _ACCELERATION * time * time
        elif left < self.ramp:
            gone = self.speed * (self.duration - self.ramp) - 0.5 * _ACCELERATION * left * left
        else:
            gone = self.speed * (time - 0.5 * self.ramp)
        return add(
            self.start, scale(sub(self.end, self.start), gone / distance(self.start, self.end))
        )
