"""Finds how far a feedback loop is from oscillating, from its frequency response.

L is the transfer function of the open loop, with the sign such that the poles of the closed loop
are the zeros of 1 + L. The margins (Astrom and Murray, Feedback Systems, 2nd ed., sec. 10.3) are

    gain    factor by which all gains may grow: the least 1 / |L| where L crosses the negative
            real axis
    phase   least phase that may be lost where |L| = 1
    delay   least delay that may be added: phase over frequency where |L| = 1

If the closed loop is unstable, they are 1, 0 and 0 (`UNSTABLE`). Nyquist's criterion decides: if L
has no pole in the right half plane and n poles at the origin, the loop is stable if 1 + L turns by
n quarter turns from zero frequency to the highest. Delays are exact. The only approximation is
between two frequencies of the grid, where log |L| and the phase are interpolated linearly; the grid
is refined where L turns fast.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import degrees, exp, inf, log, pi, sqrt, tau
from typing import NamedTuple

Response = Callable[[complex], complex]
"""A transfer function of s."""
_Point = tuple[float, complex]

MIN_RATE, MID_RATE, MAX_RATE = 0.02, 1.0, 300.0
"""Frequencies of the grid, rad/s. It is coarse below the middle one, where loops have only their
integrators."""
COARSE_STEPS, FINE_STEPS = 16, 120
MAX_TURN, MOST_HALVINGS = 0.7, 8
"""Largest angle, rad, by which L and 1 + L may turn between two frequencies, and how often a step
may be halved to achieve this."""
NEGLIGIBLE_GAIN = 0.1
"""|L| below which the response no longer matters."""


class Margins(NamedTuple):
    """The stability margins of a loop. gain: a factor. phase: rad. delay: s. Each may be
    infinite."""

    gain: float
    phase: float
    delay: float

    def within(self, other: Margins) -> Margins:
        """Return the smaller one of each margin."""
        return Margins(*map(min, self, other))


def in_words(found: Margins) -> str:
    """Return text like `gain margin 1.5, phase margin 31 deg, delay margin 52 ms`; an infinite
    margin is `inf`."""
    gain, phase, delay = found
    if found == UNSTABLE:
        return "no margin at all"
    late = f"delay margin {delay * 1e3:.0f} ms"
    return f"gain margin {gain:.3g}, phase margin {degrees(phase):.0f} deg, {late}"


UNSTABLE = Margins(1.0, 0.0, 0.0)


_GRID = (
    *(MIN_RATE * (MID_RATE / MIN_RATE) ** (k / COARSE_STEPS) for k in range(COARSE_STEPS)),
    *(MID_RATE * (MAX_RATE / MID_RATE) ** (k / FINE_STEPS) for k in range(FINE_STEPS + 1)),
)


def margins(response: Response) -> Margins:
    """Return the margins of a loop without poles in the right half plane."""
    points = [(w, response(complex(0.0, w))) for w in _GRID]
    curve = [points[0]]
    for before, after in pairwise(points):
        curve += _refined(response, before, after, MOST_HALVINGS)
    if not _is_stable(curve):
        return UNSTABLE
    gain = phase = delay = inf
    for w, size, angle in _crossings(curve):
        if angle is None:
            gain = min(gain, 1.0 / size) if size < 1.0 else gain
        else:
            phase, delay = min(phase, abs(angle)), min(delay, angle % tau / w)
    return Margins(gain, phase, delay)


def _refined(response: Response, a: _Point, b: _Point, halvings: int) -> Iterator[_Point]:
    """Yield the points after `a` up to `b`, close enough that L doesn't turn far between two of
    them."""
    (w, here), (x, there) = a, b
    if (
        halvings
        and max(abs(here), abs(there)) > NEGLIGIBLE_GAIN
        and (
            max(abs(cmath.phase(there / here)), abs(cmath.phase((1.0 + there) / (1.0 + here))))
            > MAX_TURN
        )
    ):
        middle = sqrt(w * x)
        half = middle, response(complex(0.0, middle))
        yield from _refined(response, a, half, halvings - 1)
        yield from _refined(response, half, b, halvings - 1)
    else:
        yield b


def _is_stable(curve: Sequence[_Point]) -> bool:
    """Return whether 1 + L turns as often as Nyquist's criterion requires for its poles at the
    origin."""
    (w, first), (x, second) = curve[:2]
    slope = log(abs(first) / abs(second)) / log(x / w)
    turned = sum(cmath.phase((1.0 + b) / (1.0 + a)) for (_, a), (_, b) in pairwise(curve))
    return abs(turned - round(slope) * pi / 2.0) < pi / 2.0


def _crossings(curve: Sequence[_Point]) -> Iterator[tuple[float, float, float | None]]:
    """Yield (frequency, 1, angle beyond the negative real axis) where |L| is 1, and (frequency,
    |L|, None) where L crosses that axis."""
    polar = [(log(w), log(abs(value)), cmath.phase(-value)) for w, value in curve]
    for (w, size, angle), (x, other, beyond) in pairwise(polar):
        turn = (beyond - angle + pi) % tau - pi
        if (size < 0.0) is not (other < 0.0):
            share = size / (size - other)
            yield exp(w + share * (x - w)), 1.0, angle + share * turn
        if angle * (angle + turn) < 0.0 and abs(angle) < pi / 2.0:
            share = -angle / turn
            yield exp(w + share * (x - w)), exp(size + share * (other - size)), None
