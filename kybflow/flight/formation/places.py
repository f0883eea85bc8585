"""Assigns vehicles to the places of a formation, and finds where it forms.

Of all assignments of vehicles to places, the one with the least sum of squared path lengths is
chosen: on straight paths with equal durations, vehicles that are far enough apart before and after
then never collide (Turpin, Michael, Kumar: CAPT, IJRR 2014). A formation without a given rotation
is rotated about the vertical so that the paths are shortest: starting from several angles,
assignment and angle are improved in turn. Every vehicle finds the same result from the same data.
World frame, metres, radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import atan2, cos, pi, sin
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, sub
from kybflow.flight.formation.shapes import centroid

_ANGLES, _ROUNDS = 12, 4
_BETTER = 1e-9
_FINE = 1e-6
"""Resolution of squared path lengths, m^2, so that rounding doesn't decide between equal ones."""


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
    from scipy.optimize import linear_sum_assignment  # slow to load, and seldom needed

    costs = [[_squared(a, b) for b in places] for a in here]
    _, columns = linear_sum_assignment(costs)
    return tuple(int(column) for column in columns)


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
    starts = (heading,) if turned is not None else _angles(heading)
    best, least = None, 0.0
    for start in starts:
        angle = start + (turned or 0.0)
        for _ in range(_ROUNDS):
            at = centre or sub(middle, turned_by(angle, origin))
            goals = [add(at, turned_by(angle, place)) for place in places]
            taken = assigned(here, goals)
            cost = sum(_squared(a, goals[i]) for a, i in zip(here, taken, strict=True))
            found = Laid(at, angle - heading, taken)
            if best is None or cost < least - _BETTER:
                best, least = found, cost
            before, angle = angle, _best_angle(here, [places[i] for i in taken], centre, angle)
            if turned is not None or abs(angle - before) < _BETTER:
                break
    assert best is not None
    return best


def _angles(heading: float) -> tuple[float, ...]:
    """Return the angles to start from: first the heading, then those on both sides, the nearest
    first."""
    steps = sorted(range(_ANGLES), key=lambda i: min(i, _ANGLES - i))
    return tuple(heading + 2.0 * pi * step / _ANGLES for step in steps)


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
    return atan2(across, along) if abs(across) + abs(along) > _BETTER else before


def _squared(a: Vec3, b: Vec3) -> float:
    """Return the squared distance, rounded to multiples of `_FINE`."""
    x, y, z = sub(a, b)
    return round((x * x + y * y + z * z) / _FINE) * _FINE


def prepare() -> None:
    """Load the solver, which is otherwise loaded on first use."""
    assigned(((0.0, 0.0, 0.0),), ((0.0, 0.0, 0.0),))
