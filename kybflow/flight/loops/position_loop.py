"""The position loop that the law of `geometric` closes: its frequency response, and the design of
its gains.

Near hover, the acceleration is g times the tilt. Horizontally, the plant is a double integrator
with rotor drag c, driven by the on-board attitude loop (`AttitudeLoop`). Its rotors respond as
1 / (T s + 1) after a dead time, together A, and its gyroscope has a filter F. With the tilt x and
the command u,

    x s^2 = A (u - (P + I / s) x - D F s x),    u = (P + I / s) attitude + D rates.

The loop is cut at u: an attitude and its rates are commanded together, so that a delay of commands
is a delay of u. Vertically, the plant is a double integrator driven by the rotors alone.

Poses are delayed, pass the alpha-beta filter of `kybflow.flight.tracked_pose`, written in z = e^(s
period), and are predicted to the present, as those of `mocap` are. A vehicle that follows climb
rates responds as 1 / (T s + 1); its vertical plant is this lag and an integrator. A command is held
for one control period. The observer has no effect horizontally; vertically, it compares the
measured force with the one commanded of the rotors (`kybflow.flight.force_estimates`). The mass
estimate is left out because it is far slower.

The poles of a double integrator under acceleration = -P e - D e' are placed like those of a
second-order system, by one frequency w:

    P = w^2,    D = 2 damping w,    I = P / 2 s,    damping 1.125,

The highest frequency is 4 rad/s, with gains of 16, 9 and 8: in a faster loop, the noise of motion
capture shakes the vehicle. The integral time is the same at every w, so that lasting disturbances
are compensated soon in a slow loop too. For a slower inner loop, w is the highest frequency, in
steps of 0.1 rad/s, at which the margins of the full frequency response are at least `PLANNED`: 3
dB, 33 degrees and 20 ms. With these margins, the loop doesn't oscillate even if the gains of the
on-board loop are a third lower than assumed. Textbooks demand 6 dB and 30 degrees (Skogestad and
Postlethwaite, Multivariable Feedback Control, sec. 2.4.3), for models that know less about the
delays; here the delay margin is within 20 % of the one in the simulator. Gains that a mission sets
are compared with the textbook margins, `ASKED`, but the gain margin need not exceed that of the
designed gains on the same loop, 3.6 dB on the slowest one in the library. Gains that leave less
than `LEAST` are refused, because no model is exact.
"""

from __future__ import annotations

from bisect import bisect_left
from cmath import exp
from collections.abc import Sequence
from functools import lru_cache, reduce
from math import exp as real_exp
from math import radians, sqrt, tau
from typing import NamedTuple

from kybflow.core.matrices import eigenvalues2, eigenvalues3
from kybflow.core.params import param, params
from kybflow.core.units import Number
from kybflow.flight.force_estimates import WASHOUT_TIME_S
from kybflow.flight.loops.margins import UNSTABLE, Margins, Response, margins
from kybflow.flight.tracked_pose import TrackedParams
from kybflow.world.vehicle_context import InnerLoop

FILTERS = TrackedParams()


class Stiffness(NamedTuple):
    """The position gains of a gain matrix, in ascending order: along two horizontal directions
    (`level`) and upwards (`up`). is_coupled: the matrix couples the height with x and y; all three
    gains are then used for every direction, which is exact if all directions respond alike."""

    level: tuple[float, ...]
    up: tuple[float, ...]
    is_coupled: bool = False


def stiffness(matrix: Sequence[Sequence[float]]) -> Stiffness:
    """Return the gains of a symmetric matrix along its principal directions."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = matrix
    if xz == yz == 0.0:
        return Stiffness(eigenvalues2(((xx, xy), (xy, yy))), (zz,))
    own = eigenvalues3(matrix)
    return Stiffness(own, own, is_coupled=True)


class OuterLoop(NamedTuple):
    """A tracker's control law.

    proportional, derivative, integral: acceleration per error of position and velocity, and per
    integral of the position error. trim: the rate at which the error of the on-board attitude is
    estimated, 1/s. drag: rotor drag, 1/s. period: the control period, s. observer: its bandwidth,
    Hz; 0 for none. attitude: body rates per attitude error, 1/s, if the tracker closes the attitude
    loop itself. turning: the share of the change of its feedback that it commands as rates. climb:
    climb rate per height error, 1/s, if the tracker commands climb rates instead of thrust.
    stiffness: replaces `proportional` in a law with a gain matrix.
    """

    proportional: float
    derivative: float
    integral: float
    trim: float
    drag: float
    period: float
    observer: float = 0.0
    attitude: float | None = None
    turning: float = 1.0
    climb: float | None = None
    stiffness: Stiffness | None = None

    def with_gains(self, proportional: float, derivative: float, integral: float) -> OuterLoop:
        """Return this law with these gains in every direction."""
        k, d, i = proportional, derivative, integral
        return self._replace(proportional=k, derivative=d, integral=i, stiffness=None)


def on_board(outer: OuterLoop, inner: InnerLoop) -> Response:
    """Return the response of the on-board loop, which must be stable for the other responses to be
    meaningful."""
    loop, lag, cut_off, dead_time, *_ = inner
    p, rate, integral = loop.proportional, loop.derivative, loop.integral
    if outer.attitude is not None:
        p = integral = 0.0
    lag, smooth = lag / loop.lead, _smoothing(cut_off)

    def response(s: complex) -> complex:
        rotors = exp(-s * dead_time) / (1.0 + s * lag)
        return rotors * (p + integral / s + rate * s / (1.0 + s * smooth) ** 2) / (s * s)

    return response


def horizontal(outer: OuterLoop, inner: InnerLoop) -> Response:
    """Return the response of the loop along x or y, with the gain `proportional`."""
    k, d, i, trim, drag, period, _, own, turning, *_ = outer
    loop, rotor_time, cut_off, dead_time, late, age, pose_period, *_ = inner
    p, rate, integral = loop.proportional, loop.derivative, loop.integral
    if own is not None:
        p = integral = 0.0
    lag, age = rotor_time / loop.lead, age + 0.5 * pose_period
    smooth = _smoothing(cut_off)
    late += 0.5 * period

    def response(s: complex) -> complex:
        rotors, filtered = exp(-s * dead_time) / (1.0 + s * lag), 1.0 / (1.0 + s * smooth) ** 2
        held = p + integral / s
        x = rotors / (s * s + rotors * (held + rate * filtered * s))
        v = x / (s + drag)
        z, old = exp(s * pose_period), exp(-s * age)
        tilt, turn = _tracked(z, pose_period, FILTERS.rate_bandwidth, x, 0.0)
        pull = tilt - drag * v
        place, speed = _tracked(z, pose_period, FILTERS.velocity_bandwidth, v / s, pull)
        place = old * (place + age * (speed + 0.5 * age * pull))
        speed, tilt = old * (speed + age * pull), old * (tilt + age * turn)
        force = -d * speed - (k + i / s) * place
        attitude = force + trim / s * (force - tilt)
        rates = -turning * (k * speed + d * (tilt - drag * speed))
        asked = held * attitude if own is None else rate * own * (attitude - tilt)
        return -(asked + rate * rates) * exp(-s * late)

    return response


def vertical(outer: OuterLoop, inner: InnerLoop) -> Response:
    """Return the response of the loop along z, with the gain `proportional`."""
    k, d, _, _, _, period, observer, _, _, climb, _ = outer
    loop, rotor_time, _, dead_time, late, age, pose_period, _, climb_time = inner
    age, bandwidth, lag = age + 0.5 * pose_period, tau * observer, rotor_time / loop.lead
    late += dead_time + 0.5 * period

    def response(s: complex) -> complex:
        rotors, old = exp(-s * late) / (1.0 + s * lag), exp(-s * age)
        z = exp(s * pose_period)
        if climb is not None:
            height = 1.0 / (s * (1.0 + s * climb_time))
            place, speed = _tracked(z, pose_period, FILTERS.velocity_bandwidth, height, 0.0)
            return climb * exp(-s * late) * old * (place + age * speed)
        place, speed = _tracked(z, pose_period, FILTERS.velocity_bandwidth, 1.0 / (s * s), 0.0)
        seen = bandwidth / (s + bandwidth) * WASHOUT_TIME_S * s / (1.0 + WASHOUT_TIME_S * s)
        law = old * (d * speed + k * (place + age * speed))
        return rotors * (law + seen) / (1.0 - seen / (1.0 + s * rotor_time))

    return response


def _smoothing(cut_off: float) -> float:
    """Return the time constant (s) of each of the two stages that model a gyroscope's filter."""
    return sqrt(sqrt(2.0) - 1.0) / (tau * cut_off) if cut_off else 0.0


def _tracked(
    z: complex, dt: float, bandwidth: float, measured: complex, pull: complex
) -> tuple[complex, complex]:
    """Return the value and the rate from the alpha-beta filter. pull: the acceleration that the
    filter knows in addition."""
    theta = real_exp(-tau * bandwidth * dt)
    keep, beta = theta * theta, (1.0 - theta) ** 2 / dt
    drift, gain = 0.5 * dt * dt / z * pull, dt / z * pull
    first = keep * drift + (1.0 - keep) * measured
    second = gain + beta * (measured - drift)
    a, b, c, e = 1.0 - keep / z, -keep * dt / z, beta / z, 1.0 - (1.0 - beta * dt) / z
    whole = a * e - b * c
    return (first * e - b * second) / whole, (a * second - c * first) / whole


Gains = tuple[float, float, float]
"""Proportional, derivative and integral gain: P, D and I."""


@params
class DesignedGains:
    proportional: Number | None = param(
        "Acceleration per metre of position error; by default as high as the on-board"
        " loop allows, at most 16.",
        default=None, above=0,
    )  # fmt: skip
    derivative: Number | None = param(
        "Acceleration per m/s of velocity error; by default likewise, at most 9.",
        default=None, above=0,
    )  # fmt: skip
    integral: Number | None = param(
        "Acceleration per metre and second of position error; by default likewise, at most 8.",
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
_ROUNDED_SHARE = 0.97
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


def delay_margin(outer: OuterLoop | None, inner: InnerLoop | None) -> float | None:
    """Return the delay margin (s) of a tracker's loop; None if one of the loops is unknown."""
    return None if outer is None or inner is None else margins_of(outer, inner).delay


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
    return ASKED._replace(gain=max(PLANNED.gain, min(ASKED.gain, _ROUNDED_SHARE * best.gain)))


def quickest_observer(outer: OuterLoop, inner: InnerLoop, bound: Margins = PLANNED) -> float:
    """Return the highest observer bandwidth, Hz, below the current one at which these gains leave
    `bound`; 0 if there is none."""

    def leaves(bandwidth: float) -> bool:
        return holds(margins_of(outer._replace(observer=bandwidth), inner), bound)

    slower = (b for b in reversed(BANDWIDTHS) if b < outer.observer)
    return next(filter(leaves, slower), 0.0)
