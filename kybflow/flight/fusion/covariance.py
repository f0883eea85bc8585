"""The covariance of an error-state Kalman filter on an IMU: prediction, correction, reset, gate.

J. Solà, "Quaternion kinematics for the error-state Kalman filter", 2017 (arXiv:1711.02508). There
are fifteen errors, true minus nominal, in the order of its sec. 5.1: position and velocity (world),
attitude (rotation vector in the body, q_true = q Exp(error), sec. 5.3), biases of accelerometer and
gyroscope (body).

The state may be augmented by m causes of systematic measurement errors, each with the prior
variance 1, so that an error common to many measurements is neither averaged away nor taken for
motion (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation",
2001, sec. 8.2, autocorrelated measurement noise). The first `WANDERERS` causes are first-order
Markov processes, x' = a x + w, where w has the variance 1 - a^2; the rest are constants. SI units.
A covariance is a (15 + m) x (15 + m) array that is never changed in place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy
from numpy.typing import NDArray

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, Quat, Vec3, integrate, rotate
from kybflow.core.signals import NS, Time

Matrix = NDArray[numpy.float64]

STATES = 15
POSITION, VELOCITY, ATTITUDE = slice(0, 3), slice(3, 6), slice(6, 9)
ACCELEROMETER, GYRO = slice(9, 12), slice(12, 15)
WANDERERS = 6
"""How many of the causes of systematic errors vary as Markov processes; the others are constant."""
_IDENTITY = numpy.eye(STATES)
_POSE: Matrix = _IDENTITY[[0, 1, 2, 6, 7, 8]]
_SEES = {3: _POSE[:3], 6: _POSE}
"""The measurement matrix H of a position and of a pose, by the number of innovations."""


class Nominal(NamedTuple):
    """The nominal state: position and velocity in the world, attitude from body to world, biases in
    the body."""

    time: Time
    position: Vec3
    velocity: Vec3 = ZERO
    attitude: Quat = LEVEL
    accelerometer_bias: Vec3 = ZERO
    gyro_bias: Vec3 = ZERO

    def moved(self, force: Vec3, turn: Vec3, time: Time) -> Nominal:
        """Return the state at `time`, after this specific force f and turn rate w since the last
        (sec. 5.4.1). The force is taken as f + w x f dt / 2, rotated by the attitude at the middle
        of the step, to second order."""
        last, (px, py, pz), (vx, vy, vz), attitude, accelerometer, gyro = self
        dt = (time - last) / NS
        h = 0.5 * dt
        (wx, wy, wz), (bx, by, bz) = turn, gyro
        turn = wx, wy, wz = wx - bx, wy - by, wz - bz
        (fx, fy, fz), (bx, by, bz) = force, accelerometer
        fx, fy, fz = fx - bx, fy - by, fz - bz
        ax, ay, az = rotate(
            attitude,
            (
                fx + h * (wy * fz - wz * fy),
                fy + h * (wz * fx - wx * fz),
                fz + h * (wx * fy - wy * fx),
            ),
        )
        az -= GRAVITY
        return Nominal(
            time,
            (px + dt * (vx + h * ax), py + dt * (vy + h * ay), pz + dt * (vz + h * az)),
            (vx + dt * ax, vy + dt * ay, vz + dt * az),
            integrate(attitude, turn, dt),
            accelerometer,
            gyro,
        )

    def corrected(self, error: Matrix) -> Nominal:
        """Return the state corrected by the error (sec. 6.2, eq. 283)."""
        px, py, pz, vx, vy, vz, x, y, z, ax, ay, az, gx, gy, gz = error[:STATES].tolist()
        (p0, p1, p2), (v0, v1, v2) = self.position, self.velocity
        (a0, a1, a2), (g0, g1, g2) = self.accelerometer_bias, self.gyro_bias
        return Nominal(
            self.time,
            (p0 + px, p1 + py, p2 + pz),
            (v0 + vx, v1 + vy, v2 + vz),
            integrate(self.attitude, (x, y, z), 1.0),
            (a0 + ax, a1 + ay, a2 + az),
            (g0 + gx, g1 + gy, g2 + gz),
        )


class ImuNoise(NamedTuple):
    """Standard deviations of the errors that an IMU's noise adds to a state in one second:
    velocity, m/s, and attitude, rad, by white noise; the biases, m/s^2 and rad/s, by their random
    walk."""

    velocity: float
    attitude: float
    accelerometer: float
    gyro: float

    def variances(self) -> Matrix:
        """Return the variances that are added to the fifteen errors in one second, (15,)."""
        return numpy.repeat(numpy.square((0.0, *self)), 3)


class Correction(NamedTuple):
    """The correction by a measurement. distance: the squared Mahalanobis distance of its
    innovation. error: the correction of the errors. covariance: the covariance after it."""

    distance: float
    error: Matrix
    covariance: Matrix


def predicted(
    covariance: Matrix, before: Nominal, after: Nominal, noise: Matrix, kept: float = 1.0
) -> Matrix:
    """Return the covariance at `after`, predicted from `before` by the IMU alone: F P F' + Q.
    noise: as from `ImuNoise.variances`. kept: the share that is left of the causes that vary.

    F is the transition over the whole step (app. B.3, truncated); the integrals of the specific
    force are taken from the change of the nominal state. The noise is that of sec. 5.5.2 (eq. 262).
    """
    dt = (after.time - before.time) / NS
    (p0, p1, p2), (q0, q1, q2) = before.position, after.position
    (u0, u1, u2), (v0, v1, v2) = before.velocity, after.velocity
    first, last = matrix(before.attitude), matrix(after.attitude)
    middle = (0.5 * dt) * (first + last)
    once = skew((v0 - u0, v1 - u1, v2 - u2 + GRAVITY * dt))
    twice = skew(
        (q0 - p0 - u0 * dt, q1 - p1 - u1 * dt, q2 - p2 - u2 * dt + 0.5 * GRAVITY * dt * dt)
    )
    size = len(covariance)
    f = numpy.eye(size)
    f[0, 3] = f[1, 4] = f[2, 5] = dt
    f[POSITION, ATTITUDE] = -(twice @ first)
    f[POSITION, ACCELEROMETER] = (-0.5 * dt) * middle
    f[POSITION, GYRO] = twice @ middle / 3.0
    f[VELOCITY, ATTITUDE] = -(once @ first)
    f[VELOCITY, ACCELEROMETER] = -middle
    f[VELOCITY, GYRO] = once @ middle / 2.0
    f[ATTITUDE, ATTITUDE] = last.T @ first
    f[ATTITUDE, GYRO] = -(last.T @ middle)
    if size > STATES:
        f.flat[STATES * (size + 1) : (STATES + WANDERERS) * (size + 1) : size + 1] = kept
    result: Matrix = f @ covariance @ f.T
    variance = result.reshape(-1)[:: size + 1]
    variance[:STATES] += dt * noise
    variance[STATES : STATES + WANDERERS] += 1.0 - kept * kept
    return result


def widened(covariance: Matrix, position: float, velocity: float, attitude: float) -> Matrix:
    """Return the covariance with independent errors of these standard deviations added."""
    result = covariance.copy()
    size = len(covariance)
    result.flat[: ATTITUDE.stop * size : size + 1] += numpy.repeat(
        numpy.square((position, velocity, attitude)), 3
    )
    return result


def correction(
    covariance: Matrix, innovation: list[float], noise: Matrix, sees: Matrix | None = None
) -> Correction:
    """Return the correction by a measurement with this noise, before the reset (sec. 6.1; the
    covariance in Joseph's form). sees: H. Without it, the innovation is that of a position (3
    numbers) or a pose (6, with the attitude's as a rotation vector in the body frame) without
    systematic errors."""
    h = _SEES[len(innovation)] if sees is None else sees
    residual = numpy.array(innovation)
    seen = h @ covariance
    inverse = numpy.linalg.inv(seen @ h.T + noise)
    gain = seen.T @ inverse
    left = numpy.eye(len(covariance)) - gain @ h
    after = left @ covariance @ left.T + gain @ noise @ gain.T
    return Correction(
        float(residual @ inverse @ residual), gain @ residual, 0.5 * (after + after.T)
    )


def seen_with(slopes: Matrix) -> Matrix:
    """Return the measurement matrix H of a pose with systematic errors. slopes: the errors per unit
    of each cause, (6, m)."""
    return numpy.hstack((_POSE, slopes))


def reset(covariance: Matrix, error: Matrix) -> Matrix:
    """Return the covariance about the corrected attitude (sec. 6.3, eq. 287)."""
    g = numpy.eye(len(covariance))
    x, y, z = error[ATTITUDE].tolist()
    g[ATTITUDE, ATTITUDE] -= skew((0.5 * x, 0.5 * y, 0.5 * z))
    result: Matrix = g @ covariance @ g.T
    return result


def matrix(q: Quat) -> Matrix:
    """Return the rotation matrix of an attitude."""
    w, x, y, z = q
    return numpy.array(
        (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
    )


def skew(v: Vec3) -> Matrix:
    """Return the matrix of the cross product with `v` from the left."""
    x, y, z = v
    return numpy.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))


def chi_square_bound(refused: float, size: int) -> float:
    """Return the squared distance that a share of `refused` of all true measurements of this size
    (3 or 6) exceeds: the inverse of the chi-square distribution's tail."""
    from scipy.special import chdtri  # slow to load, and only needed by `fusion`

    return float(chdtri(size, refused))


AVERAGING_S = 0.5
"""Seconds over which the variance is averaged."""
RATIO = 4.0
"""Least ratio of the measured to the declared variance that counts as vibration."""


class Vibration:
    """Estimates the noise of an IMU that rotors shake. Noise counts only if it is clearly more than
    declared.

    The second difference, a - 2 b + c, of white samples with the variance s^2 has the variance 6
    s^2, and contains hardly any motion: body rates that follow rotors with a lag bend by 0.1 deg/s
    within 4 ms. White samples every dt seconds add the variance s^2 dt per second to a velocity or
    an angle. Vibration at one frequency adds less than that, so the result is on the safe side.
    """

    def __init__(self, declared: ImuNoise) -> None:
        self._declared = declared
        self._force, self._turn = Scatter(), Scatter()

    def add_imu(self, force: Vec3, turn: Vec3, dt: float) -> None:
        """Add a specific force and a turn rate, measured over `dt` seconds."""
        self._force.see(force, dt)
        self._turn.see(turn, dt)

    @property
    def noise(self) -> ImuNoise:
        """The measured noise, or the declared noise unless the measured one is clearly larger."""
        p = self._declared
        velocity, attitude = (
            scatter.variance**0.5 if scatter.variance > RATIO * declared * declared else declared
            for scatter, declared in ((self._force, p.velocity), (self._turn, p.attitude))
        )
        return p._replace(velocity=velocity, attitude=attitude)


class Scatter:
    """Measures the scatter of a quantity's samples. variance: the variance per axis that the
    scatter adds to the quantity's integral in one second."""

    __slots__ = ("_before", "_last", "_seen", "variance")

    def __init__(self) -> None:
        self.variance = 0.0
        self._before = self._last = ZERO
        self._seen = 0

    def see(self, sample: Vec3, dt: float) -> None:
        """Add a sample that covers `dt` seconds."""
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = self._before, self._last, sample
        if self._seen > 1:
            x, y, z = ax - 2.0 * bx + cx, ay - 2.0 * by + cy, az - 2.0 * bz + cz
            share = dt / (AVERAGING_S + dt)
            self.variance += share * (dt * (x * x + y * y + z * z) / 18.0 - self.variance)
        else:
            self._seen += 1
        self._before, self._last = self._last, sample
