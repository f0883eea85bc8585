"""The simulated autopilot: attitude from a simulated IMU, attitude control, mixer. Never the truth.

Attitude: the explicit complementary filter with bias of Mahony, Hamel and Pflimlin (IEEE TAC 2008,
eq. 34), gyroscope and accelerometer; its heading follows the one that the sender believes, as an
autopilot's follows external vision.

Control, per body axis: angular acceleration = P e + I integral(e) + D (rates - gyro), e twice the
vector part of the attitude error; torque = inertia x angular acceleration, led by the rotors' time
constant. The gains scale with the airframe's rotor time and inertia. Where a rotor would saturate,
all give way, so that attitude comes before height.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt

from kybflow.drivers.sim.model import ROTORS
from kybflow.geometry import GRAVITY, LEVEL, ZERO, Quat, from_heading, heading_of, wrap
from kybflow.signals import Command
from kybflow.site import Airframe

LEVELLING = 0.10
"""How fast the accelerometer levels the attitude, 1/s; its square over four corrects the bias."""
AIMING = 1.0
"""How fast the heading follows the sender's, 1/s."""
STIFFNESS = 1.0
"""Natural frequency of roll and pitch times the rotors' time constant."""
YAW_FREQUENCY = 3.0
"""Natural frequency of yaw, rad/s; drag torque is weak."""
DAMPING = 0.8
INTEGRAL = 8.0
"""How many times slower than its loop's frequency an integral is."""
LEAD = 4.0
"""How many times faster a led rotor answers."""
MOST_YAW = 0.1
"""Of a rotor's largest thrust: what yaw may take."""

Rotors = tuple[float, float, float, float]
STOPPED: Rotors = (0.0, 0.0, 0.0, 0.0)


class Pilot:
    """One vehicle's on-board controller; `update` once a physics step, `receive` once a command."""

    def __init__(
        self, airframe: Airframe, heading: float, dt: float, noise: Iterator[list[float]]
    ) -> None:
        self._noise = noise
        self._dt = dt
        self._attitude: Quat = from_heading(heading)
        self._bias = ZERO
        self._turn = 0.0
        self._wanted: Quat = LEVEL
        self._rates = ZERO
        self._thrust = 0.0
        self._armed = False
        frequency = STIFFNESS / airframe.rotor_time
        self._gain = (frequency * frequency, YAW_FREQUENCY * YAW_FREQUENCY)
        self._damping = (2.0 * DAMPING * frequency, 2.0 * DAMPING * YAW_FREQUENCY)
        self._slowness = (dt * frequency / INTEGRAL, dt * YAW_FREQUENCY / INTEGRAL)
        self._integral = ZERO
        half = airframe.arm / sqrt(2.0)
        jx, jy, jz = airframe.inertia
        self._bound = 0.1 * airframe.hover_thrust * half / max(jx, jy)
        # newtons of one rotor per rad/s^2, over the rotor's largest thrust
        largest = airframe.thrust
        self._mix = (
            jx / (4.0 * half * largest),
            jy / (4.0 * half * largest),
            jz / (4.0 * airframe.torque_ratio * largest),
        )
        self._share = 0.25 / largest
        self._lead = LEAD - 1.0
        self._blend = dt / (airframe.rotor_time / LEAD + dt)
        self._slow = STOPPED

    def receive(self, command: Command) -> None:
        """Hold `command` until the next one."""
        self._wanted = command.attitude
        self._rates = command.rates
        self._thrust = command.thrust
        if command.heading is not None:
            self._turn = AIMING * wrap(command.heading - heading_of(self._attitude))
        else:
            self._turn = 0.0
        if not command.armed:
            self._integral = ZERO
            self._slow = STOPPED
        self._armed = command.armed

    def update(
        self, gx: float, gy: float, gz: float, ax: float, ay: float, az: float
    ) -> Rotors:
        """The rotors' controls, 0 to 1, from what the IMU's place feels: rad/s and m/s^2, body."""
        nx, ny, nz, mx, my, mz = next(self._noise)
        bx, by, bz = self._bias
        gx += nx - bx
        gy += ny - by
        gz += nz - bz
        self._tell_attitude(gx, gy, gz, ax + mx, ay + my, az + mz)
        if not self._armed:
            return STOPPED
        return self._rotors(gx, gy, gz)

    def _tell_attitude(
        self, gx: float, gy: float, gz: float, ax: float, ay: float, az: float
    ) -> None:
        w, x, y, z = self._attitude
        # where up is in the body, by the attitude
        ux, uy, uz = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        felt = sqrt(ax * ax + ay * ay + az * az)
        turn = self._turn
        dt = self._dt
        if 0.5 * GRAVITY < felt < 1.5 * GRAVITY:
            k = LEVELLING / felt
            ex, ey, ez = k * (ay * uz - az * uy), k * (az * ux - ax * uz), k * (ax * uy - ay * ux)
            bx, by, bz = self._bias
            slow = 0.25 * LEVELLING * dt
            aim = 0.25 * AIMING * dt * turn
            self._bias = (
                bx - slow * ex - aim * ux, by - slow * ey - aim * uy, bz - slow * ez - aim * uz,
            )  # fmt: skip
            gx += ex
            gy += ey
            gz += ez
        half = 0.5 * dt
        hx, hy, hz = half * (gx + turn * ux), half * (gy + turn * uy), half * (gz + turn * uz)
        nw = w - x * hx - y * hy - z * hz
        nx = x + w * hx + y * hz - z * hy
        ny = y + w * hy + z * hx - x * hz
        nz = z + w * hz + x * hy - y * hx
        n = 1.0 / sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
        self._attitude = (nw * n, nx * n, ny * n, nz * n)

    def _rotors(self, gx: float, gy: float, gz: float) -> Rotors:
        w, x, y, z = self._attitude
        dw, dx, dy, dz = self._wanted
        two = 2.0 if w * dw + x * dx + y * dy + z * dz >= 0.0 else -2.0
        ex = two * (w * dx - x * dw - y * dz + z * dy)
        ey = two * (w * dy + x * dz - y * dw - z * dx)
        ez = two * (w * dz - x * dy + y * dx - z * dw)
        rx, ry, rz = self._rates
        p, pz = self._gain
        d, dyaw = self._damping
        ix, iy, iz = self._integral
        (slow, slow_yaw), bound = self._slowness, self._bound
        ix += slow * p * ex
        iy += slow * p * ey
        iz += slow_yaw * pz * ez
        ix = bound if ix > bound else -bound if ix < -bound else ix
        iy = bound if iy > bound else -bound if iy < -bound else iy
        iz = bound if iz > bound else -bound if iz < -bound else iz
        self._integral = (ix, iy, iz)
        kx, ky, kz = self._mix
        roll = kx * (p * ex + d * (rx - gx) + ix)
        pitch = ky * (p * ey + d * (ry - gy) + iy)
        yaw = kz * (pz * ez + dyaw * (rz - gz) + iz)
        return self._mixed(self._share * self._thrust, roll, pitch, yaw)

    def _mixed(self, lift: float, roll: float, pitch: float, yaw: float) -> Rotors:
        st, sr, sp, sy = self._slow
        blend, lead = self._blend, self._lead
        dt_, dr, dp, dy = lift - st, roll - sr, pitch - sp, yaw - sy
        self._slow = (st + blend * dt_, sr + blend * dr, sp + blend * dp, sy + blend * dy)
        lift += lead * dt_
        roll += lead * dr
        pitch += lead * dp
        yaw += lead * dy
        yaw = -MOST_YAW if yaw < -MOST_YAW else MOST_YAW if yaw > MOST_YAW else yaw
        a, b = lift + roll - pitch + yaw, lift + roll + pitch - yaw
        c, d = lift - roll + pitch + yaw, lift - roll - pitch - yaw
        excess = max(a, b, c, d) - 1.0
        if excess > 0.0:
            return (a - excess, b - excess, c - excess, d - excess)
        return (a, b, c, d)
