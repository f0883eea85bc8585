"""Estimates a body's motion from delayed poses: velocities by a filtered derivative.

The derivative is TeleKyb's second-order filter H(s) = wn^2 s / (s^2 + 2 wn s + wn^2), evaluated at
the poses' own time stamps: an alpha-beta filter whose poles stay at exp(-wn dt) for any dt
(critically damped: alpha = 1 - theta^2, beta = (1 - theta)^2, theta = exp(-wn dt); Brookner,
"Tracking and Kalman Filtering Made Easy", 1998, sec. 1.3). Horizontally, the lag 2/wn of H is
compensated by the acceleration that follows from the attitude and the rotor drag: g times the slope
of body z, less drag times velocity, plus any known disturbance. Noisy poses are filtered more,
because a tracker turns noise of the velocity into thrust and tilt: from the 60th pose on, the
bandwidth is divided by 1 + (spread / 8 mm)^4, limited to 4 horizontally and to 2 vertically, where
nothing compensates the lag.

Attitude and body rates pass the same filter, applied to the rotation, which has no sign to flip.
The estimate is predicted over the latency to `now`. A turn and an acceleration last for a moment
only, so they are extrapolated for at most `MAX_EXTRAPOLATION_S`. After that the attitude and the
velocity stay as they are, the body rates are zero, and the spread grows by a t^2 / 2, which the
unknown acceleration a = 5 m/s^2 of `kybflow.flight.pose_gate` explains in the time t since then.
"""

from __future__ import annotations

from math import exp, hypot, sqrt, tau

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, Quat, Vec3, integrate
from kybflow.core.params import param, params
from kybflow.core.signals import NS, Estimate, Pose, Time, made
from kybflow.core.units import Duration, Frequency
from kybflow.flight.pose_gate import ACCELERATION

MIN_UPRIGHT = 0.5
"""Least vertical component of body z at which its slope is used as an acceleration."""
MAX_EXTRAPOLATION_S = 0.1
"""Age of a pose, seconds, above which it no longer determines the body's rotation and
acceleration."""
NOISE_SCALE, MAX_SMOOTHING, MAX_SMOOTHING_UP, WARM_UP_POSES = 0.008, 4.0, 2.0, 60


NO_PUSH = (0.0, 0.0)
"""No acceleration by a disturbance."""


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
    samples: int = param("Number of poses before the first estimate.", default=5, at_least=2)
    memory: Duration = param("Time window of the spread.", default=0.25, above=0.0)


class TrackedPose:
    """The filter of one body.

    stamp: the time of the last pose. count: the number of poses since the filter started. position,
    velocity (world), attitude, rates (body): the motion at `stamp`. spread: the running standard
    deviation of the innovation along an axis, metres. slope: the acceleration along x and y that
    follows from the attitude, m/s^2, world.
    """

    def __init__(self, params: TrackedParams, drag: float) -> None:
        self.stamp: Time = 0
        self.count = 0
        self.position = ZERO
        self.velocity = ZERO
        self.attitude: Quat = LEVEL
        self.rates = ZERO
        self._params, self._drag = params, drag
        self.spread = self._variance = 0.0
        self.slope = self._pull = (0.0, 0.0)

    def restart(self) -> None:
        """Let the filter start again at the next pose."""
        self.count = 0

    def take(
        self, pose: Pose, velocity: Vec3 = ZERO, pushed: tuple[float, float] = NO_PUSH
    ) -> None:
        """Process a pose that is newer than the last. velocity: the velocity to start with if the
        filter starts at this pose. pushed: the acceleration along x and y by a known disturbance,
        m/s^2, world."""
        time, position, attitude = pose
        dt = (time - self.stamp) / NS
        self.stamp = time
        if self.count == 0 or dt > self._params.gap:
            self.count = 1
            self.spread = self._variance = 0.0
            self.position, self.velocity = position, velocity
            self.attitude, self.rates = attitude, ZERO
            self.slope = self._pull = (0.0, 0.0)
        else:
            self.count += 1
            self._move(position, dt)
            self._turn(attitude, dt)
            self.slope = sx, sy = self._slope(self.attitude, self.velocity)
            px, py = pushed
            self._pull = (sx + px, sy + py)

    def estimate(self, now: Time, source: str) -> Estimate | None:
        """Return the motion at `now`, or None before there are enough poses."""
        return self.predicted(now, source) if self.count >= self._params.samples else None

    def predicted(self, now: Time, source: str) -> Estimate:
        """Return the motion at `now`, however few poses there are."""
        age = (now - self.stamp) / NS
        px, py, pz = self.position
        vx, vy, vz = self.velocity
        ax, ay = self._pull
        rates, spread = self.rates, self.spread
        if age <= MAX_EXTRAPOLATION_S:
            ahead, h, attitude = age, 0.5 * age, integrate(self.attitude, rates, age)
        else:
            ahead, h = (
                MAX_EXTRAPOLATION_S,
                MAX_EXTRAPOLATION_S * (1.0 - 0.5 * MAX_EXTRAPOLATION_S / age),
            )
            attitude, rates = integrate(self.attitude, rates, MAX_EXTRAPOLATION_S), ZERO
            spread = hypot(spread, 0.5 * ACCELERATION * (age - MAX_EXTRAPOLATION_S) ** 2)
        position = (px + age * (vx + h * ax), py + age * (vy + h * ay), pz + age * vz)
        velocity = (vx + ahead * ax, vy + ahead * ay, vz)
        return made(Estimate, (now, position, velocity, attitude, rates, source, age, spread))

    def bent(self, motion: Estimate) -> Estimate:
        """Return a predicted motion corrected for the change of acceleration during the prediction,
        which follows from the attitude and is assumed linear. Without this, a tracker sways at
        latencies of 50 ms and more."""
        if self.count < 2:
            return motion
        now, position, velocity, attitude, rates, source, age, spread = motion
        px, py, pz = position
        vx, vy, vz = velocity
        tx, ty = self._slope(attitude, motion.velocity)
        ax, ay = self._pull
        ahead = min(age, MAX_EXTRAPOLATION_S)
        jx, jy, moved, gained = tx - ax, ty - ay, ahead * ahead / 6.0, 0.5 * ahead
        position = (px + jx * moved, py + jy * moved, pz)
        velocity = (vx + jx * gained, vy + jy * gained, vz)
        return Estimate(now, position, velocity, attitude, rates, source, age, spread)

    def _move(self, seen: Vec3, dt: float) -> None:
        mx, my, mz = seen
        px, py, pz = self.position
        vx, vy, vz = self.velocity
        ax, ay = self._pull
        h = 0.5 * dt
        px, py, pz = px + dt * (vx + h * ax), py + dt * (vy + h * ay), pz + dt * vz
        ix, iy, iz = mx - px, my - py, mz - pz
        calm, p = 1.0, self._params
        if self.count > WARM_UP_POSES:
            noise = self._variance / (NOISE_SCALE * NOISE_SCALE)
            calm = min(1.0 + noise * noise, MAX_SMOOTHING)
        wn = tau * p.velocity_bandwidth * dt
        a, b = _gains(wn / calm, dt)
        au, bu = (a, b) if calm <= MAX_SMOOTHING_UP else _gains(wn / MAX_SMOOTHING_UP, dt)
        self.position = (px + a * ix, py + a * iy, pz + au * iz)
        self.velocity = (vx + dt * ax + b * ix, vy + dt * ay + b * iy, vz + bu * iz)
        share = dt / (p.memory + dt)
        self._variance += share * ((ix * ix + iy * iy + iz * iz) / 3.0 - self._variance)
        self.spread = sqrt(self._variance)

    def _turn(self, seen: Quat, dt: float) -> None:
        mw, mx, my, mz = seen
        rx, ry, rz = self.rates
        w, x, y, z = believed = integrate(self.attitude, self.rates, dt)
        two = 2.0 if w * mw + x * mx + y * my + z * mz >= 0.0 else -2.0
        ix = two * (w * mx - x * mw - y * mz + z * my)
        iy = two * (w * my + x * mz - y * mw - z * mx)
        iz = two * (w * mz - x * my + y * mx - z * mw)
        a, b = _gains(tau * self._params.rate_bandwidth * dt, dt)
        self.attitude = integrate(believed, (ix, iy, iz), a)
        self.rates = (rx + b * ix, ry + b * iy, rz + b * iz)

    def _slope(self, attitude: Quat, velocity: Vec3) -> tuple[float, float]:
        """Return the horizontal acceleration (m/s^2, world) at this attitude if the thrust carries
        the weight."""
        w, x, y, z = attitude
        vx, vy, _ = velocity
        drag = self._drag
        up = 1.0 - 2.0 * (x * x + y * y)
        if up < MIN_UPRIGHT:
            return (0.0, 0.0)
        k = 2.0 * GRAVITY / up
        return (k * (x * z + w * y) - drag * vx, k * (y * z - w * x) - drag * vy)


def _gains(wn: float, dt: float) -> tuple[float, float]:
    """Return alpha, and beta divided by `dt`, of the filter with its poles at exp(-wn)."""
    theta = exp(-wn)
    rest = 1.0 - theta
    return 1.0 - theta * theta, rest * rest / dt
