"""Gains of the position loop from what answers it, and the margins that gains leave.

The poles of a double integrator under acceleration = -P e - D e' are shaped as those of a
second-order system, by one frequency w:

    P = w^2,    D = 2 damping w,    I = P / 2 s,    damping 1.125,

which is 16, 9 and 8 at the 4 rad/s that is as fast as it gets: faster, the noise of motion capture
shakes the vehicle. The integral takes as long at every w, so that what lasts is soon gone on a slow
loop too. On a loop that answers later w is the highest, in steps of 0.1 rad/s, whose margins by the
loop's whole frequency response (`response`) are at least `PLANNED`: 3 dB, 33 degrees and 20 ms.
So much is left that a loop on board whose gains are a third lower than believed doesn't oscillate.
Textbooks ask for 6 dB and 30 degrees (Skogestad and Postlethwaite, Multivariable Feedback Control,
sec. 2.4.3) of models that know less of the delays; here the delay margin is within 20 % of the one
that is flown in the simulator. A margin counts for gains that are written as the textbooks ask,
`ASKED`, but for a gain margin that the gains of the design don't leave on that loop either, 3.6 dB
on the slowest of the library's. Gains that leave less than `LEAST` are refused: nothing is exactly
what it is believed to be.
"""

from __future__ import annotations

from bisect import bisect_left
from functools import lru_cache, reduce
from math import radians

from kybflow.core.params import param, params
from kybflow.core.units import Number
from kybflow.flight.loops.margins import UNSTABLE, Margins, margins
from kybflow.flight.loops.response import OuterLoop, horizontal, on_board, vertical
from kybflow.world.inner_loop import InnerLoop

Gains = tuple[float, float, float]
"""P, D and I."""


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
"""P over I, s."""
FREQUENCIES = tuple(tenths / 10.0 for tenths in range(10, 41))
"""Of the loop, rad/s, rising."""
BANDWIDTHS = tuple(tenths / 10.0 for tenths in range(1, 201))
"""Of the observer, Hz, rising."""
PLANNED = Margins(1.4, radians(33.0), 0.02)
ASKED = Margins(2.0, radians(30.0), 0.02)
LEAST = Margins(1.4, radians(15.0), 0.005)
_ROUNDED = 0.97
"""Of a margin that is left by gains with three digits."""


def shaped(frequency: float) -> Gains:
    """The gains of a loop with this frequency, rad/s."""
    k = frequency**2
    return k, 2.0 * DAMPING * frequency, k / INTEGRAL_TIME


FASTEST = shaped(FREQUENCIES[-1])
"""The gains on an undeclared loop."""


@lru_cache(maxsize=256)
def margins_of(outer: OuterLoop, inner: InnerLoop) -> Margins:
    """The margins that a tracker leaves, the smallest of every direction; none where the loop on
    board is unstable by itself."""
    if margins(on_board(outer, inner)) == UNSTABLE:
        return UNSTABLE
    k = (outer.proportional,)
    level, up, _ = outer.stiffness or (k, k, False)
    ways = [horizontal(outer._replace(proportional=k), inner) for k in level]
    ways += [vertical(outer._replace(proportional=k), inner) for k in up]
    return reduce(Margins.within, map(margins, ways))


def holds(found: Margins, bound: Margins) -> bool:
    """Whether margins are at least those of `bound`."""
    return all(own >= least for own, least in zip(found, bound, strict=True))


@lru_cache(maxsize=256)
def designed(outer: OuterLoop, inner: InnerLoop, bound: Margins = PLANNED) -> Gains:
    """The highest gains that leave `bound`; those of the lowest frequency where none do. outer: the
    law, whose own gains don't matter."""

    def fails(frequency: float) -> bool:
        return not holds(margins_of(outer.with_gains(*shaped(frequency)), inner), bound)

    return shaped(FREQUENCIES[max(0, bisect_left(FREQUENCIES, True, key=fails) - 1)])


def completed(outer: OuterLoop, given: DesignedGains, inner: InnerLoop | None) -> OuterLoop:
    """The law with the gains that are given, and those of the design on `inner` for the rest."""
    written = (given.proportional, given.derivative, given.integral)
    own = FASTEST if inner is None or None not in written else designed(outer, inner)
    return outer.with_gains(*(a if b is None else b for a, b in zip(own, written, strict=True)))


def asked_of(outer: OuterLoop, inner: InnerLoop) -> Margins:
    """The margins that gains which are written should leave on this loop."""
    best = margins_of(outer.with_gains(*designed(outer, inner)), inner)
    return ASKED._replace(gain=max(PLANNED.gain, min(ASKED.gain, _ROUNDED * best.gain)))


def quickest_observer(outer: OuterLoop, inner: InnerLoop, bound: Margins = PLANNED) -> float:
    """The highest bandwidth below the observer's own, Hz, at which these gains leave `bound`; 0 for
    none."""

    def leaves(bandwidth: float) -> bool:
        return holds(margins_of(outer._replace(observer=bandwidth), inner), bound)

    slower = (b for b in reversed(BANDWIDTHS) if b < outer.observer)
    return next(filter(leaves, slower), 0.0)
