"""A scanned obstacle: balls of one radius around the points of a cloud. Metres, world frame (ENU).

The cloud is not convex, so one distance and one direction don't describe it around a place.
`around` returns planes instead: the plane before the nearest point, at right angles to the way
there, then the plane before the nearest point that is not behind it, and so on, as in Liu et al.,
*Planning Dynamically Feasible Trajectories for Quadrotors Using Safe Flight Corridors* (RA-L 2017).
The space before all planes holds no point.

numpy and scipy are imported on first use, because most missions have no cloud.
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
"""The most points of one cloud."""
FARTHEST = 10_000.0
"""The largest coordinate of a point, metres."""
METRES = {"m": 1.0, "mm": 1e-3}
"""The units of a scan."""
_PLANES = 8
"""The most planes around a place."""


@dataclass(frozen=True)
class PointCloud:
    """Balls around one or more points."""

    points: tuple[Vec3, ...] = field(repr=False)
    radius: float

    @classmethod
    def of(cls, points: Array, radius: float) -> PointCloud:
        """Make the cloud of points, (n, 3)."""
        return cls(tuple(map(tuple, points.tolist())), radius)

    def distance(self, p: Vec3) -> float:
        """Return the distance from the nearest ball to `p`; negative inside."""
        return float(self._tree.query(p)[0]) - self.radius

    def outward(self, p: Vec3) -> Vec3:
        """Return the way out of it at `p`: away from the nearest point."""
        apart, index = self._tree.query(p)
        return _away(p, self.points[index], float(apart))

    def around(self, p: Vec3, reach: float) -> list[tuple[float, Vec3]]:
        """Return (distance, way out) of the planes within `reach` of `p`, the nearest first."""
        ways = self.array[self._tree.query_ball_point(p, reach + self.radius)] - p
        return planes(ways, (ways**2).sum(axis=1) ** 0.5, self.radius)

    def nearest_on(self, a: Vec3, b: Vec3) -> tuple[float, Vec3]:
        """Return the least distance from the line between two places, and its place on the line."""
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
        """Return the height of its highest top at (x, y), as `Box.top`."""
        import numpy as np

        aside = np.hypot(self.array[:, 0] - x, self.array[:, 1] - y) - reach
        carries = aside <= self.radius
        if not carries.any():
            return -inf
        rise = np.sqrt(self.radius**2 - np.maximum(aside[carries], 0.0) ** 2)
        return float((self.array[carries, 2] + rise).max())

    @cached_property
    def bounds(self) -> tuple[Vec3, Vec3]:
        """The lowest and the highest corner of its bounding box."""
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
    """Return planes with all places behind them, the nearest first: (distance, unit vector out of
    it). ways, apart: the way to each place, and its length. radius: of the ball around each."""
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
    """Return a scan's points in the world. metres: its unit. at, heading: the pose of its origin.
    above: only points higher than this are kept."""
    import numpy as np

    c, s = cos(heading), sin(heading)
    turn = np.array(((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)))
    moved: Array = metres * points @ turn + at
    return moved if above is None else moved[moved[:, 2] > above]


def thinned(points: Array, radius: float) -> Array:
    """Return the first point of each cube with the diagonal `radius`, so that no dropped point is
    further than that from a kept one."""
    import numpy as np

    cells = np.floor(points * (sqrt(3.0) / radius)).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    kept: Array = points[np.sort(first)]
    return kept
