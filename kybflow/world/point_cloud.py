"""A scanned thing: balls of one radius around the points of a cloud. Metres, world frame (ENU).

Unlike the other shapes it is not convex, so one distance and one direction don't say what is around
a place. `around` gives what does: the nearest point, then the nearest of those that are not behind
the plane at right angles to the way there, and so on, as in Liu et al., *Planning Dynamically
Feasible Trajectories for Quadrotors Using Safe Flight Corridors* (RA-L 2017). Whoever stays before
these planes meets no point.

numpy and scipy are loaded with the first question, for most missions have no cloud.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import cos, inf, sin, sqrt
from typing import TYPE_CHECKING, Any

from kybflow.core.geometry import UP, Vec3

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[Any]

MOST = 20_000
"""Points of one cloud."""
FARTHEST = 10_000.0
"""How far along an axis one may be."""
METRES = {"m": 1.0, "mm": 1e-3}
"""What a scan may be measured in."""
_PLANES = 8
"""Directions in which something is looked for around a place."""


@dataclass(frozen=True)
class PointCloud:
    """Balls around points, one at least."""

    points: tuple[Vec3, ...] = field(repr=False)
    radius: float

    @classmethod
    def of(cls, points: Array, radius: float) -> PointCloud:
        """Return the cloud of points, (n, 3)."""
        return cls(tuple(map(tuple, points.tolist())), radius)

    def distance(self, p: Vec3) -> float:
        """Return the distance from the nearest ball to `p`; negative inside."""
        return float(self._tree.query(p)[0]) - self.radius

    def outward(self, p: Vec3) -> Vec3:
        """Return the way out of it at `p`: away from the nearest point."""
        apart, index = self._tree.query(p)
        return _away(p, self.points[index], float(apart))

    def around(self, p: Vec3, reach: float) -> list[tuple[float, Vec3]]:
        """Return what is within `reach` of `p`, the nearest first: the distance to a ball, and the
        way out of it."""
        ways = self.array[self._tree.query_ball_point(p, reach + self.radius)] - p
        return planes(ways, (ways**2).sum(axis=1) ** 0.5, self.radius)

    def nearest_on(self, a: Vec3, b: Vec3) -> tuple[float, Vec3]:
        """Return the least distance from the line between two places, and where on it."""
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
        """Return the height at which it carries what is at (x, y), as `Box.top`: its highest there,
        whatever is below."""
        import numpy as np

        aside = np.hypot(self.array[:, 0] - x, self.array[:, 1] - y) - reach
        carries = aside <= self.radius
        if not carries.any():
            return -inf
        rise = np.sqrt(self.radius**2 - np.maximum(aside[carries], 0.0) ** 2)
        return float((self.array[carries, 2] + rise).max())

    @cached_property
    def bounds(self) -> tuple[Vec3, Vec3]:
        """The lowest and the highest corner of a box around it."""
        low, high = self.array.min(axis=0) - self.radius, self.array.max(axis=0) + self.radius
        return tuple(low.tolist()), tuple(high.tolist())

    @cached_property
    def array(self) -> Array:
        """The points, (n, 3)."""
        import numpy as np

        return np.array(self.points)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.array)


def _away(p: Vec3, point: Vec3, apart: float) -> Vec3:
    if apart <= 0.0:
        return UP
    (x, y, z), (px, py, pz) = p, point
    return ((x - px) / apart, (y - py) / apart, (z - pz) / apart)


def planes(ways: Array, apart: Array, radius: float) -> list[tuple[float, Vec3]]:
    """Return before what one must stay to meet none of some places, the nearest first: how far each
    plane is, and the unit vector out of it. ways, apart: the way to each, and its length. radius:
    of what is around each."""
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
    """Return a scan's points in the world. metres: its unit. at, heading: where its origin is, and
    how it is turned there. above: what is not higher is left out."""
    import numpy as np

    c, s = cos(heading), sin(heading)
    turn = np.array(((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)))
    moved: Array = metres * points @ turn + at
    return moved if above is None else moved[moved[:, 2] > above]


def thinned(points: Array, radius: float) -> Array:
    """Return one of the points of each cube with the diagonal `radius`, so that none that is left
    out is further than that from one that is kept. Those that come first are kept."""
    import numpy as np

    cells = np.floor(points * (sqrt(3.0) / radius)).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    kept: Array = points[np.sort(first)]
    return kept
