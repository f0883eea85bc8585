"""The simulated autopilot: attitude from a simulated IMU, attitude control, mixer. Never the truth.

Attitude: the explicit complementary filter with bias of Mahony, Hamel and Pflimlin (IEEE TAC 2008,
eq. 34), gyroscope and accelerometer; its heading follows the one that the sender believes, as an
autopilot's follows external vision. From a sender that knows none it takes the tilt alone, and
holds the heading that it has.

Control, per body axis: angular acceleration = P e + I integral(e) + D (rates - gyro), e twice the
vector part of the attitude error; torque = inertia x angular acceleration, led by the rotors' time
constant. The gains scale with the airframe's rotor time and inertia. Where a rotor would saturate,
all give way, so that attitude comes before height.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    from_heading,
    heading_of,
    multiply,
    wrap,
)
from kybflow.core.signals import Command
from kybflow.world.vehicle_context import Airframe

LEVELLING = 0.10
"""How fast the accelerometer levels the attitude, 1/s; its square over four corrects the bias."""
LIGHTEST, HEAVIEST = 0.5 * GRAVITY, 1.5 * GRAVITY
"""Where the accelerometer tells nothing about the attitude: below and above."""
AIMING = 1.0
"""How fast the heading follows the sender's, 1/s."""
STIFFNESS = 1.0
"""Natural frequency of roll and pitch times the rotors' time constant."""
YAW_FREQUENCY = 3.0
"""Natural frequency of yaw, rad/s; drag torque is weak."""
DAMPING = 0.8
INTEGRAL = 8.0
"""How many times slower than its loop's frequency an integral is."""
INTEGRAL_SHARE = 0.1
"""The torque that an integral may ask for, as a part of the weight on the arm."""
LEAD = 4.0
"""How many times faster a led rotor answers."""
CALIBRATION = 0.1
"""Seconds at rest from which the accelerometer's bias can be told."""
MOST_YAW = 0.1
"""The part of a rotor's largest thrust that yaw may take."""

Rotors = tuple[float, float, float, float]
STOPPED: Rotors = (0.0, 0.0, 0.0, 0.0)


class AttitudeController:
    """One vehicle's on-board controller; `update` once a physics step, `receive` once a command.
    `noise` are the errors of its IMU, in the order of what is felt. `rest`: the upward specific
    force that it felt before it was armed, m/s^2; gravity where that was not long enough."""

    def __init__(
        self, airframe: Airframe, heading: float, dt: float, noise: Iterator[list[float]]
    ) -> None:
        self.noise = noise
        self._dt = dt
        self._shares = (0.25 * LEVELLING * dt, 0.25 * AIMING * dt, 0.5 * dt)
        self._attitude: Quat = from_heading(heading)
        self._bias = ZERO
        self._turn = 0.0
        self._held: float | None = None
        self._wanted: Quat = LEVEL
        self._rates = ZERO
        self._thrust = 0.0
        self.armed = False
        self._law = tuple(_law(airframe, dt))
        self._integral = ZERO
        self._lead = (dt / (airframe.rotor_time / LEAD + dt), LEAD - 1.0)
        self._slow = STOPPED
        self._share = 0.25 / airframe.thrust
        self.rest, self._lifted, self._steps = GRAVITY, 0.0, 0

    @property
    def climb(self) -> float:
        """Vertical speed, upward, m/s: the IMU's upward specific force since it was armed, less
        what it felt before, at rest."""
        return self._dt * (self._lifted - self._steps * self.rest)

    def receive(self, command: Command) -> None:
        """Hold `command` until the next one."""
        attitude, self._thrust, self._rates, heading, armed, _, _ = command
        if heading is not None:
            self._wanted, self._held = attitude, None
            self._turn = AIMING * wrap(heading - heading_of(self._attitude))
        else:
            self._wanted = self._holding(attitude)
            self._turn = 0.0
        if not armed:
            self._integral = ZERO
            self._slow = STOPPED
        if armed is not self.armed:
            rested = armed and self._steps * self._dt >= CALIBRATION
            self.rest = self._lifted / self._steps if rested else GRAVITY
            self._lifted, self._steps = 0.0, 0
        self.armed = armed

    def _holding(self, attitude: Quat) -> Quat:
        """The tilt of `attitude`, at the heading of the moment when nobody knew one any more."""
        if self._held is None:
            self._held = heading_of(self._attitude)
        return multiply(from_heading(self._held - heading_of(attitude)), attitude)

    def update(self, felt: list[float]) -> Rotors:
        """The rotors' controls, 0 to 1, from what is felt where the IMU is: turn rate, rad/s, and
        specific force, m/s^2, along body x, y, z."""
        gx, gy, gz, ax, ay, az = felt
        nx, ny, nz, mx, my, mz = next(self.noise)
        bx, by, bz = self._bias
        w, x, y, z = self._attitude
        turn, (slow, aim, half) = self._turn, self._shares
        gx, gy, gz = gx + nx - bx, gy + ny - by, gz + nz - bz
        ax, ay, az = ax + mx, ay + my, az + mz
        # up in the body, as the attitude has it; the accelerometer's up is off by the cross product
        ux, uy, uz = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        size = sqrt(ax * ax + ay * ay + az * az)
        self._lifted += ax * ux + ay * uy + az * uz
        self._steps += 1
        k = LEVELLING / size if LIGHTEST < size < HEAVIEST else 0.0
        ex, ey, ez = k * (ay * uz - az * uy), k * (az * ux - ax * uz), k * (ax * uy - ay * ux)
        aim *= turn
        self._bias = (
            bx - slow * ex - aim * ux, by - slow * ey - aim * uy, bz - slow * ez - aim * uz,
        )  # fmt: skip
        hx = half * (gx + ex + turn * ux)
        hy = half * (gy + ey + turn * uy)
        hz = half * (gz + ez + turn * uz)
        nw = w - x * hx - y * hy - z * hz
        nx = x + w * hx + y * hz - z * hy
        ny = y + w * hy + z * hx - x * hz
        nz = z + w * hz + x * hy - y * hx
        n = 1.0 / sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
        self._attitude = (nw * n, nx * n, ny * n, nz * n)
        return self._control(gx, gy, gz) if self.armed else STOPPED

    def _control(self, gx: float, gy: float, gz: float) -> Rotors:
        w, x, y, z = self._attitude
        dw, dx, dy, dz = self._wanted
        two = 2.0 if w * dw + x * dx + y * dy + z * dz >= 0.0 else -2.0
        ex = two * (w * dx - x * dw - y * dz + z * dy)
        ey = two * (w * dy + x * dz - y * dw - z * dx)
        ez = two * (w * dz - x * dy + y * dx - z * dw)
        rx, ry, rz = self._rates
        ix, iy, iz = self._integral
        p, py, d, dy, i, iyaw, bound, kx, ky, kz = self._law
        ix += i * ex
        iy += i * ey
        iz += iyaw * ez
        ix = bound if ix > bound else -bound if ix < -bound else ix
        iy = bound if iy > bound else -bound if iy < -bound else iy
        iz = bound if iz > bound else -bound if iz < -bound else iz
        self._integral = (ix, iy, iz)
        roll = kx * (p * ex + d * (rx - gx) + ix)
        pitch = ky * (p * ey + d * (ry - gy) + iy)
        yaw = kz * (py * ez + dy * (rz - gz) + iz)
        return self._mixed(self._share * self._thrust, roll, pitch, yaw)

    def _mixed(self, lift: float, roll: float, pitch: float, yaw: float) -> Rotors:
        st, sr, sp, sy = self._slow
        blend, lead = self._lead
        dl, dr, dp, dy = lift - st, roll - sr, pitch - sp, yaw - sy
        self._slow = (st + blend * dl, sr + blend * dr, sp + blend * dp, sy + blend * dy)
        lift += lead * dl
        roll += lead * dr
        pitch += lead * dp
        yaw += lead * dy
        yaw = -MOST_YAW if yaw < -MOST_YAW else MOST_YAW if yaw > MOST_YAW else yaw
        a, b = lift + roll - pitch + yaw, lift + roll + pitch - yaw
        c, d = lift - roll + pitch + yaw, lift - roll - pitch - yaw
        if a > 1.0 or b > 1.0 or c > 1.0 or d > 1.0:
            excess = max(a, b, c, d) - 1.0
            return (a - excess, b - excess, c - excess, d - excess)
        return (a, b, c, d)


class _Law(NamedTuple):
    """The gains of roll and pitch and of yaw: proportional, 1/s^2; derivative, 1/s; integral over
    one step, 1/s^2. bound: of an integral, rad/s^2. roll, pitch, yaw: a rotor's share of its
    largest thrust per rad/s^2."""

    proportional: float
    proportional_yaw: float
    derivative: float
    derivative_yaw: float
    integral: float
    integral_yaw: float
    bound: float
    roll: float
    pitch: float
    yaw: float


def _law(airframe: Airframe, dt: float) -> _Law:
    frequency = STIFFNESS / airframe.rotor_time
    half = airframe.arm / sqrt(2.0)
    jx, jy, jz = airframe.inertia
    return _Law(
        frequency**2,
        YAW_FREQUENCY**2,
        2.0 * DAMPING * frequency,
        2.0 * DAMPING * YAW_FREQUENCY,
        dt * frequency**3 / INTEGRAL,
        dt * YAW_FREQUENCY**3 / INTEGRAL,
        INTEGRAL_SHARE * airframe.hover_thrust * half / max(jx, jy),
        jx / (4.0 * half * airframe.thrust),
        jy / (4.0 * half * airframe.thrust),
        jz / (4.0 * airframe.torque_ratio * airframe.thrust),
    )
