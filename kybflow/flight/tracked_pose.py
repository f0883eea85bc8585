"""A body's motion from poses that come one by one, late: velocities by a filtered derivative.

The derivative is TeleKyb's second-order filter H(s) = wn^2 s / (s^2 + 2 wn s + wn^2), but by the
poses' own time stamps: an alpha-beta filter whose poles stay at exp(-wn dt) for whatever dt
(critically damped: alpha = 1 - theta^2, beta = (1 - theta)^2, theta = exp(-wn dt); Brookner,
"Tracking and Kalman Filtering Made Easy", 1998, sec. 1.3). The lag 2/wn of H is filled in by the
acceleration that the attitude and the airframe's rotor drag tell: g times the slope of body z,
less drag times velocity, horizontally. Noisy poses are filtered harder, because a tracker makes
thrust and tilt of the velocity's noise: from the 60th pose on the bandwidth is divided by
1 + (spread / 8 mm)^4, horizontally by 4 at most, vertically by 2. Tilt that shakes takes its
torque from the rotors' thrust where they give nearly all they can, and the lag is filled in;
vertically it is not.

Attitude and body rates go through the same filter on the rotation, which has no sign to flip. The
estimate is predicted over the latency to `now`.
"""

from __future__ import annotations

from math import exp, pi, sqrt

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, Quat, Vec3, add, integrate, scale, sub
from kybflow.core.params import param, params
from kybflow.core.signals import NS, Estimate, Pose, Time
from kybflow.core.units import Duration, Frequency

STEEPEST = 0.5
"""Body z at least this far up for its slope to tell an acceleration."""
NOISY, CALMEST, CALMEST_UP, WARM = 0.008, 4.0, 2.0, 60


@params
class TrackedParams:
    velocity_bandwidth: Frequency = param(
        "Bandwidth of the filtered derivative that gives the velocity.",
        default=5.0, above=0.0, at_most=60.0,
    )  # fmt: skip
    rate_bandwidth: Frequency = param(
        "Bandwidth of the filtered derivative that gives the body rates.",
        default=10.0, above=0.0, at_most=60.0,
    )  # fmt: skip
    gap: Duration = param(
        "Time without a pose after which the filter starts again.", default=0.5, above=0.0
    )
    samples: int = param("Poses before there is an estimate.", default=5, at_least=2)
    memory: Duration = param("Time over which the spread is taken.", default=0.25, above=0.0)


class TrackedPose:
    """The filter. stamp: the last pose's. count: poses since it began. position, velocity in the
    world, attitude, rates in the body: at `stamp`."""

    def __init__(self, params: TrackedParams, drag: float) -> None:
        self.stamp: Time = 0
        self.count = 0
        self.position = ZERO
        self.velocity = ZERO
        self.attitude: Quat = LEVEL
        self.rates = ZERO
        self._params, self._drag = params, drag
        self._variance = 0.0
        self._acceleration = ZERO

    @property
    def spread(self) -> float:
        """Running standard deviation of the innovation along an axis, metres."""
        return sqrt(self._variance)

    def take(self, pose: Pose, velocity: Vec3 = ZERO) -> None:
        """Go on to a newer pose; where the filter begins, with this velocity."""
        dt = (pose.time - self.stamp) / NS
        if self.count == 0 or dt > self._params.gap:
            self._start(pose, velocity)
        else:
            self.count += 1
            self.stamp = pose.time
            self._move(pose, dt)
            self._turn(pose, dt)
            self._acceleration = self._slope(self.attitude, self.velocity)

    def estimate(self, now: Time, source: str) -> Estimate | None:
        """The motion now, None before there are enough poses."""
        return self.predicted(now, source) if self.count >= self._params.samples else None

    def predicted(self, now: Time, source: str) -> Estimate:
        """The motion now, however few poses there are."""
        age = (now - self.stamp) / NS
        px, py, pz = self.position
        vx, vy, vz = self.velocity
        ax, ay, az = self._acceleration
        h = 0.5 * age
        return Estimate(
            now,
            (px + age * (vx + h * ax), py + age * (vy + h * ay), pz + age * (vz + h * az)),
            (vx + age * ax, vy + age * ay, vz + age * az),
            integrate(self.attitude, self.rates, age),
            self.rates,
            source,
            age,
            self.spread,
        )

    def bent(self, motion: Estimate) -> Estimate:
        """A predicted motion with the acceleration's change until then, taken as linear, which the
        attitude told meanwhile. Over 50 ms and more a tracker sways without it."""
        if self.count < 2:
            return motion
        told, age = self._slope(motion.attitude, motion.velocity), motion.age
        change = sub(told, self._acceleration)
        return motion._replace(
            position=add(motion.position, scale(change, age * age / 6.0)),
            velocity=add(motion.velocity, scale(change, 0.5 * age)),
        )

    def _start(self, pose: Pose, velocity: Vec3) -> None:
        self.count = 1
        self.stamp = pose.time
        self._variance = 0.0
        self.position, self.attitude = pose.position, pose.attitude
        self.velocity = velocity
        self.rates = self._acceleration = ZERO

    def _move(self, pose: Pose, dt: float) -> None:
        mx, my, mz = pose.position
        px, py, pz = self.position
        vx, vy, vz = self.velocity
        ax, ay, az = self._acceleration
        h = 0.5 * dt
        px, py, pz = px + dt * (vx + h * ax), py + dt * (vy + h * ay), pz + dt * (vz + h * az)
        ix, iy, iz = mx - px, my - py, mz - pz
        calm = 1.0
        if self.count > WARM:
            calm = min(1.0 + (self._variance / (NOISY * NOISY)) ** 2, CALMEST)
        wn = 2.0 * pi * self._params.velocity_bandwidth * dt
        theta = exp(-wn / calm)
        a, b = 1.0 - theta * theta, (1.0 - theta) ** 2 / dt
        au, bu = a, b
        if calm > CALMEST_UP:
            theta = exp(-wn / CALMEST_UP)
            au, bu = 1.0 - theta * theta, (1.0 - theta) ** 2 / dt
        self.position = (px + a * ix, py + a * iy, pz + au * iz)
        self.velocity = (vx + dt * ax + b * ix, vy + dt * ay + b * iy, vz + dt * az + bu * iz)
        share = dt / (self._params.memory + dt)
        self._variance += share * ((ix * ix + iy * iy + iz * iz) / 3.0 - self._variance)

    def _turn(self, pose: Pose, dt: float) -> None:
        w, x, y, z = integrate(self.attitude, self.rates, dt)
        mw, mx, my, mz = pose.attitude
        two = 2.0 if w * mw + x * mx + y * my + z * mz >= 0.0 else -2.0
        ix = two * (w * mx - x * mw - y * mz + z * my)
        iy = two * (w * my + x * mz - y * mw - z * mx)
        iz = two * (w * mz - x * my + y * mx - z * mw)
        theta = exp(-2.0 * pi * self._params.rate_bandwidth * dt)
        a, b = 1.0 - theta * theta, (1.0 - theta) ** 2 / dt
        rx, ry, rz = self.rates
        self.attitude = integrate((w, x, y, z), (ix, iy, iz), a)
        self.rates = (rx + b * ix, ry + b * iy, rz + b * iz)

    def _slope(self, attitude: Quat, velocity: Vec3) -> Vec3:
        """The horizontal acceleration that an attitude tells, thrust holding the weight."""
        w, x, y, z = attitude
        up = 1.0 - 2.0 * (x * x + y * y)
        if up < STEEPEST:
            return ZERO
        k = 2.0 * GRAVITY / up
        vx, vy, _ = velocity
        return (
            k * (x * z + w * y) - self._drag * vx,
            k * (y * z - w * x) - self._drag * vy,
            0.0,
        )
