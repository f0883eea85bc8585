"""The places of a formation in its own frame: x forward, y to the left, z up, metres.

`side` is the distance between two neighbouring places. The origin is the centroid, except for
points that a mission lists itself, which are used as they are.

    line         any number, side by side
    square       n^2 places in n rows
    triangle     n (n + 1) / 2 places in n rows, the first row's single place ahead
    tetrahedron  four: a triangle, and one above its middle
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from math import inf, isqrt, sqrt

from kybflow.core.geometry import Vec3, distance, scale, sub

_ROW = sqrt(3.0) / 2.0
"""Distance between two rows of an equilateral triangle, as a share of its side."""


def _square(count: int) -> tuple[Vec3, ...]:
    rows = isqrt(count)
    return tuple((-float(i // rows), -float(i % rows), 0.0) for i in range(count))


def _triangle(count: int) -> tuple[Vec3, ...]:
    rows = (isqrt(8 * count + 1) - 1) // 2
    return tuple((-_ROW * i, 0.5 * i - j, 0.0) for i in range(rows) for j in range(i + 1))


def _tetrahedron(count: int) -> tuple[Vec3, ...]:
    base = _centred(_triangle(3))
    return (*base, (0.0, 0.0, sqrt(2.0 / 3.0)))[:count]


SHAPES: dict[str, tuple[Callable[[int], tuple[Vec3, ...]], Callable[[int], bool], str]] = {
    "line": (
        lambda n: tuple((0.0, -float(i), 0.0) for i in range(n)), lambda n: n > 0, "any number of",
    ),
    "square": (_square, lambda n: isqrt(n) ** 2 == n, "4, 9, 16, ..."),
    "triangle": (_triangle, lambda n: isqrt(8 * n + 1) ** 2 == 8 * n + 1, "3, 6, 10, ..."),
    "tetrahedron": (_tetrahedron, lambda n: n == 4, "4"),
}  # fmt: skip
"""For each shape: a function that returns its places for n vehicles, one that returns whether n
fits, and a description of the numbers that fit."""


def objection(shape: str, count: int) -> str | None:
    """Return why a shape has no places for this number of vehicles, or None if it has."""
    _, fits, numbers = SHAPES[shape]
    return None if fits(count) else f"a {shape} has places for {numbers} vehicles, not for {count}"


def places_of(shape: str, side: float, count: int) -> tuple[Vec3, ...]:
    """Return the places of a shape for `count` vehicles. If the number doesn't fit the shape, there
    may be fewer or more places."""
    make = SHAPES[shape][0]
    return tuple(scale(place, side) for place in _centred(make(count)))


def closest(places: tuple[Vec3, ...]) -> float:
    """Return the least distance between two places; infinite if there is only one."""
    return min((distance(a, b) for a, b in combinations(places, 2)), default=inf)


def centroid(points: tuple[Vec3, ...]) -> Vec3:
    """Return the mean of at least one point."""
    x, y, z = (sum(axis) / len(points) for axis in zip(*points, strict=True))
    return (x, y, z)


def _centred(places: tuple[Vec3, ...]) -> tuple[Vec3, ...]:
    middle = centroid(places)
    return tuple(sub(place, middle) for place in places)
