"""Curves through knots: quintic pieces that join in position, velocity and acceleration (C2).

Between two knots, with h the time between them and s = t - t0, the one polynomial of degree five
that has position, slope and second derivative of both:

    p(s) = p0 + v0 s + a0/2 s^2 + c3 s^3 + c4 s^4 + c5 s^5
    D = p1 - p0 - v0 h - a0 h^2/2,   V = v1 - v0 - a0 h,   A = a1 - a0
    c3 = (10 D - 4 V h + A h^2/2) / h^3
    c4 = (-15 D + 7 V h - A h^2) / h^4,   c5 = (6 D - 3 V h + A h^2/2) / h^5

Slopes that are not known come from the cubic spline through the values that is level at both ends:

    m[i-1]/h[i-1] + 2 (1/h[i-1] + 1/h[i]) m[i] + m[i+1]/h[i] = 3 (d[i-1]/h[i-1] + d[i]/h[i])

with d the mean slopes between knots (de Boor, "A Practical Guide to Splines", 1978, ch. IV).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from kybflow.core.geometry import Vec3


class Knot(NamedTuple):
    """A value with its first two derivatives."""

    value: float
    slope: float
    bend: float


class Quintic(NamedTuple):
    """One piece; its coefficients from s^0 to s^5."""

    c0: float
    c1: float
    c2: float
    c3: float
    c4: float
    c5: float

    @classmethod
    def between(cls, start: Knot, end: Knot, h: float) -> Quintic:
        """The piece from `start` to `end` in `h` seconds."""
        (p, v, a), square = start, h * h
        gap = end.value - p - v * h - 0.5 * a * square
        change = (end.slope - v - a * h) * h
        turn = (end.bend - a) * square
        c3 = (10.0 * gap - 4.0 * change + 0.5 * turn) / (square * h)
        c4 = (-15.0 * gap + 7.0 * change - turn) / (square * square)
        c5 = (6.0 * gap - 3.0 * change + 0.5 * turn) / (square * square * h)
        return cls(p, v, 0.5 * a, c3, c4, c5)

    def at(self, s: float) -> tuple[float, float, float, float]:
        """The value and its first three derivatives."""
        c0, c1, c2, c3, c4, c5 = self
        return (
            c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
            c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5))),
            2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5)),
            6.0 * c3 + s * (24.0 * c4 + s * 60.0 * c5),
        )


def slopes(times: Sequence[float], values: Sequence[float]) -> list[float]:
    """The slope at each of at least two knots, zero at the first and the last. Solved by Thomas'
    algorithm."""
    steps = [b - a for a, b in pairwise(times)]
    pull = [(b - a) / (h * h) for a, b, h in zip(values, values[1:], steps, strict=False)]
    found = [0.0] * len(times)
    ahead = [0.0] * len(times)
    for i in range(1, len(times) - 1):
        left, right = 1.0 / steps[i - 1], 1.0 / steps[i]
        pivot = 2.0 * (left + right) - left * ahead[i - 1]
        ahead[i] = right / pivot
        found[i] = (3.0 * (pull[i - 1] + pull[i]) - left * found[i - 1]) / pivot
    for i in range(len(times) - 2, 0, -1):
        found[i] -= ahead[i] * found[i + 1]
    return found


def vector_slopes(times: Sequence[float], values: Sequence[Vec3]) -> list[Vec3]:
    """`slopes` of each axis."""
    x, y, z = (slopes(times, [value[axis] for value in values]) for axis in range(3))
    return list(zip(x, y, z, strict=True))
