"""The taken places of a formation, as one member needs them in each tick: how far they reach, so
that distant obstacles can be excluded at once, and which are near the member's own place.

A member checks its distances to the nearest eight others only. With more, the cost of a tick would
grow with the square of the number of members for little gain, since those in turn keep theirs to
the next. Metres, in the formation's frame.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import hypot
from typing import NamedTuple

from kybflow.core.geometry import Vec3, distance, norm

NEAREST = 8


class TakenPlaces(NamedTuple):
    """The taken places. near: the numbers of those nearest to the member's own place, each with its
    distance. reach: their largest distance from the frame's axis. low, high: their least and
    greatest height. radius: their largest distance from the centre."""

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
        tuple((i, far) for far, i in away[:NEAREST]),
        max(hypot(x, y) for x, y, _ in places),
        min(heights),
        max(heights),
        max(map(norm, places)),
    )
