"""Finds a path in a formation's frame to a free place, around the places that are taken.

A vehicle that joins a standing formation flies straight to its place. If that leads too close to
another, it flies over one corner beside, above or below that one: the corner with the shortest path
of which both legs are clear. The others stay in their places meanwhile, so a path that is clear in
the frame stays clear while the frame moves. Metres, in the frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import cos, pi, sin

from kybflow.core.geometry import Vec3, add, distance, least_distance, scale, sub
from kybflow.flight.formation.frame import Shift
from kybflow.flight.motion import Motion

_ROUND = 8
"""Corners on each level circle round a place."""
_WIDER = (1.1, 1.5, 2.2)
"""Distances of the corners from a place, as multiples of the least distance that a leg must keep;
they are larger because the legs cut the circle."""


def clear_way(
    start: Vec3,
    goal: Vec3,
    taken: Sequence[Vec3],
    apart: float,
    is_open: Callable[[Vec3, Vec3], bool],
) -> tuple[Vec3, ...] | None:
    """Return the points after `start` of a path to `goal`, or None if there is none. The path keeps
    the distance `apart` from the places in `taken`; from a place that is already nearer to the
    start or the goal, it keeps that distance. is_open: returns whether a leg is clear of other
    things; not called for the straight path."""
    bounds = [(one, min(apart, distance(start, one), distance(goal, one))) for one in taken]
    near = [(one, bound) for one, bound in bounds if bound > 0.0]
    in_the_way = [one for one, bound in near if not _passes(start, goal, one, bound)]
    if not in_the_way:
        return (goal,)
    corners = [corner for one in in_the_way for corner in _beside(one, apart)]
    for corner in sorted(corners, key=lambda c: distance(start, c) + distance(c, goal)):
        legs = ((start, corner), (corner, goal))
        if all(_passes(*leg, one, bound) for leg in legs for one, bound in near) and all(
            is_open(*leg) for leg in legs
        ):
            return (corner, goal)
    return None


def _passes(start: Vec3, end: Vec3, place: Vec3, apart: float) -> bool:
    """Return whether a leg stays `apart` from a place, within rounding."""
    return least_distance(sub(start, place), sub(end, place)) >= apart - 1e-6


def _beside(place: Vec3, apart: float) -> Iterator[Vec3]:
    for wider in _WIDER:
        for i in range(_ROUND):
            angle = 2.0 * pi * i / _ROUND
            yield add(place, scale((cos(angle), sin(angle), 0.0), wider * apart))
        yield add(place, (0.0, 0.0, wider * apart))
        yield add(place, (0.0, 0.0, -wider * apart))


class WayToPlace:
    """A motion in the formation's frame from `start` through `points`, with a stop at each. length:
    if the path is straight, it takes as long as a path of this length."""

    def __init__(
        self,
        start: Motion,
        points: Sequence[Vec3],
        length: float,
        speed: float,
        acceleration: float,
    ) -> None:
        self.duration = 0.0
        legs: list[tuple[float, Shift]] = []
        for point in points:
            far = length if len(points) == 1 else distance(start.position, point)
            leg = Shift(start, point, Shift.time_for(far, speed, acceleration))
            legs.append((self.duration, leg))
            self.duration += leg.duration
            start = Motion(point)
        self._last_first = legs[::-1]

    def at(self, time: float) -> Motion:
        """Return the motion in the frame `time` seconds after the start. Raises ValueError if
        `time` is negative."""
        for began, leg in self._last_first:
            if time >= began:
                return leg.at(time - began)
        raise ValueError(f"{time} s is before the start")
