"""Scanned obstacles: balls of one radius around the points of a cloud, and upright cylinders of one
radius and height on the occupied cells of a floor plan. Metres, world frame (ENU).

Such an obstacle is not convex, so one distance and one direction don't describe it near a position.
`around` returns planes instead: the plane through the nearest point, normal to the line to it, then
the plane through the nearest of the points that are not behind the first plane, and so on, as in
Liu et al., *Planning Dynamically Feasible Trajectories for Quadrotors Using Safe Flight Corridors*
(RA-L 2017). The space in front of all planes contains no point.

numpy is imported on first use, because most missions have no scanned obstacle. The nearest point is
found among all of them: below some 5,000 points that is faster than a k-d tree, and at
`MOST_POINTS` it takes 0.1 ms.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import cos, hypot, inf, sin, sqrt
from typing import TYPE_CHECKING, Any

from kybflow.core.geometry import UP, Vec3, sub

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[Any]

MOST_POINTS = 20_000
"""The largest number of points in a cloud."""
MAX_RANGE = 10_000.0
"""The largest coordinate of a point, metres."""
METRES = {"m": 1.0, "mm": 1e-3}
"""The units of a scan, in metres."""
_PLANES = 8
"""The largest number of planes around a position."""


@dataclass(frozen=True)
class PointCloud:
    """Balls of one radius around one or more points."""

    points: tuple[Vec3, ...] = field(repr=False)
    radius: float

    @classmethod
    def of(cls, points: Array, radius: float) -> PointCloud:
        """Return the cloud of these points, (n, 3)."""
        return cls(tuple(map(tuple, points.tolist())), radius)

    def distance(self, p: Vec3) -> float:
        """Return the distance from the nearest ball to `p`; negative inside."""
        return _nearest(self._axes, p)[0] - self.radius

    def outward(self, p: Vec3) -> Vec3:
        """Return the outward direction at `p`: away from the nearest point."""
        apart, index = _nearest(self._axes, p)
        x, y, z = sub(p, self.points[index])
        return (x / apart, y / apart, z / apart) if apart > 0.0 else UP

    def around(self, p: Vec3, reach: float) -> list[tuple[float, Vec3]]:
        """Return (distance, outward direction) of the planes within `reach` of `p`, the nearest
        first."""
        ways = self.array[_squares(self._axes, p) <= (reach + self.radius) ** 2] - p
        return planes(ways, (ways**2).sum(axis=1) ** 0.5, self.radius)

    def nearest_on(self, a: Vec3, b: Vec3) -> tuple[float, Vec3]:
        """Return the least distance between the segment from `a` to `b` and the balls, and the
        position on the segment where it occurs."""
        import numpy as np

        start, way = np.array(a), np.subtract(b, a)
        length = float(way @ way)
        shares = ((self.array - start) @ way) / length if length > 0.0 else self.array[:, 0] * 0.0
        feet = start + np.clip(shares, 0.0, 1.0)[:, None] * way
        apart = ((self.array - feet) ** 2).sum(axis=1)
        least = int(apart.argmin())
        x, y, z = feet[least].tolist()
        return sqrt(float(apart[least])) - self.radius, (x, y, z)

    def top(self, x: float, y: float, reach: float) -> float:
        """Return the height at which an object at (x, y) rests on the cloud, as in `Box.top`."""
        import numpy as np

        aside = np.hypot(self.array[:, 0] - x, self.array[:, 1] - y) - reach
        carries = aside <= self.radius
        if not carries.any():
            return -inf
        rise = np.sqrt(self.radius**2 - np.maximum(aside[carries], 0.0) ** 2)
        return float((self.array[carries, 2] + rise).max())

    @cached_property
    def bounds(self) -> tuple[Vec3, Vec3]:
        """The lowest and the highest corner of the bounding box."""
        low, high = self.array.min(axis=0) - self.radius, self.array.max(axis=0) + self.radius
        return tuple(low.tolist()), tuple(high.tolist())

    @cached_property
    def array(self) -> Array:
        """The points, (n, 3)."""
        import numpy as np

        return np.array(self.points)

    @cached_property
    def _axes(self) -> tuple[Array, ...]:
        return tuple(self.array.T.copy())


def _squares(axes: Iterable[Array], p: Sequence[float]) -> Array:
    """Return the squared distance of each point from `p`. axes: the points' coordinates along each
    axis of `p`, (n,)."""
    squares: Any = 0.0
    for coordinates, own in zip(axes, p, strict=True):
        gaps = coordinates - own
        squares = squares + gaps * gaps
    found: Array = squares
    return found


def _nearest(axes: Iterable[Array], p: Sequence[float]) -> tuple[float, int]:
    """Return the distance from `p` to the nearest point, and that point's index."""
    squares = _squares(axes, p)
    index = int(squares.argmin())
    return sqrt(squares[index]), index


def planes(ways: Array, apart: Array, radius: float) -> list[tuple[float, Vec3]]:
    """Return (distance, outward direction) of planes that have all points behind them, the nearest
    first. ways: the vectors to the points, (n, 3). apart: their lengths, (n,). radius: the radius
    of the ball around each point."""
    found: list[tuple[float, Vec3]] = []
    while len(ways) and len(found) < _PLANES:
        first = int(apart.argmin())
        room = float(apart[first])
        x, y, z = ways[first].tolist()
        out = (-x / room, -y / room, -z / room) if room > 0.0 else UP
        found.append((room - radius, out))
        before = ways @ out > -room * (1.0 - 1e-9)
        ways, apart = ways[before], apart[before]
    return found


def placed(points: Array, metres: float, at: Vec3, heading: float, above: float | None) -> Array:
    """Transform a scan's points to the world. metres: the scan's unit in metres. at, heading: the
    pose of its origin. above: only points higher than this are kept, None for all."""
    import numpy as np

    c, s = cos(heading), sin(heading)
    turn = np.array(((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)))
    moved: Array = metres * points @ turn + at
    return moved if above is None else moved[moved[:, 2] > above]


def thinned(points: Array, radius: float) -> Array:
    """Return the first point in each cube with the diagonal `radius`, so that every dropped point
    is within `radius` of one that is kept."""
    import numpy as np

    cells = np.floor(points * (sqrt(3.0) / radius)).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    kept: Array = points[np.sort(first)]
    return kept


_STEPS = 40
"""Steps of a golden-section search to 1e-8 of a line's length."""
_RATIO = 0.6180339887498949  # the golden section


@dataclass(frozen=True)
class Columns:
    """One or more cylinders. places: their centres (x, y). low, high: the heights of their bases
    and tops."""

    places: tuple[tuple[float, float], ...] = field(repr=False)
    radius: float
    low: float
    high: float

    @classmethod
    def over(cls, places: Array, cell: float, low: float, high: float) -> Columns:
        """Return cylinders that cover square cells of the width `cell`. places: the centres of the
        cells, (n, 2)."""
        return cls(tuple(map(tuple, places.tolist())), cell * sqrt(0.5), low, high)

    def distance(self, p: Vec3) -> float:
        """Return the distance from the nearest surface to `p`; negative inside."""
        aside = _nearest(self._axes, p[:2])[0] - self.radius
        above = self._above(p)
        return max(aside, above) if aside <= 0.0 or above <= 0.0 else hypot(aside, above)

    def outward(self, p: Vec3) -> Vec3:
        """Return the outward direction of the nearest cylinder at `p`."""
        apart, index = _nearest(self._axes, p[:2])
        (x, y), aside, above = self.places[index], apart - self.radius, self._above(p)
        up = 1.0 if p[2] >= 0.5 * (self.low + self.high) else -1.0
        if aside <= 0.0 and above > aside:
            return (0.0, 0.0, up)
        if apart <= 0.0:
            return (1.0, 0.0, 0.0)
        level, rise = (max(aside, 0.0), max(above, 0.0)) if above > 0.0 else (1.0, 0.0)
        length = hypot(level, rise)
        share = level / length / apart
        return (share * (p[0] - x), share * (p[1] - y), up * rise / length)

    def around(self, p: Vec3, reach: float) -> list[tuple[float, Vec3]]:
        """Return (distance, outward direction) of each tangent plane within `reach` of `p`, the
        nearest first. If `p` is inside a cylinder, return only its nearest plane."""
        import numpy as np

        room = self.distance(p)
        if room <= 0.0:
            return [(room, self.outward(p))]
        near = self.array[_squares(self._axes, p[:2]) <= (reach + self.radius) ** 2]
        ways = near - p[:2]
        apart = np.hypot(ways[:, 0], ways[:, 1])
        level = ways * (np.maximum(1.0 - self.radius / np.maximum(apart, 1e-9), 0.0))[:, None]
        rise = min(max(p[2], self.low), self.high) - p[2]
        found = np.column_stack((level, np.full(len(level), rise)))
        gaps = np.sqrt((found**2).sum(axis=1))
        return planes(found[gaps <= reach], gaps[gaps <= reach], 0.0)

    def nearest_on(self, a: Vec3, b: Vec3) -> tuple[float, Vec3]:
        """Return the least distance between the segment from `a` to `b` and the cylinders, and the
        position on the segment where it occurs. It is found by a golden-section search for each
        cylinder, whose distance has only one minimum along a line."""
        import numpy as np

        start, way = np.array(a), np.subtract(b, a)
        low, high = np.zeros(len(self.places)), np.ones(len(self.places))
        for _ in range(_STEPS):
            left, right = high - _RATIO * (high - low), low + _RATIO * (high - low)
            nearer = self._gaps(start + left[:, None] * way) <= self._gaps(
                start + right[:, None] * way
            )
            low, high = np.where(nearer, low, left), np.where(nearer, right, high)
        points = start + low[:, None] * way
        gaps = self._gaps(points)
        least = int(gaps.argmin())
        x, y, z = points[least].tolist()
        return float(gaps[least]), (x, y, z)

    def top(self, x: float, y: float, reach: float) -> float:
        """Return the height at which an object at (x, y) rests on the cylinders, as in
        `Box.top`."""
        aside = _nearest(self._axes, (x, y))[0] - self.radius
        return self.high if aside <= reach else -inf

    @cached_property
    def bounds(self) -> tuple[Vec3, Vec3]:
        """The lowest and the highest corner of the bounding box."""
        (x0, y0), (x1, y1) = self.array.min(axis=0).tolist(), self.array.max(axis=0).tolist()
        r = self.radius
        return (x0 - r, y0 - r, self.low), (x1 + r, y1 + r, self.high)

    @cached_property
    def array(self) -> Array:
        """The centres of the cylinders, (n, 2)."""
        import numpy as np

        return np.array(self.places)

    def _above(self, p: Vec3) -> float:
        return max(self.low - p[2], p[2] - self.high)

    def _gaps(self, points: Array) -> Array:
        """Return the distance of each cylinder from its own point. points: one for each cylinder,
        (n, 3)."""
        import numpy as np

        aside = np.hypot(*(points[:, :2] - self.array).T) - self.radius
        above = np.maximum(self.low - points[:, 2], points[:, 2] - self.high)
        inside = np.minimum(np.maximum(aside, above), 0.0)
        gaps: Array = inside + np.hypot(np.maximum(aside, 0.0), np.maximum(above, 0.0))
        return gaps

    @cached_property
    def _axes(self) -> tuple[Array, ...]:
        return tuple(self.array.T.copy())
