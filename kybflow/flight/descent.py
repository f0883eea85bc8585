"""The control law of a descent without a position: thrust from the specific force along body z.

The caller controls the attitude: the watchdog of a simulated vehicle keeps it level, the behavior
`land_blind` first brakes the velocity that it knows (`BlindBrake`). It constructs a `Descent` at
the start, calls `step` with every IMU sample, sends the thrust that `step` returns, and stops the
rotors when it returns None.

The upward speed v is not measured but estimated from the thrust and the IMU samples, each as far as
it can be trusted. With s the commanded thrust over the estimated hover thrust T0, after the rotors'
lag, l the specific force at s = 1, and f the measured one, less its error at rest:

    v' = l s - g,   l' = 0 +- LIFT_WANDER,   f = l s +- r

This is a Kalman filter with the states v and l (Simon, "Optimal State Estimation", sec. 5.1). l
begins at g, and r^2, the variance of a sample, is half the mean square of the difference of
successive samples. If the IMU is quiet, v follows it at once, whatever is wrong with the thrust; if
it is noisy, the thrust's model dominates. d is the standard deviation of v. The reference falls
faster by 2 d, so that noise never makes the vehicle climb:

    w(t) = -(v1 + v2 t + v3 t^2 + 2 d),   v1 = 0.3, v2 = 0.06, v3 = 0.025
    a = k (w - v),  k = 3 1/s             within -2 and +2 m/s^2
    T = T0 (g + a) / l

A constant error b of f makes an error of b t in v. The growth of w outruns errors down to b = -0.25
m/s^2. Against larger ones the thrust's model bounds the thrust. u is the upward speed by the model
alone, for a vehicle that hovers with the least possible thrust, (1 - `unsure`) T0:

    u' = (s (1 - unsure) / c - 1) g,    u <= w + u1 (t),    u1 = 1.0 m/s for 1.2 s, then less by
                                                            0.5 m/s each second down to 0

so that the IMU may exceed the model only briefly. c is the true hover thrust over T0. No
accelerometer is assumed to be wrong by 2 m/s^2 or more: if l is lower than g by so much, c = g / l;
if l is lower by 1 m/s^2 at most, c = 1; in between, c changes continuously. Whatever the model
says, T <= 1.6 T0 for 1.5 s, which catches a vehicle whose rotors have become weak. The bound then
falls by 0.2 T0 each second to 1.12 T0, and after 7.5 s by 0.06 T0 each second; when it reaches
zero, after 26 s, the rotors stop.

An accelerometer that begins to measure too little looks like rotors that become weak; the bound
decides between them. If T0 was learnt in flight and `unsure` is 0, b = -0.5 m/s^2 makes the vehicle
climb by 0.03 m and b = -1 m/s^2 by 0.54 m, but a vehicle whose rotors suddenly lose 5 or 10 % of
their thrust touches down with 0.95 or 1.35 m/s from 1 m, and with 1.6 or 2.1 m/s from 1.8 m. If
`unsure` is 0.1, a vehicle with such rotors touches down as gently as others, but the same two
errors b make it climb by 12 and 51 m. Both faults at once, b = -1 m/s^2 and a T0 that is wrong by
10 %, make it climb by 10 to 50 m in either case.

The vehicle has touched down when the floor carries it. The law of the descent reduces the thrust on
the floor, slowly: f, which is l s without its noise, then exceeds 0.9 g for 0.1 s while the thrust
is below a third of the hover thrust. An impact, where f exceeds l s by 8 m/s^2 and six times the
noise, may be the floor or anything else, such as a wall or another vehicle, at any height. It adds
the velocity that the IMU measured, apart from noise, to v, and begins a probe: for 0.2 s the thrust
is reduced to a quarter of the hover thrust. On the floor f, averaged over 30 ms, stays above 0.8 g
while the thrust falls below 0.4 of the hover thrust; after 0.05 s of that the rotors stop. In the
air f follows the thrust; the vehicle loses at most 1.2 m/s, and the descent goes on. There is no
probe in the first 0.2 s, in which the rotors may still follow the previous command, nor within 0.1
s after another one.

If commands take effect `late`, s is the thrust that was commanded so long ago, and in the beginning
the measured specific force over l; a probe takes longer by as much.
"""

from __future__ import annotations

from collections import deque
from math import hypot, sqrt, tan

from kybflow.core.geometry import GRAVITY, Vec3
from kybflow.core.signals import InertialMotion
from kybflow.world.vehicle_context import Airframe

SPEED, GROWTH, BEND, CAUTION = 0.3, 0.06, 0.025, 2.0
STIFFNESS, MAX_PULL = 3.0, 2.0
SPEED_SPREAD, LIFT_SPREAD, LIFT_WANDER = 0.08, 0.1 * GRAVITY, 0.5
"""Initial standard deviations of the speed, m/s, and of the lift `l`, m/s^2; how much `l` may
change, m/s^2 per root of a second."""
DOWNWARD_LIMIT, UPWARD_LIMIT = 3.0, 2.0
"""Limits of the effect of one sample: downward, in standard deviations; of an impact, in m/s of
speed."""
ROTOR_LAG_S = 0.05
"""Assumed time constant of the rotors, seconds."""
FIRST_NOISE, LEAST_NOISE, NOISE_TIME = 1.0, 0.05, 0.1
"""Noise of a sample before it is measured, and its least value, m/s^2; seconds over which it is
averaged."""
BRIEF_BOUND, LASTING_BOUND = (1.6, 1.5, 0.2), (1.12, 7.5, 0.06)
"""Two bounds of the thrust over the hover thrust, of which the larger one applies: the initial
bound, the seconds for which it holds, and its decrease per second after that."""
TRUSTED_CLIMB = (1.0, 1.2, 0.5)
"""Upward speed beyond w(t) that the IMU alone may cause, m/s: the initial value, the seconds for
which it holds, and its decrease per second after that."""
MAX_BIAS = 1.0
"""How much too low the readings of an accelerometer may be, m/s^2."""
MIN_THRUST = 0.25
MAX_ERROR = 0.12
"""Largest relative correction of the initial hover thrust in `Descent.hover`."""
IMPACT_FORCE, SIGMAS, DEAF_S = 8.0, 6.0, 0.2
RESTING_THRUST, RESTING_FORCE, RESTING_TIME_S = 0.33, 0.9 * GRAVITY, 0.1
PROBE_TIME_S, PROBE_PAUSE_S = 0.2, 0.1
"""Duration of a probe, and the least time between two of them, seconds."""
PROBED_THRUST, PROBED_FORCE, PROBE_AVERAGING_S, PROBED_TIME_S = 0.4, 0.8 * GRAVITY, 0.03, 0.05
"""In a probe: the thrust over the hover thrust below which the mean specific force shows the floor,
its least value there, m/s^2, the time over which it is averaged, and for which it must last,
seconds."""
STOPPED_SPEED = 0.03
"""Speed at which a brake ends, m/s."""


class Descent:
    """The control law of one descent. hover: the estimated hover thrust, N. most: the largest
    thrust of the rotors, N. climb: the initial upward speed, m/s. rest: the specific force along
    body z at rest, m/s^2. unsure: the share of the weight that `hover` may fail to carry. late: by
    how much later than usual commands take effect, s."""

    __slots__ = (
        "_acting", "_both", "_error", "_given", "_held", "_hover", "_last", "_late", "_lift",
        "_mean", "_most", "_noise", "_probe", "_pushed", "_rested", "_sent", "_share", "_slow",
        "_speed", "_sure", "_time", "_unsure", "_weakness",
    )  # fmt: skip

    def __init__(
        self,
        hover: float,
        most: float,
        climb: float,
        rest: float = GRAVITY,
        unsure: float = 0.1,
        late: float = 0.0,
    ) -> None:
        self._hover, self._most = hover, most
        self._late, self._acting = late, 1.0
        self._sent: deque[tuple[float, float]] = deque()
        self._error = rest - GRAVITY
        self._speed, self._lift = climb, GRAVITY
        self._slow, self._both, self._unsure = SPEED_SPREAD**2, 0.0, LIFT_SPREAD**2
        self._noise = FIRST_NOISE**2
        self._last: float | None = None
        self._time = self._rested = 0.0
        self._share = self._given = self._weakness = 1.0
        self._pushed, self._sure = max(climb, 0.0), 1.0 - unsure
        self._mean, self._held, self._probe = GRAVITY, 0.0, -PROBE_TIME_S - PROBE_PAUSE_S

    @property
    def was_struck(self) -> bool:
        """Whether there has been an impact."""
        return self._probe >= 0.0

    @property
    def hover(self) -> float:
        """The corrected estimate of the hover thrust, N."""
        return self._hover * max(min(GRAVITY / self._lift, 1.0 + MAX_ERROR), 1.0 - MAX_ERROR)

    def step(self, lift: float, dt: float) -> float | None:
        """Return the thrust to command (N), or None after touch-down. lift: the mean specific force
        along body z (m/s^2) over the last `dt` seconds."""
        self._time += dt
        lift -= self._error
        if not self._late:
            self._acting = self._share
        while self._sent and self._sent[0][0] <= self._time:
            self._acting = self._sent.popleft()[1]
        if self._time <= self._late:
            self._given = lift / self._lift
        else:
            self._given += (self._acting - self._given) * dt / (ROTOR_LAG_S + dt)
        self._listen(lift, dt)
        excess = lift - self._lift * self._given
        struck = excess > max(IMPACT_FORCE, SIGMAS * sqrt(self._noise))
        probes = self._probes(struck, lift, dt)
        self._predict(dt)
        if struck:
            self._speed += min(excess * dt, UPWARD_LIMIT)
        else:
            self._correct(excess)
        carried = self._given < RESTING_THRUST and self._lift * self._given > RESTING_FORCE
        self._rested = self._rested + dt if carried else 0.0
        if (
            self._held >= PROBED_TIME_S
            or self._rested >= RESTING_TIME_S
            or _bound(LASTING_BOUND, self._time) <= 0.0
        ):
            return None
        share = self._ask()
        if probes:
            share = self._share = MIN_THRUST
        if self._late:
            self._sent.append((self._time + self._late, share))
        return min(self._hover * share, self._most)

    def _probes(self, struck: bool, lift: float, dt: float) -> bool:
        """Return whether the thrust is reduced to find out whether the floor carries the
        vehicle."""
        self._mean += (min(lift, 1.5 * GRAVITY) - self._mean) * dt / (PROBE_AVERAGING_S + dt)
        since, lasts = self._time - self._probe, PROBE_TIME_S + self._late
        if struck and self._time > DEAF_S + self._late and since > lasts + PROBE_PAUSE_S:
            self._probe, since = self._time, 0.0
        probes = since < lasts or self._held > 0.0
        found = probes and self._given < PROBED_THRUST and self._mean > PROBED_FORCE
        self._held = self._held + dt if found else 0.0
        return probes

    def _listen(self, lift: float, dt: float) -> None:
        """Update the noise of the IMU samples."""
        last, self._last = self._last, lift
        if last is not None:
            change = min(abs(lift - last), IMPACT_FORCE)
            self._noise += (0.5 * change * change - self._noise) * dt / (NOISE_TIME + dt)
            self._noise = max(self._noise, LEAST_NOISE**2)

    def _predict(self, dt: float) -> None:
        pushed = self._given * dt
        self._speed += self._lift * pushed - GRAVITY * dt
        self._pushed += GRAVITY * (pushed * self._sure / self._weakness - dt)
        self._slow += pushed * (2.0 * self._both + pushed * self._unsure)
        self._both += pushed * self._unsure
        self._unsure += LIFT_WANDER * LIFT_WANDER * dt

    def _correct(self, excess: float) -> None:
        """Correct the speed and the lift. excess: the measured specific force less the expected
        one, m/s^2."""
        share = self._given
        total = share * share * self._unsure + self._noise
        excess = max(excess, -DOWNWARD_LIMIT * sqrt(total))
        gain_speed, gain_lift = share * self._both / total, share * self._unsure / total
        self._speed += gain_speed * excess
        self._lift = max(self._lift + gain_lift * excess, 1.0)
        self._slow -= gain_speed * share * self._both
        self._both -= gain_speed * share * self._unsure
        self._unsure -= gain_lift * share * self._unsure

    def _ask(self) -> float:
        """Return the next thrust divided by the hover thrust."""
        time = self._time
        wanted = -(SPEED + time * (GROWTH + time * BEND) + CAUTION * sqrt(max(self._slow, 0.0)))
        pull = STIFFNESS * (wanted - self._speed)
        pull = -MAX_PULL if pull < -MAX_PULL else MAX_PULL if pull > MAX_PULL else pull
        self._weakness = weakness = _weakness(self._lift)
        highest = wanted + max(_bound(TRUSTED_CLIMB, time), 0.0)
        most = weakness / self._sure * (1.0 + STIFFNESS * (highest - self._pushed) / GRAVITY)
        most = min(most, max(_bound(BRIEF_BOUND, time), _bound(LASTING_BOUND, time)))
        self._share = share = max(min((GRAVITY + pull) / self._lift, most), MIN_THRUST)
        return share


class BlindBrake:
    """Brings the horizontal velocity of a vehicle without a position to rest, by a model of it.

    u, the velocity, follows from the commanded acceleration c, after the lag of the attitude loop,
    and the rotor drag d:

        a' = (c - a) / lag,   u' = a - d u,   c = -k u,  k = 3 1/s

    c is limited to what the airframe's largest tilt gives. The vehicle is commanded level once u is
    below 3 cm/s. Where u and a are measured, they replace the model's (`measure`).

    velocity, acceleration: those of the vehicle at the start along x and y, world, m/s and m/s^2; a
    velocity above the airframe's largest speed is reduced to it. late: by how much later than usual
    commands take effect, s.
    """

    __slots__ = ("_airframe", "_is_over", "_lag", "_lean", "_velocity")

    def __init__(
        self,
        velocity: tuple[float, float],
        acceleration: tuple[float, float],
        airframe: Airframe,
        late: float = 0.0,
    ) -> None:
        loop = airframe.attitude_loop
        self._airframe, self._lag = airframe, late + loop.derivative / loop.proportional
        self._velocity = x, y = self._believed(*velocity)
        self._lean = (acceleration[0] + airframe.drag * x, acceleration[1] + airframe.drag * y)
        self._is_over = False

    def measure(self, motion: InertialMotion) -> None:
        """Replace velocity and acceleration by measured ones, in the axes of those at the start. An
        acceleration beyond the largest tilt, such as that of a blow, is reduced to it. The brake
        doesn't end while this is called before each step."""
        x, y, _ = motion.velocity
        ax, ay, _ = motion.acceleration
        drag = self._airframe.drag
        ax, ay = ax + drag * x, ay + drag * y
        most = min(1.0, GRAVITY * tan(self._airframe.tilt) / max(hypot(ax, ay), STOPPED_SPEED))
        self._velocity, self._lean = self._believed(x, y), (most * ax, most * ay)
        self._is_over = False

    @property
    def lean(self) -> float:
        """The cosine of the tilt that the vehicle has by the model."""
        return GRAVITY / hypot(*self._lean, GRAVITY)

    def step(self, dt: float) -> Vec3 | None:
        """Return the direction of the thrust to command, world frame, or None once the vehicle is
        at rest. dt: seconds since the last call."""
        x, y = self._velocity
        speed = hypot(x, y)
        self._is_over = self._is_over or speed < STOPPED_SPEED
        pull = 0.0
        if not self._is_over:
            pull = -min(STIFFNESS, GRAVITY * tan(self._airframe.tilt) / speed)
        cx, cy, share, drag = pull * x, pull * y, dt / (self._lag + dt), self._airframe.drag * dt
        ax, ay = self._lean
        self._lean = ax, ay = (ax + share * (cx - ax), ay + share * (cy - ay))
        self._velocity = (x + ax * dt - drag * x, y + ay * dt - drag * y)
        return None if self._is_over else (cx, cy, GRAVITY)

    def _believed(self, x: float, y: float) -> tuple[float, float]:
        most = min(1.0, self._airframe.speed / max(hypot(x, y), STOPPED_SPEED))
        return most * x, most * y


def _bound(bound: tuple[float, float, float], time: float) -> float:
    most, full, fade = bound
    return most - fade * max(time - full, 0.0)


def _weakness(lift: float) -> float:
    """Return the true hover thrust divided by the learnt one. A low lift may be an error of the
    accelerometer: up to 1 m/s^2 below gravity it is not believed, from 2 m/s^2 on fully."""
    wrong = min(MAX_BIAS, max(2.0 * MAX_BIAS + lift - GRAVITY, 0.0))
    return max(GRAVITY / (lift + wrong), 1.0)
