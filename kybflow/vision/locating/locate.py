"""Where the body is: from all corners that all of its cameras saw at one time, together.

The equation is that of `kybflow.vision.locating.sight`, solved from a start by
`kybflow.vision.locating.fit`. Without one, or where that doesn't hold most of the tags together,
pairs of tags say where to begin (SQPnP; Terzakis and Lourakis, ECCV 2020), and what most tags agree
on wins (RANSAC). A single tag far off has two poses (IPPE; Collins and Bartoli, IJCV 2014): the one
nearer to the start counts; without a start, the more upright one where both fit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.vision.locating.fit import CALM, WILD, Fit, Located, counted, mean_squares, refined
from kybflow.vision.locating.sight import AT_REST, BodyMotion, Sight, Start, TagView
from kybflow.vision.projection import rotation

Array = NDArray[Any]

_PAIRS = 24
_RIVAL = 2.0
"""A second pose of a lone tag whose error is within this factor of the first's fits as well."""


def locate(
    views: Sequence[TagView], start: Start | None = None, motion: BodyMotion = AT_REST
) -> Located | None:
    """The body's pose from views of one moment. start: where it is believed to be. motion: what it
    is believed to do. None where the tags tell no pose."""
    sights = [Sight(view, motion) for view in views if len(view.tags)]
    if not sights:
        return None
    if start is not None:
        fit = refined(sights, numpy.array(start[0]), rotation(start[1]))
        if fit.is_sound and not _is_lone(sights):
            return fit.located(views)
    best = _acquired(sights, start)
    return best.located(views) if best is not None and best.is_sound else None


def _acquired(sights: Sequence[Sight], start: Start | None) -> Fit | None:
    """The pose that most of the tags agree on."""
    if _is_lone(sights):
        return _lone(sights, start)
    best, least, counts = None, numpy.inf, counted(sights)
    for at, body in _guesses(sights):
        residuals = numpy.concatenate([sight.residuals(at, body)[0] for sight in sights])
        squares = mean_squares(counts, residuals)
        cost = float(numpy.minimum(squares, (4.0 * WILD) ** 2).sum())
        if cost < least:
            best, least = (at, body), cost
    return refined(sights, *best) if best is not None else None


def _is_lone(sights: Sequence[Sight]) -> bool:
    return len(sights) == 1 and len(sights[0].world) == 4


def _guesses(sights: Sequence[Sight]) -> Iterator[tuple[Array, Array]]:
    for sight in sights:
        tags = numpy.arange(len(sight.world)).reshape(-1, 4)
        for pair in islice(_pairs(len(tags)), _PAIRS):
            yield from _solved(sight, tags[list(pair)].ravel(), cv2.SOLVEPNP_SQPNP)


def _pairs(n: int) -> Iterator[tuple[int, ...]]:
    """Pairs of n things, those far from each other in the list first; a lone one alone."""
    if n == 1:
        yield (0,)
    for gap in sorted(range(1, n // 2 + 1), key=lambda gap: -(gap % 3) * n - gap):
        yield from ((i, (i + gap) % n) for i in range(n if 2 * gap < n else gap))


def _solved(sight: Sight, chosen: Array, method: int) -> Iterator[tuple[Array, Array]]:
    """The body's poses from some corners of one camera."""
    chosen = chosen[sight.valid.ravel()[chosen]]
    if len(chosen) < 4:
        return
    world, flat = sight.world[chosen], sight.flat[chosen]
    middle = world.mean(axis=0)
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            world - middle, flat[:, None], numpy.eye(3), None, flags=method
        )
    except cv2.error:  # corners in a line, or too near to each other to tell a pose
        return
    for turn, shift in zip(turns, shifts, strict=True):
        body = (sight.turn @ cv2.Rodrigues(turn)[0]).T
        at = middle - body @ (sight.turn @ shift.ravel() + sight.offset)
        if numpy.isfinite(at).all():
            yield at, body


def _lone(sights: Sequence[Sight], start: Start | None) -> Fit | None:
    """From a single tag, which may have two."""
    guesses = list(_solved(sights[0], numpy.arange(4), cv2.SOLVEPNP_IPPE))
    if start is not None:
        guesses.append((numpy.array(start[0]), rotation(start[1])))
    fits = [fit for fit in (refined(sights, *guess) for guess in guesses) if fit.is_sound]
    if not fits:
        return None
    least = min(float(fit.errors[0]) for fit in fits)
    rivals = [fit for fit in fits if fit.errors[0] <= _RIVAL * max(least, CALM)]
    if start is None:
        return max(rivals, key=lambda fit: float(fit.body[2, 2]))
    before = rotation(start[1])
    return max(rivals, key=lambda fit: float((fit.body * before).sum()))
