"""Designs the gains of the position loop for an inner loop, and computes the margins of gains.

The poles of a double integrator under acceleration = -P e - D e' are placed like those of a
second-order system, by one frequency w:

    P = w^2,    D = 2 damping w,    I = P / 2 s,    damping 1.125,

The highest frequency is 4 rad/s, with gains of 16, 9 and 8: in a faster loop, the noise of motion
capture shakes the vehicle. The integral time is the same at every w, so that lasting disturbances
are compensated soon in a slow loop too. For a slower inner loop, w is the highest frequency, in
steps of 0.1 rad/s, at which the margins of the full frequency response (`response`) are at least
`PLANNED`: 3 dB, 33 degrees and 20 ms. With these margins, the loop doesn't oscillate even if the
gains of the on-board loop are a third lower than believed. Textbooks demand 6 dB and 30 degrees
(Skogestad and Postlethwaite, Multivariable Feedback Control, sec. 2.4.3), for models that know less
about the delays; here the delay margin is within 20 % of the one in the simulator. Gains that a
mission sets are compared with the textbook margins, `ASKED`, but the gain margin need not exceed
that of the designed gains on the same loop, 3.6 dB on the slowest one in the library. Gains that
leave less than `LEAST` are refused, because no model is exact.
"""

from __future__ import annotations

from bisect import bisect_left
from functools import lru_cache, reduce
from math import radians

from kybflow.core.params import param, params
from kybflow.core.units import Number
from kybflow.flight.loops.margins import UNSTABLE, Margins, margins
from kybflow.flight.loops.response import OuterLoop, horizontal, on_board, vertical
from kybflow.world.vehicle_context import InnerLoop

Gains = tuple[float, float, float]
"""Proportional, derivative and integral gain: P, D and I."""


@params
class DesignedGains:
    proportional: Number | None = param(
        "Acceleration per metre of position error; by default as the loop on board allows, 16 at"
        " most.",
        default=None, above=0,
    )  # fmt: skip
    derivative: Number | None = param(
        "Acceleration per m/s of velocity error; by default likewise, 9 at most.",
        default=None, above=0,
    )  # fmt: skip
    integral: Number | None = param(
        "Acceleration per metre and second of position error; by default likewise, 8 at most.",
        default=None, at_least=0,
    )  # fmt: skip


DAMPING = 1.125
INTEGRAL_TIME = 2.0
"""P divided by I, seconds."""
FREQUENCIES = tuple(tenths / 10.0 for tenths in range(10, 41))
"""The frequencies of the position loop to choose from, rad/s, rising."""
BANDWIDTHS = tuple(tenths / 10.0 for tenths in range(1, 201))
"""The bandwidths of the observer to choose from, Hz, rising."""
PLANNED = Margins(1.4, radians(33.0), 0.02)
ASKED = Margins(2.0, radians(30.0), 0.02)
LEAST = Margins(1.4, radians(15.0), 0.005)
_ROUNDED = 0.97
"""The share of a margin that is left if gains are rounded to three digits."""


def shaped(frequency: float) -> Gains:
    """Return the gains of a loop with this frequency, rad/s."""
    k = frequency**2
    return k, 2.0 * DAMPING * frequency, k / INTEGRAL_TIME


FASTEST = shaped(FREQUENCIES[-1])
"""The gains if the inner loop is unknown."""


@lru_cache(maxsize=256)
def margins_of(outer: OuterLoop, inner: InnerLoop) -> Margins:
    """Return the margins that a tracker leaves, the smallest over all directions; `UNSTABLE` if the
    on-board loop is unstable by itself."""
    if margins(on_board(outer, inner)) == UNSTABLE:
        return UNSTABLE
    k = (outer.proportional,)
    level, up, _ = outer.stiffness or (k, k, False)
    ways = [horizontal(outer._replace(proportional=k), inner) for k in level]
    ways += [vertical(outer._replace(proportional=k), inner) for k in up]
    return reduce(Margins.within, map(margins, ways))


def holds(found: Margins, bound: Margins) -> bool:
    """Return whether all margins are at least those of `bound`."""
    return all(own >= least for own, least in zip(found, bound, strict=True))


@lru_cache(maxsize=256)
def designed(outer: OuterLoop, inner: InnerLoop, bound: Margins = PLANNED) -> Gains:
    """Return the highest gains that leave the margins `bound`, or the gains of the lowest frequency
    if none do. outer: the law; its own gains are ignored."""

    def fails(frequency: float) -> bool:
        return not holds(margins_of(outer.with_gains(*shaped(frequency)), inner), bound)

    return shaped(FREQUENCIES[max(0, bisect_left(FREQUENCIES, True, key=fails) - 1)])


def completed(outer: OuterLoop, given: DesignedGains, inner: InnerLoop | None) -> OuterLoop:
    """Return the law with the gains in `given`; those that are None are designed for `inner`."""
    written = (given.proportional, given.derivative, given.integral)
    own = FASTEST if inner is None or None not in written else designed(outer, inner)
    return outer.with_gains(*(a if b is None else b for a, b in zip(own, written, strict=True)))


def asked_of(outer: OuterLoop, inner: InnerLoop) -> Margins:
    """Return the margins that gains set by a mission should leave on this loop."""
    best = margins_of(outer.with_gains(*designed(outer, inner)), inner)
    return ASKED._replace(gain=max(PLANNED.gain, min(ASKED.gain, _ROUNDED * best.gain)))


def quickest_observer(outer: OuterLoop, inner: InnerLoop, bound: Margins = PLANNED) -> float:
    """Return the highest observer bandwidth, Hz, below the current one at which these gains leave
    `bound`; 0 if there is none."""

    def leaves(bandwidth: float) -> bool:
        return holds(margins_of(outer._replace(observer=bandwidth), inner), bound)

    slower = (b for b in reversed(BANDWIDTHS) if b < outer.observer)
    return next(filter(leaves, slower), 0.0)
