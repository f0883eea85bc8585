"""The control law of a descent without a position: thrust from the specific force along body z.

The caller keeps the attitude level meanwhile: the behavior `land_blind`, or the watchdog of a
simulated vehicle. It constructs a `Descent` at the start, calls `step` with every IMU sample, sends
the thrust that it returns, and stops the rotors when it returns None.

The upward speed v is estimated, never measured: from the thrust and from the IMU's samples, each
as far as it can be trusted. With s the commanded thrust over the estimated hover thrust T0, after
the rotors' lag, l the specific force at s = 1, and f the measured one, less its error at rest:

    v' = l s - g,   l' = 0 +- WANDER,   f = l s +- r

a Kalman filter of two states (Simon, "Optimal State Estimation", sec. 5.1). l begins at g, and r^2,
the variance of a sample, is half the mean square of the difference of successive samples. Where
the IMU is quiet, v follows it at once, whatever is wrong with the thrust; where it is noisy, the
thrust's model holds the estimate. Its standard deviation d says how much noise explains, and the
reference falls faster by twice that, so that no noise makes the vehicle climb:

    w(t) = -(v1 + v2 t + v3 t^2 + 2 d),   v1 = 0.3, v2 = 0.06, v3 = 0.025
    a = k (w - v),  k = 3 1/s             within -2 and +2 m/s^2
    T = T0 (g + a) / l

A constant error b of f makes an error of b t in v, which the growth of w outruns down to -0.25
m/s^2. Against a larger one the thrust's model bounds the descent. By itself, with the least thrust
that may hover, (1 - `unsure`) T0, it has the vehicle rise at u:

    u' = (s (1 - unsure) / c - 1) g,    u <= w + u1 (t),    u1 = 1.0 m/s for 1.2 s, then less by
                                                            0.5 m/s each second down to 0

so what the IMU asks for beyond the model is granted briefly and then taken back. No accelerometer
is wrong by more than 2 m/s^2: a lift l that is lower by so much is believed, and c, the thrust that
it takes to hover over T0, is g / l; where l is lower by 1 m/s^2 at most, c is 1. Whatever the model
says, T <= 1.6 T0 for 1.5 s, which catches a vehicle whose rotors have become weak, then less by
0.2 T0 each second down to 1.12 T0, and after 7.5 s less by 0.06 T0 each second; when nothing is
left, after 26 s, the rotors stop.

An accelerometer that begins to measure too little looks like rotors that become weak: the
bound decides between them. Where T0 was learnt in flight and `unsure` is 0, b = -0.5 m/s^2 makes
the vehicle climb by 0.03 m and b = -1 by 0.54 m, while rotors that lose 5 or 10 % of their thrust
at that moment touch down with 0.95 or 1.35 m/s from 1 m, 1.6 or 2.1 m/s from 1.8 m. Where it is
0.1, such rotors touch down as gently as others, and those b climb by 12 and 51 m. Both errors at
once, b = -1 and a T0 that is wrong by 10 %, climb by 10 to 50 m in either case.

The vehicle has touched down when the floor carries it: f exceeds l s by 8 m/s^2 and six times the
noise (an impact, ignored in the first 0.2 s, when the rotors may still follow the command before);
or l s, which is f without its noise, is above 0.9 g for 0.1 s at a thrust that lifts no vehicle of
a third of its weight, to which the law falls on the floor.
"""

from __future__ import annotations

from math import sqrt

from kybflow.core.geometry import GRAVITY

SPEED, GROWTH, BEND, SURE = 0.3, 0.06, 0.025, 2.0
STIFFNESS, HARDEST = 3.0, 2.0
UNSURE_SPEED, UNSURE_LIFT, WANDER = 0.08, 0.1 * GRAVITY, 0.5
"""Standard deviations at the start, m/s and m/s^2; how much `l` may change, m/s^2 per root of a
second."""
CLIP, HARDEST_STOP = 3.0, 2.0
"""How much a sample may count: downward, in standard deviations; upward, where it may be the floor
that stops the vehicle, the speed that it takes away, m/s."""
LAG = 0.05
"""Assumed time constant of the rotors, seconds."""
FIRST_NOISE, LEAST_NOISE, NOISE_TIME = 1.0, 0.05, 0.1
"""The noise of a sample before it is known, and at least, m/s^2; seconds over which it is
averaged."""
BRIEFLY, LONGER = (1.6, 1.5, 0.2), (1.12, 7.5, 0.06)
"""Two bounds of the thrust over the hover thrust, of which the larger counts: the bound at first,
seconds for which it stays, and how much it falls each second then."""
TRUSTED = (1.0, 1.2, 0.5)
"""Upward speed beyond w(t) that the IMU alone may ask for, m/s: at first, seconds for which it
stays, and how much it falls each second then."""
WRONG = 1.0
"""How much too little an accelerometer may measure, m/s^2."""
LEAST = 0.25
ERROR = 0.12
"""Largest relative correction of the initial hover thrust in `Descent.hover`."""
IMPACT, CLEAR, DEAF = 8.0, 6.0, 0.2
IDLE, WEIGHT, RESTED = 0.33, 0.9 * GRAVITY, 0.1


class Descent:
    """hover: the estimated hover thrust, N. most: the rotors' largest thrust, N. climb: the initial
    upward speed, m/s. rest: the specific force along body z at rest, m/s^2. unsure: the part of
    its weight that `hover` may not carry."""

    __slots__ = (
        "_both", "_error", "_given", "_hover", "_last", "_lift", "_most", "_noise", "_pushed",
        "_rested", "_share", "_slow", "_speed", "_sure", "_time", "_unsure", "_weakness",
    )  # fmt: skip

    def __init__(
        self, hover: float, most: float, climb: float, rest: float = GRAVITY, unsure: float = 0.1
    ) -> None:
        self._hover, self._most = hover, most
        self._error = rest - GRAVITY
        self._speed, self._lift = climb, GRAVITY
        self._slow, self._both, self._unsure = UNSURE_SPEED**2, 0.0, UNSURE_LIFT**2
        self._noise = FIRST_NOISE**2
        self._last: float | None = None
        self._time = self._rested = 0.0
        self._share = self._given = self._weakness = 1.0
        self._pushed, self._sure = max(climb, 0.0), 1.0 - unsure

    @property
    def hover(self) -> float:
        """The corrected hover thrust, N."""
        return self._hover * max(min(GRAVITY / self._lift, 1.0 + ERROR), 1.0 - ERROR)

    def step(self, lift: float, dt: float) -> float | None:
        """Return the thrust to command (N), None after touch-down. lift: the mean specific force
        along body z (m/s^2) over the last `dt` seconds."""
        self._time += dt
        lift -= self._error
        self._given += (self._share - self._given) * dt / (LAG + dt)
        self._listen(lift, dt)
        excess = lift - self._lift * self._given
        struck = self._time > DEAF and excess > max(IMPACT, CLEAR * sqrt(self._noise))
        self._predict(dt)
        self._correct(min(excess, HARDEST_STOP / dt))
        if struck or self._is_carried(dt) or _bound(LONGER, self._time) <= 0.0:
            return None
        return min(self._hover * self._ask(), self._most)

    def _listen(self, lift: float, dt: float) -> None:
        """Update the noise of a sample."""
        last, self._last = self._last, lift
        if last is not None:
            change = min(abs(lift - last), IMPACT)
            self._noise += (0.5 * change * change - self._noise) * dt / (NOISE_TIME + dt)
            self._noise = max(self._noise, LEAST_NOISE**2)

    def _predict(self, dt: float) -> None:
        pushed = self._given * dt
        self._speed += self._lift * pushed - GRAVITY * dt
        self._pushed += GRAVITY * (pushed * self._sure / self._weakness - dt)
        self._slow += pushed * (2.0 * self._both + pushed * self._unsure)
        self._both += pushed * self._unsure
        self._unsure += WANDER * WANDER * dt

    def _correct(self, excess: float) -> None:
        """Correct the speed and the lift. excess: the measured force less the expected one."""
        share = self._given
        total = share * share * self._unsure + self._noise
        excess = max(excess, -CLIP * sqrt(total))
        gain_speed, gain_lift = share * self._both / total, share * self._unsure / total
        self._speed += gain_speed * excess
        self._lift = max(self._lift + gain_lift * excess, 1.0)
        self._slow -= gain_speed * share * self._both
        self._both -= gain_speed * share * self._unsure
        self._unsure -= gain_lift * share * self._unsure

    def _is_carried(self, dt: float) -> bool:
        """Return whether the floor has carried the vehicle for long enough."""
        carried = self._given < IDLE and self._lift * self._given > WEIGHT
        self._rested = self._rested + dt if carried else 0.0
        return self._rested >= RESTED

    def _ask(self) -> float:
        """Return the next thrust over the hover thrust."""
        time = self._time
        wanted = -(SPEED + time * (GROWTH + time * BEND) + SURE * sqrt(max(self._slow, 0.0)))
        pull = STIFFNESS * (wanted - self._speed)
        pull = -HARDEST if pull < -HARDEST else HARDEST if pull > HARDEST else pull
        self._weakness = weakness = _weakness(self._lift)
        highest = wanted + max(_bound(TRUSTED, time), 0.0)
        most = weakness / self._sure * (1.0 + STIFFNESS * (highest - self._pushed) / GRAVITY)
        most = min(most, max(_bound(BRIEFLY, time), _bound(LONGER, time)))
        self._share = share = max(min((GRAVITY + pull) / self._lift, most), LEAST)
        return share


def _bound(bound: tuple[float, float, float], time: float) -> float:
    most, full, fade = bound
    return most - fade * max(time - full, 0.0)


def _weakness(lift: float) -> float:
    """Return the hover thrust over the learnt one, corrected as far as an accelerometer can't be
    that wrong: not at all if it measures 1 m/s^2 too little, fully if it measures 2."""
    wrong = min(WRONG, max(2.0 * WRONG + lift - GRAVITY, 0.0))
    return max(GRAVITY / (lift + wrong), 1.0)
