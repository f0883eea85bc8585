"""Dead reckoning on the IMU, for the seconds without any other position.

With f, w the IMU's specific force and turn rate, b and c their biases, R the attitude:

    R' = R (w - c),    v' = R (f - b) - g,    p' = v

While the vehicle flies on another estimator's estimate that is younger than `fresh`, an observer
follows that estimate and learns the biases. Let e and d be the differences of its position and
attitude (a rotation vector, body frame) from p and R, and k the `bandwidth` in rad/s:

    p' += 3 k e,  v' += 3 k^2 e,  b' = -k^3 R^T e,      R' += 2 k d,  c' = -k^2 d

All poles are at -k (a Luenberger observer: Franklin, Powell and Emami-Naeini, "Feedback Control of
Dynamic Systems", sec. 7.5); the attitude is corrected as in Mahony, Hamel and Pflimlin, IEEE TAC
2008, eq. 13. k is divided by 1 + (spread / 1 cm)^2, and for the attitude also by
1 + (shake / 10 mrad)^2, so that little is learnt from a noisy estimate. shake^2 is half of the mean
square of the change of d from one pose to the next, along an axis; a constant difference does not
contribute to it (J. von Neumann, "Distribution of the Ratio of the Mean Square Successive
Difference to the Variance", 1941). An error of the tilt looks like a bias and is learnt as one.
After half a second without another estimate, the state is set to the next one; the biases are kept.
There is no estimate before the first estimate that is followed, nor while no IMU measurement has
arrived for 0.1 s.

age: the age of the newest IMU measurement. spread, metres: sqrt(s^2 + (speed_error t)^2 +
(u t^2 / 2)^2), where s combines the spread of the last estimate that was followed and the distance
from it, t is the time since then, and u falls from `first_drift` to `drift` by exp(-k / 2) a second
while another estimate is followed.

Measured in simulation, 20 seeds of missions/fallback.yaml, biases learnt: 6 cm off on average and
10 cm at worst after 2.3 s on a circle, 16 cm at worst after 3 s of hovering.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot, pi, sqrt

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, Quat, Vec3, integrate, rotate, rotate_back
from kybflow.core.signals import IMU_TIMEOUT, NS, Estimate, Imu, Measurement, Time
from kybflow.core.units import Acceleration, Duration, Frequency, Speed
from kybflow.parts import Estimator, param, params
from kybflow.world.vehicle_context import VehicleContext

LONGEST_LEAP = 0.5
"""Seconds without another estimate after which the state is set to the next one."""
JUMP_DISTANCE, JUMP_SIGMAS = 0.15, 3.0
"""The followed estimate has jumped if it is off by more than `JUMP_DISTANCE` metres plus
`JUMP_SIGMAS` times its spread. Following a jump would change the velocity."""
NOISY_SPREAD, SHAKY_ANGLE = 0.01, 0.01
"""The spread (m) of the followed estimate, and the shaking (rad) of its attitude about an axis, at
which the gains are halved."""
SHAKING_TIME_S = 0.25
"""Averaging time of the shaking, s."""
MOST_ACCELERATION, MOST_TURN = 1.0, 0.1
"""Bounds of the biases, m/s^2 and rad/s, along each axis."""


@params
class InertialParams:
    fresh: Duration = param(
        "Age of the newest measurement below which another estimator's estimate is followed.",
        default=0.05, above=0.0,
    )  # fmt: skip
    bandwidth: Frequency = param(
        "Time constant of following another estimator's estimate and learning the biases.",
        default=0.5, above=0.0, at_most=2.0,
    )  # fmt: skip
    speed_error: Speed = param(
        "Standard deviation of the velocity's error when dead reckoning begins.",
        default=0.02, at_least=0.0,
    )  # fmt: skip
    drift: Acceleration = param(
        "Standard deviation of the acceleration's error after the biases are learnt.",
        default=0.05, at_least=0.0,
    )  # fmt: skip
    first_drift: Acceleration = param(
        "Standard deviation of the acceleration's error before the biases are learnt.",
        default=0.3,
        at_least=0.0,
    )


class Inertial(Estimator[InertialParams]):
    needs = frozenset({Imu})

    def __init__(self, params: InertialParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._time: Time | None = None
        self._anchored: Time | None = None
        self._anchor_spread = 0.0
        self._unlearnt = 1.0
        self._position, self._velocity = ZERO, ZERO
        self._attitude: Quat = LEVEL
        self._rates = ZERO
        self._accelerometer_bias = self._gyro_bias = ZERO
        self._turned, self._shake = ZERO, 0.0

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        for measurement in measurements:
            if type(measurement) is Imu:
                self._move(measurement)
        if self._anchored is None or self._time is None or now - self._time > IMU_TIMEOUT:
            return None
        ahead = (now - self._time) / NS
        px, py, pz = self._position
        vx, vy, vz = self._velocity
        p, alone = self.params, (now - self._anchored) / NS
        drift = p.drift + (p.first_drift - p.drift) * self._unlearnt
        slip, bend = p.speed_error * alone, 0.5 * drift * alone * alone
        return Estimate(
            now,
            (px + ahead * vx, py + ahead * vy, pz + ahead * vz),
            self._velocity,
            self._attitude,
            self._rates,
            "inertial",
            ahead,
            sqrt(self._anchor_spread**2 + slip * slip + bend * bend),
        )

    def anchor(self, estimate: Estimate) -> None:
        age = estimate.age
        if age > self.params.fresh or self._time is None:
            return
        seen = estimate.time - round(age * NS)
        last, self._anchored = self._anchored, seen
        self._anchor_spread = estimate.spread
        dt = (seen - last) / NS if last is not None else LONGEST_LEAP
        off = dist(estimate.position, self._position)
        if dt >= LONGEST_LEAP or off > JUMP_DISTANCE + JUMP_SIGMAS * estimate.spread:
            self._position, self._velocity = estimate.position, estimate.velocity
            if last is None:
                self._attitude = estimate.attitude
        elif dt > 0.0:
            share = estimate.spread / NOISY_SPREAD
            self._follow(estimate, 2.0 * pi * self.params.bandwidth / (1.0 + share * share), dt)
            self._anchor_spread = hypot(estimate.spread, off)

    def _move(self, imu: Imu) -> None:
        """Propagate the state to the time of an IMU sample."""
        time, _, force, turn_rates = imu
        fx, fy, fz = force
        wx, wy, wz = turn_rates
        last, self._time = self._time, time
        bx, by, bz = self._gyro_bias
        self._rates = rates = (wx - bx, wy - by, wz - bz)
        if last is None or self._anchored is None or time <= last:
            return
        if time - last > IMU_TIMEOUT:
            self._anchored = None
            return
        dt = (time - last) / NS
        bx, by, bz = self._accelerometer_bias
        ax, ay, az = rotate(self._attitude, (fx - bx, fy - by, fz - bz))
        az -= GRAVITY
        px, py, pz = self._position
        vx, vy, vz = self._velocity
        h = 0.5 * dt
        self._position = (
            px + dt * (vx + h * ax), py + dt * (vy + h * ay), pz + dt * (vz + h * az),
        )  # fmt: skip
        self._velocity = (vx + dt * ax, vy + dt * ay, vz + dt * az)
        self._attitude = integrate(self._attitude, rates, dt)

    def _follow(self, estimate: Estimate, k: float, dt: float) -> None:
        """Correct the state and the biases by the followed estimate. k: the bandwidth, rad/s. dt:
        the seconds since the last correction."""
        ox, oy, oz = estimate.position
        px, py, pz = self._position
        ex, ey, ez = ox - px, oy - py, oz - pz
        s = min(3.0 * k * dt, 1.0)
        self._position = (px + s * ex, py + s * ey, pz + s * ez)
        s *= k
        vx, vy, vz = self._velocity
        self._velocity = (vx + s * ex, vy + s * ey, vz + s * ez)
        s *= -k / 3.0
        w, x, y, z = self._attitude
        learnt = rotate_back((w, x, y, z), (s * ex, s * ey, s * ez))
        self._accelerometer_bias = _within(self._accelerometer_bias, learnt, MOST_ACCELERATION)
        mw, mx, my, mz = estimate.attitude
        two = 2.0 if w * mw + x * mx + y * my + z * mz >= 0.0 else -2.0
        dx = two * (w * mx - x * mw - y * mz + z * my)
        dy = two * (w * my + x * mz - y * mw - z * mx)
        dz = two * (w * mz - x * my + y * mx - z * mw)
        tx, ty, tz = self._turned
        self._turned = (dx, dy, dz)
        shook = ((dx - tx) ** 2 + (dy - ty) ** 2 + (dz - tz) ** 2) / 6.0
        self._shake += (shook - self._shake) * dt / (SHAKING_TIME_S + dt)
        k /= 1.0 + self._shake / (SHAKY_ANGLE * SHAKY_ANGLE)
        self._attitude = integrate(self._attitude, (dx, dy, dz), min(2.0 * k * dt, 1.0))
        s = -k * k * dt
        self._gyro_bias = _within(self._gyro_bias, (s * dx, s * dy, s * dz), MOST_TURN)
        self._unlearnt *= max(1.0 - 0.5 * k * dt, 0.0)


def _within(bias: Vec3, change: Vec3, most: float) -> Vec3:
    bx, by, bz = bias
    cx, cy, cz = change
    x, y, z = bx + cx, by + cy, bz + cz
    return (
        most if x > most else -most if x < -most else x,
        most if y > most else -most if y < -most else y,
        most if z > most else -most if z < -most else z,
    )
