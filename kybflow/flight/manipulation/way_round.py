"""A way round objects that stand together: in the horizontal plane, along the convex hull of their
corners widened by a distance.

The widened hull is that of a regular octagon around each corner, so it keeps at least the distance
and at most 8 % more. Together with both ends, its hull gives two ways, left and right; the shorter
one inside the fence is taken, and a straight line if the hull isn't in its way. An end inside the
hull is left, or reached, straight across the nearest side. Metres, world frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import cos, hypot, pi, sin

from kybflow.core.geometry import Vec3
from kybflow.world.shapes import Box

Point = tuple[float, float]
_SIDES = 8
_OCTAGON = [(cos(i * pi / 4.0), sin(i * pi / 4.0)) for i in range(_SIDES)]
_TOUCHING = 1e-6


def way_round(
    corners: Iterable[Vec3], keep: float, start: Vec3, goal: Vec3, fence: Box | None
) -> tuple[Vec3, ...] | None:
    """Return the points of a way from `start` to `goal` that keeps `keep` from what has these
    corners, without `start`. It rises or sinks on its first leg. None if the fence leaves no
    way."""
    wide = keep / cos(pi / _SIDES)
    around = _hull([(x + wide * u, y + wide * v) for x, y, _ in corners for u, v in _OCTAGON])
    ends = [(start[0], start[1]), (goal[0], goal[1])]
    out = [_outside(around, end) for end in ends]
    middle = [out[0], out[1]]
    if _crosses(around, out[0], out[1]):
        hull = _hull([*around, *out])
        a, b = hull.index(out[0]), hull.index(out[1])
        left = [hull[i % len(hull)] for i in range(a, (b if b >= a else b + len(hull)) + 1)]
        right = [hull[i % len(hull)] for i in range(a, (b if b <= a else b - len(hull)) - 1, -1)]
        ways = [way for way in (left, right) if all(_is_in(fence, p) for p in way)]
        if not ways:
            return None
        middle = min(ways, key=_length)
    points = [*middle, ends[1]] if out[1] != ends[1] else middle
    points = points if out[0] != ends[0] else points[1:]
    return tuple((x, y, goal[2]) for x, y in points)


def _hull(points: Iterable[Point]) -> list[Point]:
    """Return the convex hull, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))

    def half(points: Iterable[Point]) -> list[Point]:
        kept: list[Point] = []
        for p in points:
            while len(kept) > 1 and _turn(kept[-2], kept[-1], p) <= 0.0:
                kept.pop()
            kept.append(p)
        return kept[:-1]

    return half(ordered) + half(reversed(ordered))


def _turn(a: Point, b: Point, p: Point) -> float:
    """Return on which side of the line from a to b a point is: positive on its left."""
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _sides(hull: Sequence[Point]) -> Iterable[tuple[Point, Point]]:
    return pairwise([*hull, hull[0]])


def _outside(hull: Sequence[Point], p: Point) -> Point:
    """Return the point, moved across the nearest side of the hull if it is inside."""
    depths = [(_turn(a, b, p) / hypot(b[0] - a[0], b[1] - a[1]), a, b) for a, b in _sides(hull)]
    depth, a, b = min(depths)
    if depth <= 0.0:
        return p
    length = hypot(b[0] - a[0], b[1] - a[1])
    out = depth + _TOUCHING
    return (p[0] + out * (b[1] - a[1]) / length, p[1] - out * (b[0] - a[0]) / length)


def _crosses(hull: Sequence[Point], start: Point, goal: Point) -> bool:
    """Return whether the straight line passes through the hull: clip it at every side."""
    low, high = 0.0, 1.0
    for a, b in _sides(hull):
        first, last = _turn(a, b, start), _turn(a, b, goal)
        if first <= 0.0 and last <= 0.0:
            return False
        share = first / (first - last) if first != last else 0.0
        if first < 0.0:
            low = max(low, share)
        elif last < 0.0:
            high = min(high, share)
    return high - low > _TOUCHING


def _is_in(fence: Box | None, p: Point) -> bool:
    return fence is None or fence.contains((p[0], p[1], 0.5 * (fence.low[2] + fence.high[2])))


def _length(way: Sequence[Point]) -> float:
    return sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(way))
