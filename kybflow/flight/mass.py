"""Estimates a vehicle's mass from its thrust and vertical speed.

In the air, this is the adaptive estimator of TeleKyb's trackers, but with the true time step. With
T the thrust along world z and v the vertical speed, v' = T/m - g. With the low-pass filter F = a /
(s + a), y = a (v - F(v)) + g and w = F(T), this becomes y = w / m. With everything divided by the
airframe's weight, r, the estimate of the airframe's mass over the mass, follows the error e = y - w
r: r' = P w e, P' = lambda P - P^2 w^2, lambda = lambda0 (1 - P / kappa0).

On the ground, the floor carries part of the weight. There the assumed weight rises from 60 % of the
guess until the vehicle lifts off, and the weight at lift-off is the first estimate.
"""

from __future__ import annotations

from kybflow.core.geometry import GRAVITY

BANDWIDTH = 2.0
"""The filter's bandwidth a, rad/s. With TeleKyb's 0.2 the estimate takes half a minute to
converge."""
FORGETTING = 2.0
LARGEST_GAIN = 4.0
SMALLEST_GAIN = 0.01
LOWEST, HIGHEST = 0.5, 2.0
SPOOL_START = 0.6
SPOOL_RATE = 1.0
"""Rate at which the assumed weight rises on the ground, in airframe weights per second."""
WAVERING = 0.5
"""Seconds above the ground after which the vehicle certainly flies, even if its height falls again
later."""


class MassEstimator:
    """Estimates the ratio of the mass to the airframe's mass. It starts at `guess` and is limited
    to 50 % to 200 %. weight: the airframe's weight, N."""

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
        """The mass that the thrust should carry, divided by the airframe's: less than `ratio` until
        the vehicle first lifts off."""
        return 1.0 / self._inverse if self._inverse is not None else self._spool

    def spool_up(self, dt: float) -> None:
        """Raise the assumed mass on the ground while a climb is requested. If a noisy height was
        mistaken for flight, raise the first estimate instead."""
        if self._inverse is None:
            self._spool = min(HIGHEST, self._spool + SPOOL_RATE * dt)
        elif self._flown < WAVERING:
            self._inverse = 1.0 / min(HIGHEST, 1.0 / self._inverse + SPOOL_RATE * dt)

    def update(self, lift: float, speed: float, dt: float) -> None:
        """Update the estimate in the air. lift: the commanded thrust along world z, N. speed: the
        upward speed, m/s. dt: seconds since the last update."""
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
