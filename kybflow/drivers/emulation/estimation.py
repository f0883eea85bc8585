"""State estimation on an emulated onboard computer: an attitude filter and a position observer.

Attitude: the explicit complementary filter with bias of Mahony, Hamel and Pflimlin (IEEE TAC 2008,
eq. 34), from gyroscope, accelerometer and a measured heading. In flight an accelerometer measures
only the thrust, whatever the tilt. If the position is measured, the gravity that levels the
attitude is therefore the specific force minus the acceleration derived from the position, which has
the same effect as the filters of PX4 and ArduPilot. World ENU, body FLU.

Position: inertial, corrected by measurements. Each axis has a constant-gain observer with the error
of the acceleration as its third state and all poles at exp(-w dt), where w is the bandwidth and dt
the seconds since the last correction. With the innovation e and k = 1 - exp(-w dt): p += e -
(1-k)^3 e, v += 1.5 k^2 (2 - k) / dt e, b += k^3 / dt^2 e (Brookner, "Tracking and Kalman Filtering
Made Easy", 1998, sec. 1.3), so that after a long gap an offset is not taken for a speed. Between
corrections p' = v, v' = a + b. A late measurement is compared with the position at its time.
Metres, ENU.
"""

from __future__ import annotations

from collections import deque
from math import exp

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    cross,
    from_heading,
    heading_of,
    integrate,
    multiply,
    norm,
    rotate,
    scale,
    sub,
    wrap,
)
from kybflow.core.signals import NS, Imu, Time

LEVELLING_RATE, AIDED_RATE = 0.10, 0.6
"""How fast the accelerometer levels the attitude, alone and with a known acceleration, 1/s. The
gyroscope's bias is learnt with critical damping, at a quarter of the square of this gain, 1/s^2."""
HEADING_RATE, HEADING_BIAS_GAIN = 1.0, 0.1
"""How fast the heading follows the measured one, 1/s, and the gain of the gyroscope's bias about
the vertical, 1/s^2."""
MIN_FORCE, MAX_FORCE = 0.5 * GRAVITY, 1.5 * GRAVITY
UP: Vec3 = (0.0, 0.0, 1.0)


class AttitudeFilter:
    """The attitude of one vehicle. value: the rotation from body to world. rate: the turn rates in
    body axes, without the gyroscope's bias, rad/s."""

    def __init__(self, heading: float) -> None:
        self.value: Quat = from_heading(heading)
        self.rate: Vec3 = ZERO
        self._bias: Vec3 = ZERO
        self._off = 0.0
        self._is_aimed = False

    @property
    def heading(self) -> float:
        return heading_of(self.value)

    def see(self, heading: float) -> None:
        """Correct with a heading measured by vision or a compass, radians. The first heading, and
        any that is more than 1 rad off, is adopted at once."""
        self._off = wrap(heading - self.heading)
        if not self._is_aimed or abs(self._off) > 1.0:
            turned = from_heading(self._off)
            self.value = multiply(turned, self.value)
            self._is_aimed, self._off = True, 0.0

    def lose(self) -> None:
        """Discard the last heading, because none is measured any more."""
        self._off = 0.0

    def add_imu(self, imu: Imu, lacking: Vec3 | None) -> None:
        """Propagate with an IMU sample. lacking: the acceleration that position measurements show
        beyond that of the accelerometer, m/s^2 in the world; None without position measurements,
        when the vehicle is assumed not to accelerate."""
        back = conjugate(self.value)
        up = rotate(back, UP)
        force, size = imu.specific_force, norm(imu.specific_force)
        gain, error = LEVELLING_RATE, ZERO
        if lacking is not None:
            gain, error = AIDED_RATE, scale(cross(force, rotate(back, lacking)), 1.0 / GRAVITY**2)
        elif MIN_FORCE < size < MAX_FORCE:
            error = scale(cross(force, up), 1.0 / size)
        learnt = add(scale(error, gain**2 / 4.0), scale(up, HEADING_BIAS_GAIN * self._off))
        self._bias = sub(self._bias, scale(learnt, imu.dt))
        self.rate = sub(imu.angular_velocity, self._bias)
        aimed = add(scale(error, gain), scale(up, HEADING_RATE * self._off))
        self.value = integrate(self.value, add(self.rate, aimed), imu.dt)
        self._off *= max(0.0, 1.0 - HEADING_RATE * imu.dt)


HISTORY_NS: Time = NS // 2
MOST_BIAS = 0.5
"""The bound of the estimated error of the acceleration, m/s^2."""


class PositionObserver:
    """The position of one vehicle, which starts at zero, at rest. bias: the acceleration that the
    accelerometer fails to measure, m/s^2 in the world."""

    def __init__(self) -> None:
        self.position: Vec3 = ZERO
        self.velocity: Vec3 = ZERO
        self.bias: Vec3 = ZERO
        self._past: deque[tuple[Time, Vec3]] = deque()
        self._shifted: Vec3 = ZERO

    def add_imu(self, acceleration: Vec3, dt: float, now: Time) -> None:
        """Propagate by `dt` seconds. acceleration: in the world, without gravity, m/s^2."""
        a = add(acceleration, self.bias)
        move = add(scale(self.velocity, dt), scale(a, 0.5 * dt * dt))
        self.position = add(self.position, move)
        self.velocity = add(self.velocity, scale(a, dt))
        self._past.append((now, sub(self.position, self._shifted)))
        while self._past[0][0] < now - HISTORY_NS:
            self._past.popleft()

    def off(self, position: Vec3, at: Time) -> Vec3:
        """Return the offset of a position measured at `at` from the estimate at that time,
        metres."""
        then = next((p for time, p in reversed(self._past) if time <= at), None)
        if then is None:
            then = self._past[0][1] if self._past else sub(self.position, self._shifted)
        return sub(position, add(then, self._shifted))

    def correct(self, off: Vec3, bandwidths: Vec3, dt: float) -> None:
        """Correct the estimate by a measurement. off: its offset from the estimate, metres. dt:
        seconds since the last correction."""
        if dt <= 0.0:
            return
        k = [1.0 - exp(-w * dt) for w in bandwidths]
        p = [(1.0 - (1.0 - k) ** 3) * e for k, e in zip(k, off, strict=True)]
        v = [1.5 * k * k * (2.0 - k) / dt * e for k, e in zip(k, off, strict=True)]
        b = [k**3 / dt**2 * e for k, e in zip(k, off, strict=True)]
        self.shift((p[0], p[1], p[2]))
        self.velocity = add(self.velocity, (v[0], v[1], v[2]))
        x, y, z = add(self.bias, (b[0], b[1], b[2]))
        self.bias = (_within(x), _within(y), _within(z))

    def rest(self) -> None:
        """Set the velocity to zero, because the vehicle is at rest."""
        self.velocity = ZERO

    def shift(self, off: Vec3) -> None:
        """Shift the position and its history."""
        self.position, self._shifted = add(self.position, off), add(self._shifted, off)


def _within(bias: float) -> float:
    return max(-MOST_BIAS, min(MOST_BIAS, bias))
