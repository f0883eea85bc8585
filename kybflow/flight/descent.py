"""The control law of a descent without a position: thrust from the specific force along body z.

The caller keeps the attitude level meanwhile: the behavior `land_blind`, or the watchdog of a
simulated vehicle. It constructs a `Descent` at the start, calls `step` with every IMU sample, sends
the thrust that it returns, and stops the rotors when it returns None.

With f the specific force along body z, f0 that measured at rest on the ground (g if unknown), and v
the upward speed:

    v' = u,  u = f - f0                          from the initial speed
    w(t) = -(v1 + v2 t + v3 t^2)                 reference, v1 = 0.45, v2 = 0.06, v3 = 0.025
    a = k (w - v),  k = 3 1/s                    within -2 and +2 m/s^2
    r' = 6 (a - u) / g,  T = T0 r (1 + a / g)    r = 1 at the start

T0 is the estimated hover thrust; r corrects its error, because f shows the true thrust. A constant
error b of f - f0 makes an error of b t in v, which the growth of w outruns: the vehicle never
climbs for b up to 0.25 m/s^2. For a larger error, or nonsense in f, a bound on the thrust brings it
down: r (1 + a / g) <= 1.25 for 6 s, then less by 0.05 each second. The lower bound is 0.6, so that
no reading stops the rotors in the air.

The vehicle has touched down when the floor carries it: f exceeds what the rotors give by 8 m/s^2
(an impact, ignored in the first 0.2 s, when the rotors may still follow the command before), or is
above 0.9 g for 0.1 s while the thrust is below 70 % of T0, to which r falls on the floor.
"""

from __future__ import annotations

from kybflow.core.geometry import GRAVITY

SPEED, GROWTH, BEND = 0.45, 0.06, 0.025
STIFFNESS, HARDEST = 3.0, 2.0
LEARNING = 6.0
MOST, FULL, FADE = 1.25, 6.0, 0.05
LEAST = 0.6
ERROR = 0.12
"""Largest relative correction of the initial hover thrust in `Descent.hover`."""
IMPACT, DEAF = 8.0, 0.2
IDLE, WEIGHT, RESTED = 0.7, 0.9 * GRAVITY, 0.1


class Descent:
    """hover: the estimated hover thrust, N. most: the rotors' largest thrust, N. climb: the initial
    upward speed, m/s. rest: the specific force along body z at rest, m/s^2."""

    __slots__ = ("_climb", "_error", "_hover", "_most", "_ratio", "_rested", "_share", "_time")

    def __init__(self, hover: float, most: float, climb: float, rest: float = GRAVITY) -> None:
        self._hover, self._most = hover, most
        self._error = rest - GRAVITY
        self._climb = climb
        self._time = self._rested = 0.0
        self._ratio = self._share = 1.0

    @property
    def hover(self) -> float:
        """The corrected hover thrust, N."""
        return self._hover * max(min(self._ratio, 1.0 + ERROR), 1.0 - ERROR)

    def step(self, lift: float, dt: float) -> float | None:
        """Return the thrust to command (N), None after touch-down. lift: the mean specific force
        along body z (m/s^2) over the last `dt` seconds."""
        self._time += dt
        lift -= self._error
        if self._landed(lift, dt):
            return None
        change = lift - GRAVITY
        self._climb += change * dt
        time = self._time
        wanted = -(SPEED + time * (GROWTH + time * BEND))
        pull = STIFFNESS * (wanted - self._climb)
        pull = -HARDEST if pull < -HARDEST else HARDEST if pull > HARDEST else pull
        most = MOST - FADE * max(time - FULL, 0.0)
        factor = 1.0 + pull / GRAVITY
        ratio = self._ratio + LEARNING * dt * (pull - change) / GRAVITY
        self._ratio = ratio = max(min(ratio, most / factor), LEAST / factor)
        self._share = ratio * factor
        return min(self._hover * self._share, self._most)

    def _landed(self, lift: float, dt: float) -> bool:
        share = self._share
        if share < IDLE and lift > WEIGHT:
            self._rested += dt
        else:
            self._rested = 0.0
        struck = self._time > DEAF and lift - GRAVITY * share > IMPACT
        return struck or self._rested >= RESTED
