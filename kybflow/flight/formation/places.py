"""The places of a formation, and which vehicle takes which.

In the formation's own frame, x points forward, y to the left and z up. `side` is the distance
between two neighbouring places. The origin is the centroid, except for points that a mission lists
itself, which are used as they are.

    line         any number, side by side
    square       n^2 places in n rows
    triangle     n (n + 1) / 2 places in n rows, the first row's single place ahead
    tetrahedron  four: a triangle, and one above its middle

Of all assignments of vehicles to places, the one with the least sum of squared path lengths is
chosen: on straight paths with equal durations, vehicles that are far enough apart before and after
then never collide (Turpin, Michael, Kumar: CAPT, IJRR 2014). A formation without a given rotation
is rotated about the vertical so that the paths are shortest: starting from several angles,
assignment and angle are improved in turn. Every vehicle finds the same result from the same data.
Metres, radians.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import lru_cache
from itertools import combinations
from math import atan2, cos, hypot, inf, isqrt, pi, sin, sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, distance, norm, scale, sub

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


_ANGLES, _ROUNDS = 12, 4
_MIN_GAIN = 1e-9
_LENGTH_STEP = 1e-6
"""Resolution of squared path lengths, m^2, so that rounding doesn't decide between equal ones."""
_FREE = -1
"""The row of a column, or the column of a row, that is not assigned yet."""


class Laid(NamedTuple):
    """Where a formation is laid out. centre: its centre. turned: its rotation relative to the
    frame's heading. taken: the number of each vehicle's place."""

    centre: Vec3
    turned: float
    taken: tuple[int, ...]


def turned_by(angle: float, point: Vec3) -> Vec3:
    """Return a point rotated about the vertical."""
    c, s = cos(angle), sin(angle)
    x, y, z = point
    return (c * x - s * y, s * x + c * y, z)


def assigned(here: Sequence[Vec3], places: Sequence[Vec3]) -> tuple[int, ...]:
    """Return the number of each vehicle's place. There must be at least as many places as
    vehicles."""
    return cheapest([[_squared(a, b) for b in places] for a in here])


def cheapest(costs: Sequence[Sequence[float]]) -> tuple[int, ...]:
    """Return the column of each row in the assignment with the least sum of costs. costs: rows of
    equal lengths, at least as long as there are rows.

    Shortest augmenting paths (Crouse, IEEE Trans. Aerosp. Electron. Syst. 2016): the rows are
    assigned one after the other, each along the path that costs least more, with a price for each
    row and column. Among equal assignments, it finds that of scipy's `linear_sum_assignment`, which
    takes longer to load than 64 vehicles to be assigned.
    """
    rows, columns = len(costs), len(costs[0])
    of_row, of_column = [_FREE] * rows, [_FREE] * columns
    row_prices, column_prices = [0.0] * rows, [0.0] * columns
    for first in range(rows):
        before, lengths, passed = [_FREE] * columns, [inf] * columns, list[int]()
        left, row, reached, column = list(range(columns))[::-1], first, 0.0, _FREE
        while True:
            at, least = _FREE, inf
            for i, column in enumerate(left):
                length = reached + costs[row][column] - row_prices[row] - column_prices[column]
                if length < lengths[column]:
                    before[column], lengths[column] = row, length
                length = lengths[column]
                if length < least or (length == least and of_column[column] == _FREE):
                    at, least = i, length
            reached, column = least, left[at]
            left[at] = left[-1]
            left.pop()
            row = of_column[column]
            if row == _FREE:
                break
            passed.append(column)
        row_prices[first] += reached
        for other in passed:
            row_prices[of_column[other]] += reached - lengths[other]
            column_prices[other] -= reached - lengths[other]
        while row != first:
            row = before[column]
            of_column[column] = row
            of_row[row], column = column, of_row[row]
    return tuple(of_row)


@lru_cache(maxsize=4)
def laid(
    here: tuple[Vec3, ...],
    places: tuple[Vec3, ...],
    heading: float,
    centre: Vec3 | None = None,
    turned: float | None = None,
) -> Laid:
    """Lay out a formation where the vehicles are, or at `centre` and `turned` if these are given.
    here: the vehicles' positions. places: in the frame. heading: the frame's heading. The result is
    cached, because all members ask for it in the same tick."""
    middle, origin = centroid(here), centroid(places)
    starts = [heading]
    if turned is None:  # then the angles on both sides, the nearest first
        steps = sorted(range(_ANGLES), key=lambda i: min(i, _ANGLES - i))
        starts = [heading + 2.0 * pi * step / _ANGLES for step in steps]
    best, least = None, 0.0
    for start in starts:
        angle = start + (turned or 0.0)
        for _ in range(_ROUNDS):
            at = centre or sub(middle, turned_by(angle, origin))
            goals = [add(at, turned_by(angle, place)) for place in places]
            taken = assigned(here, goals)
            cost = sum(_squared(a, goals[i]) for a, i in zip(here, taken, strict=True))
            found = Laid(at, angle - heading, taken)
            if best is None or cost < least - _MIN_GAIN:
                best, least = found, cost
            before, angle = angle, _best_angle(here, [places[i] for i in taken], centre, angle)
            if turned is not None or abs(angle - before) < _MIN_GAIN:
                break
    assert best is not None
    return best


def _best_angle(
    here: Sequence[Vec3], places: Sequence[Vec3], centre: Vec3 | None, before: float
) -> float:
    """Return the angle at which the assigned places are nearest to the vehicles: atan2(sum a x b,
    sum a . b) over the horizontal vectors from the middle of each group, or from the given
    centre."""
    from_here = centre or centroid(tuple(here))
    from_places = (0.0, 0.0, 0.0) if centre is not None else centroid(tuple(places))
    across = along = 0.0
    for point, place in zip(here, places, strict=True):
        (bx, by, _), (ax, ay, _) = sub(point, from_here), sub(place, from_places)
        across += ax * by - ay * bx
        along += ax * bx + ay * by
    return atan2(across, along) if abs(across) + abs(along) > _MIN_GAIN else before


def _squared(a: Vec3, b: Vec3) -> float:
    """Return the squared distance, rounded to multiples of `_LENGTH_STEP`."""
    x, y, z = sub(a, b)
    return round((x * x + y * y + z * z) / _LENGTH_STEP) * _LENGTH_STEP


NEAR_PLACES = 8


class TakenPlaces(NamedTuple):
    """The taken places of a formation, as one member needs them in each tick: how far they reach,
    so that distant obstacles can be excluded at once, and which are near the member's own place.

    A member checks its distances to the nearest eight others only. With more, the cost of a tick
    would grow with the square of the number of members for little gain, because those eight keep
    their distances to the next ones.

    near: the numbers of the places nearest to the member's own, each with its distance. reach: the
    largest distance of a place from the frame's axis. low, high: the least and greatest height.
    radius: the largest distance from the centre.
    """

    places: tuple[Vec3, ...]
    near: tuple[tuple[int, float], ...]
    reach: float
    low: float
    high: float
    radius: float


def seen_from(shape: Sequence[Vec3], own: int, others: Collection[int]) -> TakenPlaces:
    """Return the taken places of a shape for the member in the place `own`. others: the places that
    other members have taken."""
    taken = sorted({i for i in others if i < len(shape)} | {own})
    places = tuple(shape[i] for i in taken)
    away = sorted((distance(shape[own], shape[i]), i) for i in taken if i != own)
    heights = [z for _, _, z in places]
    return TakenPlaces(
        places,
        tuple((i, far) for far, i in away[:NEAR_PLACES]),
        max(hypot(x, y) for x, y, _ in places),
        min(heights),
        max(heights),
        max(map(norm, places)),
    )
