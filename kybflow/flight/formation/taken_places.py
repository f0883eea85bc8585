"""The places of a formation that are taken, as the member in one of them needs them each tick: how
far they go, which excludes distant obstacles at once, and which are near its own.

A member judges its distances to its nearest eight: with more, the cost of a tick would grow with
the square of the members, and little be gained, for those keep theirs to the next. Metres, in the
frame.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import hypot
from typing import NamedTuple

from kybflow.core.geometry import Vec3, distance, norm

NEAREST = 8


class TakenPlaces(NamedTuple):
    """places: those that are taken. near: the nearest ones by number, each with its distance.
    reach: how far they go from the frame's axis; low, high: their least and greatest height;
    radius: how far they go from the centre."""

    places: tuple[Vec3, ...]
    near: tuple[tuple[int, float], ...]
    reach: float
    low: float
    high: float
    radius: float


def seen_from(shape: Sequence[Vec3], own: int, others: Collection[int]) -> TakenPlaces:
    """Return those of a shape, of which `own` and `others` are taken, for who has `own`."""
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
