"""Estimates the forces that a tracker must compensate: the disturbance of a vehicle, such as wind,
and the weight that it carries.
"""

from __future__ import annotations

from math import tau

from kybflow.core.geometry import GRAVITY, ZERO, Vec3, rotate, rotate_back
from kybflow.core.signals import IMU_TIMEOUT, Estimate, Imu
from kybflow.world.vehicle_context import Airframe

WASHOUT_TIME_S = 3.0
"""Seconds in which a steady upward disturbance moves to the mass estimate. Along x and y it stays
in this estimate, together with the accelerometer's bias, which the law's integral compensates."""
SETTLING_TIME_S = 1.5
"""Seconds of flight in which the mass estimate settles. Until then the measured disturbance is
mostly the error of the mass: if it were learned as lasting, subtracting it for `WASHOUT_TIME_S`
would let the vehicle sink."""
SHAKING_RATE = 1.0
"""Turn rate of body z, rad/s, at which half of the bandwidth is left. While body z turns fast, the
measured force comes from the vehicle's own swinging, delayed, and compensating for it would sustain
the swinging."""
MAX_PUSH = 2.0
"""The largest estimate along each axis, m/s^2, as from a wind of 8 m/s on an airframe with drag
0.25."""


class DisturbanceObserver:
    """Estimates the disturbance of a vehicle, such as wind, from its accelerometer.

    An accelerometer measures all forces except gravity. The rotors' thrust acts along body z,
    and their drag in the rotor plane (`kybflow.drivers.sim.steps.rotors` has the same model);
    the rest is the disturbance d:

        d = R (f + c (v - (v . z) z)) - F z,      F' = (u - F) / T
        e' = w (d - l e3 - e) / (1 + (r / S)^2),  l' = (d . e3 - l) / L

    f: specific force, body. R: attitude, z = R e3. c: the airframe's drag. u: the commanded
    specific force along z; F: the force that results from rotors with the time constant T. e: the
    estimate, which averages noise over 1 / w. l: the upward disturbance that lasts for L,
    `WASHOUT_TIME_S`; it stays zero for the first `SETTLING_TIME_S`. r: the rate at which body z
    turns; S: `SHAKING_RATE`. Neither the thrust nor the mass acts along body x and y, so the
    estimate there doesn't depend on the command and can't make the loop unstable.

    The observer is that of Smeur, Chu and de Croon (Adaptive Incremental Nonlinear Dynamic
    Inversion, JGCD 2016, sec. III; outer loop: Cascaded incremental nonlinear dynamic inversion
    for MAV disturbance rejection, Control Engineering Practice 2018, eq. 18), written as an
    estimate that the law subtracts and that can be bounded.

    acceleration: the estimate, m/s^2, world; zero
    while the vehicle is on the ground, and without an IMU.
    """

    __slots__ = ("_drag", "_flown", "_given", "_lasting", "_rotor_time", "acceleration")

    def __init__(self, airframe: Airframe) -> None:
        self._drag, self._rotor_time = airframe.drag, airframe.rotor_time
        self._given = GRAVITY
        self._flown = self._lasting = 0.0
        self.acceleration = ZERO

    def update(
        self, imu: Imu | None, estimate: Estimate, given: float, bandwidth: float, dt: float
    ) -> Vec3:
        """Process the specific force of the last `dt` seconds, and return the new estimate. given:
        the specific force of the last command along body z, m/s^2. bandwidth: Hz."""
        felt, now = self._given, estimate.time
        self._given = felt + dt / (self._rotor_time + dt) * (given - felt)
        if imu is None or now - imu.time > IMU_TIMEOUT:
            self.acceleration = ZERO
            return ZERO
        drag, attitude = self._drag, estimate.attitude
        fx, fy, fz = imu.specific_force
        vx, vy, _ = rotate_back(attitude, estimate.velocity)
        dx, dy, dz = rotate(attitude, (fx + drag * vx, fy + drag * vy, fz - self._given))
        ex, ey, ez = self.acceleration
        rx, ry, _ = estimate.angular_velocity
        calm = 1.0 + (rx * rx + ry * ry) / (SHAKING_RATE * SHAKING_RATE)
        share = (1.0 - 1.0 / (1.0 + tau * bandwidth * dt)) / calm
        self._flown += dt
        if self._flown > SETTLING_TIME_S:
            self._lasting += dt / (WASHOUT_TIME_S + dt) * (dz - self._lasting)
        dz -= self._lasting
        ex, ey, ez = ex + share * (dx - ex), ey + share * (dy - ey), ez + share * (dz - ez)
        self.acceleration = _bounded(ex), _bounded(ey), _bounded(ez)
        return self.acceleration

    def rest(self) -> None:
        """Reset the estimate, because the vehicle is on the ground."""
        self._given = GRAVITY
        self._flown = self._lasting = 0.0
        self.acceleration = ZERO


def _bounded(value: float) -> float:
    return MAX_PUSH if value > MAX_PUSH else -MAX_PUSH if value < -MAX_PUSH else value


BANDWIDTH = 2.0
"""The filter's bandwidth a, rad/s. With TeleKyb's 0.2 the estimate takes half a minute to
converge."""
FORGETTING_RATE = 2.0
LARGEST_GAIN = 4.0
SMALLEST_GAIN = 0.01
MIN_WEIGHT, MAX_WEIGHT = 0.5, 2.0
SPOOL_START = 0.6
SPOOL_RATE = 1.0
"""Rate at which the assumed weight rises on the ground, in airframe weights per second."""
LIFT_OFF_TIME_S = 0.5
"""Seconds above the ground after which the vehicle certainly flies, even if its height falls again
later."""


class MassEstimator:
    """Estimates a vehicle's mass from its thrust and vertical speed.

    In the air, this is the adaptive estimator of TeleKyb's trackers, but with the true time
    step. With T the thrust along world z and v the vertical speed, v' = T/m - g. With the
    low-pass filter F = a / (s + a), y = a (v - F(v)) + g and w = F(T), this becomes y = w / m.
    With everything divided by the airframe's weight, r, the estimate of the airframe's mass
    over the mass, follows the error e = y - w r: r' = P w e, P' = lambda P - P^2 w^2, lambda =
    lambda0 (1 - P / kappa0).

    On the ground, the floor carries part of the weight. There the assumed weight rises from 60
    % of the guess until the vehicle lifts off, and the weight at lift-off is the first
    estimate.

    The estimate, a ratio to the airframe's mass, starts at `guess` and stays between 50 and 200 %.
    weight: the airframe's weight, N.
    """

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
            self._spool = min(MAX_WEIGHT, self._spool + SPOOL_RATE * dt)
        elif self._flown < LIFT_OFF_TIME_S:
            self._inverse = 1.0 / min(MAX_WEIGHT, 1.0 / self._inverse + SPOOL_RATE * dt)

    def update(self, lift: float, speed: float, dt: float) -> None:
        """Update the estimate in the air. lift: the commanded thrust along world z, N. speed: the
        upward speed, m/s. dt: seconds since the last update."""
        lift *= self._per_weight
        self._flown += dt
        if self._inverse is None:
            self._inverse = min(1.0 / MIN_WEIGHT, max(1.0 / MAX_WEIGHT, 1.0 / self._spool))
            self._lift, self._speed = lift, speed
            return
        share = BANDWIDTH * dt / (1.0 + BANDWIDTH * dt)
        self._lift += share * (lift - self._lift)
        change = speed - self._speed
        self._speed += share * change
        w, gain = self._lift, self._gain
        error = 1.0 + BANDWIDTH * change / GRAVITY - w * self._inverse
        inverse = self._inverse + dt * gain * w * error
        self._inverse = min(1.0 / MIN_WEIGHT, max(1.0 / MAX_WEIGHT, inverse))
        rate = FORGETTING_RATE * (1.0 - gain / LARGEST_GAIN) * gain - gain * gain * w * w
        self._gain = min(LARGEST_GAIN, max(SMALLEST_GAIN, gain + dt * rate))
