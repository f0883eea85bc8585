"""Estimates a vehicle's mass from its thrust and vertical speed.

In the air: the adaptive estimator of TeleKyb's trackers, with the true time step. With T the thrust
along world z and v the vertical speed, v' = T/m - g. Filtered by F = a / (s + a):
y = a (v - F(v)) + g, w = F(T), y = w / m. With everything divided by the airframe's weight, the
estimate r of airframe mass over mass follows the error e = y - w r: r' = P w e,
P' = lambda P - P^2 w^2, lambda = lambda0 (1 - P / kappa0).

On the ground the floor carries part of the weight: there the assumed weight rises from 60 % of the
guess until the vehicle lifts, and the weight at lift-off is the first estimate.
"""

from __future__ import annotations

from kybflow.core.geometry import GRAVITY

BANDWIDTH = 2.0
"""a, rad/s; with TeleKyb's 0.2 the estimate takes half a minute to converge."""
FORGETTING = 2.0
LARGEST_GAIN = 4.0
SMALLEST_GAIN = 0.01
LOWEST, HIGHEST = 0.5, 2.0
SPOOL_START = 0.6
SPOOL_RATE = 1.0
"""Airframe weights per second."""
WAVERING = 0.5
"""Seconds above the ground after which the vehicle surely flies, however low it comes later."""


class MassEstimator:
    """Estimates the ratio of the mass to the airframe's mass, starting at `guess` and limited to
    50 % to 200 %. weight: the airframe's, N."""

    def __init__(self, weight: float, guess: float) -> None:
        self._per_weight = 1.0 / weight
        self._guess = guess
        self._spool = SPOOL_START * guess
        self._inverse: float | None = None
        self._flown = 0.0
        self._gain = LARGEST_GAIN / 2.0
        self._lift = 1.0
        self._speed = 0.0

    @property
    def ratio(self) -> float:
        """The estimated mass divided by the airframe's."""
        return 1.0 / self._inverse if self._inverse is not None else self._guess

    @property
    def carried(self) -> float:
        """The mass for the thrust to carry, divided by the airframe's: less than `ratio` until the
        vehicle first lifts."""
        return 1.0 / self._inverse if self._inverse is not None else self._spool

    def spool_up(self, dt: float) -> None:
        """Raise the assumed mass on the ground while a climb is requested. If a noisy height was
        mistaken for flight, raise the first estimate instead."""
        if self._inverse is None:
            self._spool = min(HIGHEST, self._spool + SPOOL_RATE * dt)
        elif self._flown < WAVERING:
            self._inverse = 1.0 / min(HIGHEST, 1.0 / self._inverse + SPOOL_RATE * dt)

    def update(self, lift: float, speed: float, dt: float) -> None:
        """Update the estimate in the air. lift: commanded along world z, N. speed: upward, m/s. dt:
        since the last update, s."""
        lift *= self._per_weight
        self._flown += dt
        if self._inverse is None:
            self._inverse = min(1.0 / LOWEST, max(1.0 / HIGHEST, 1.0 / self._spool))
            self._lift, self._speed = lift, speed
            return
        share = BANDWIDTH * dt / (1.0 + BANDWIDTH * dt)
        self._lift += share * (lift - self._lift)
        change = speed - self._speed
        self._speed += share * change
        w, gain = self._lift, self._gain
        error = 1.0 + BANDWIDTH * change / GRAVITY - w * self._inverse
        inverse = self._inverse + dt * gain * w * error
        self._inverse = min(1.0 / LOWEST, max(1.0 / HIGHEST, inverse))
        rate = FORGETTING * (1.0 - gain / LARGEST_GAIN) * gain - gain * gain * w * w
        self._gain = min(LARGEST_GAIN, max(SMALLEST_GAIN, gain + dt * rate))
