"""The frequency response of the position loop that the law of `geometric` closes.

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
measured force with the one commanded of the rotors (`kybflow.flight.disturbance`). The mass
estimate is left out because it is far slower.
"""

from __future__ import annotations

from cmath import exp
from collections.abc import Sequence
from math import exp as real_exp
from math import sqrt, tau
from typing import NamedTuple

from kybflow.core.matrices import eigenvalues2, eigenvalues3
from kybflow.flight.disturbance import WASHOUT
from kybflow.flight.loops.margins import Response
from kybflow.flight.tracked_pose import TrackedParams
from kybflow.world.vehicle_context import InnerLoop

FILTERS = TrackedParams()


class Stiffness(NamedTuple):
    """The position gains of a law with a gain matrix, rising: along two horizontal directions
    (`level`) and upwards (`up`). is_coupled: the matrix couples the height with x and y; each of
    its three gains is then used for every direction, which is right as far as all directions
    respond alike."""

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
    """Return the response of the on-board loop, which must be stable before the others mean
    anything."""
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
        seen = bandwidth / (s + bandwidth) * WASHOUT * s / (1.0 + WASHOUT * s)
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
