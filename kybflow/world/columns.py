"""An extruded floor plan: upright cylinders of one radius and height. Metres, world frame (ENU).

Like a point cloud (`kybflow.world.point_cloud`) it is not convex; `around` describes it near a
point by planes. numpy and scipy are imported on first use.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import hypot, inf, sqrt
from typing import TYPE_CHECKING, Any

from kybflow.core.geometry import Vec3
from kybflow.world.point_cloud import planes

if TYPE_CHECKING:
    from kybflow.world.point_cloud import Array

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
        aside = float(self._tree.query(p[:2])[0]) - self.radius
        above = self._above(p)
        return max(aside, above) if aside <= 0.0 or above <= 0.0 else hypot(aside, above)

    def outward(self, p: Vec3) -> Vec3:
        """Return the outward direction of the nearest cylinder at `p`."""
        apart, index = self._tree.query(p[:2])
        (x, y), aside, above = self.places[index], float(apart) - self.radius, self._above(p)
        up = 1.0 if p[2] >= 0.5 * (self.low + self.high) else -1.0
        if aside <= 0.0 and above > aside:
            return (0.0, 0.0, up)
        if apart <= 0.0:
            return (1.0, 0.0, 0.0)
        level, rise = (max(aside, 0.0), max(above, 0.0)) if above > 0.0 else (1.0, 0.0)
        length = hypot(level, rise)
        share = level / length / float(apart)
        return (share * (p[0] - x), share * (p[1] - y), up * rise / length)

    def around(self, p: Vec3, reach: float) -> list[tuple[float, Vec3]]:
        """Return (distance, outward direction) of the planes within `reach` of `p`, the nearest
        first. Inside a cylinder, only the nearest one counts."""
        import numpy as np

        room = self.distance(p)
        if room <= 0.0:
            return [(room, self.outward(p))]
        near = self.array[self._tree.query_ball_point(p[:2], reach + self.radius)]
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
        """Return the height at which the cylinders carry something at (x, y) that extends `reach`
        to each side; -inf beside them."""
        aside = float(self._tree.query((x, y))[0]) - self.radius
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
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.array)
