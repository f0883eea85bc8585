"""The simulated autopilot: attitude estimation from a simulated IMU, attitude control and mixer.

`OnboardState` holds the state of all vehicles between physics steps.

The attitude comes from gyroscope and accelerometer by the explicit complementary filter with bias
of Mahony, Hamel and Pflimlin (IEEE TAC 2008, eq. 34). Its heading follows the estimate of the
sender of commands, as an autopilot's heading follows external vision. If the sender doesn't know
the heading, the filter uses only the tilt of the sender's setpoint and holds the current heading.

The control law for each body axis is

    angular acceleration = P e + I integral(e) + D (rates - gyro)
    torque = inertia x angular acceleration

with a lead for the rotors' time constant. The attitude error is split into a tilt and a turn about
the desired body z (Brescianini, Hehn and D'Andrea, Nonlinear Quadrocopter Attitude Control, ETH
2013), so that a large heading error causes no tilt: e is the sine of the tilt, about body x and y,
and twice the vector part of the attitude error about body z. The gains of roll and pitch are those
of the airframe's loop (`kybflow.world.vehicle_context`), without a lead if that loop has none.
P e + D (rates - gyro) about body x and y is rotated back by the angle through which a spinning body
turns until the rotors respond.

When a rotor would saturate, roll and pitch take precedence over thrust, and thrust over yaw (Smeur,
Höppener and De Wagter, Prioritized Control Allocation for Quadrotors Subject to Saturation, IMAV
2017). The rotors at both ends of a diagonal get m + x and m - x, with x for roll and pitch, so that
m <= 1 - |x|; the other two provide the remaining lift, which affects only yaw. A vehicle with a
weak rotor stays level and in the air, but spins.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, sqrt, tau
from typing import Any, NamedTuple, Protocol

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
from kybflow.world.vehicle_context import DAMPING, INTEGRAL, Airframe

Numbers = tuple[float, ...]
MAX_DEAD_TIME = 50
"""The longest dead time of the on-board loop, in physics steps."""


class Rows(Protocol):
    """Rows of numbers, one for each vehicle, by the vehicle's index in the world."""

    def __getitem__(self, vehicle: int) -> Numbers: ...
    def __setitem__(self, vehicle: int, numbers: Numbers) -> None: ...


class OnboardState:
    """The on-board state of `count` vehicles. steps: number of physics steps made. is_slow: whether
    any on-board loop filters its gyroscope or has a dead time.

    setpoints, filters, loops, gains, gyros: setpoints, estimates, control states, gains and
    gyroscope filters of `onboard`. asked: controls delayed by the dead time, `MAX_DEAD_TIME` rows
    per vehicle. delays: index of the next of these rows, and their number. controls, rotors,
    thrusts,
    winds, pushes, constants: the arguments of `rotors.push`.
    """

    def __init__(self, count: int, rows: Callable[[int, int], Any]) -> None:
        self.count, self.steps, self.is_slow = count, 0, False
        widths = (10, 8, 7, 14, 7, 2, 4, 4, 4, 3, 6, 5)
        self.tables = [*(rows(count, width) for width in widths), rows(count * MAX_DEAD_TIME, 4)]
        self.setpoints: Rows
        self.setpoints, self.filters, self.loops, self.gains, self.gyros, *rest = self.tables
        self.delays: Rows
        self.asked: Rows
        self.delays, self.controls, self.rotors, self.thrusts, *rest = rest
        self.winds, self.pushes, self.constants, self.asked = rest

    def delayed(self, vehicle: int, wanted: Numbers) -> Numbers:
        """Return the controls that reach a vehicle's rotors now, and queue `wanted` for the dead
        time."""
        place, count = self.delays[vehicle]
        if count == 0.0:
            return wanted
        here = vehicle * MAX_DEAD_TIME + int(place)
        arrived, self.asked[here] = self.asked[here], wanted
        self.delays[vehicle] = ((place + 1.0) % count, count)
        return arrived


LEVELLING_RATE = 0.10
"""Gain of the accelerometer's correction of the attitude, 1/s; a quarter of its square is the gain
on the bias."""
MIN_FORCE, MAX_FORCE = 0.5 * GRAVITY, 1.5 * GRAVITY
"""Range of the specific force in which the accelerometer corrects the attitude, m/s^2."""
HEADING_RATE = 1.0
"""Gain of the sender's heading on the estimated heading, 1/s."""
YAW_FREQUENCY = 3.0
"""Natural frequency of yaw, rad/s, which is low because drag torque is weak."""
ERROR_SHARE = 0.5
"""Limit of the torque that an attitude error commands, as a fraction of weight times arm. Rotors in
hover can produce more than twice that, which leaves the rest to damping. Firmware limits the rates
instead (`MC_ROLLRATE_MAX`); without a limit saturated rotors oscillate."""
INTEGRAL_SHARE = 0.1
"""Limit of the torque that an integral commands, as a fraction of weight times arm."""
CALIBRATION_S = 0.1
"""Time at rest needed to measure the accelerometer's bias, seconds."""
MOST_YAW = 0.1
"""Limit of yaw, as a fraction of a rotor's largest thrust."""

NO_MOTORS: Numbers = (0.0, 0.0, 0.0, 0.0)
AT_REST: Numbers = (0.0, 0.0, 0.0, *NO_MOTORS)


class Loop(NamedTuple):
    """The settings of an on-board loop. airframe: the airframe for which its gains are tuned.
    cut_off: cut-off frequency of the second-order low-pass on the gyroscope, Hz; 0 without a
    filter. dead_time: from a gyroscope sample to the rotors, seconds."""

    airframe: Airframe
    cut_off: float = 0.0
    dead_time: float = 0.0


class AttitudeController:
    """Passes the commands of one vehicle to its on-board control laws, `estimate` and `control`.
    rest: mean upward specific force before arming, m/s^2; gravity if the time was too short to
    measure it."""

    def __init__(
        self,
        airframe: Airframe,
        loop: Loop,
        heading: float,
        dt: float,
        onboard: OnboardState,
        index: int,
    ) -> None:
        self._dt, self._onboard, self._index = dt, onboard, index
        self._held: float | None = None
        self._share = 0.25 / airframe.thrust
        self.armed = False
        self.rest, self._lifted, self._steps = GRAVITY, 0.0, 0
        onboard.setpoints[index] = (0.0, *LEVEL, *ZERO, 0.0, 0.0)
        onboard.filters[index] = (*from_heading(heading), *ZERO, 0.0)
        onboard.gains[index] = tuple(_gains(loop.airframe, dt))
        onboard.gyros[index] = (*ZERO, *ZERO, _share(loop.cut_off, dt))
        onboard.is_slow = onboard.is_slow or loop.cut_off > 0.0 or loop.dead_time > 0.0
        onboard.delays[index] = (0.0, float(min(MAX_DEAD_TIME, round(loop.dead_time / dt))))

    def gained(self) -> tuple[float, float]:
        """Return the integral of the upward specific force in excess of that at rest, m/s, since
        the last call or since arming, and the duration of this interval, seconds."""
        lifted, steps = self._since()
        self._mark(lifted, steps)
        return self._dt * (lifted - steps * self.rest), self._dt * steps

    def _since(self) -> tuple[float, int]:
        """Return the sum of the upward specific force since the last mark, and the number of
        steps."""
        onboard = self._onboard
        return onboard.filters[self._index][-1] - self._lifted, onboard.steps - self._steps

    def _mark(self, lifted: float, steps: int) -> None:
        self._lifted, self._steps = self._lifted + lifted, self._steps + steps

    def receive(self, command: Command) -> None:
        """Follow `command` until the next one."""
        attitude, thrust, rates, heading, armed, _, _ = command
        turn = 0.0
        if heading is not None:
            self._held = None
            turn = HEADING_RATE * wrap(heading - heading_of(self.attitude()))
        else:
            # only the tilt counts, at the heading held since the sender's heading became unknown
            if self._held is None:
                self._held = heading_of(self.attitude())
            attitude = multiply(from_heading(self._held - heading_of(attitude)), attitude)
        if armed is not self.armed:
            lifted, steps = self._since()
            rested = armed and steps * self._dt >= CALIBRATION_S
            self.rest = lifted / steps if rested else GRAVITY
            self._mark(lifted, steps)
            self.armed = armed
        lift = self._share * thrust
        self._onboard.setpoints[self._index] = (float(armed), *attitude, *rates, lift, turn)

    def attitude(self) -> Quat:
        """Return the estimated attitude, body to world."""
        w, x, y, z, _, _, _, _ = self._onboard.filters[self._index]
        return (w, x, y, z)


def _share(cut_off: float, dt: float) -> float:
    """Return the fraction of a change that each of two equal low-pass stages follows in a step,
    such that both together have their -3 dB point at `cut_off`, Hz."""
    return 1.0 - exp(-tau * cut_off * dt / sqrt(sqrt(2.0) - 1.0)) if cut_off else 1.0


def shares(dt: float) -> Numbers:
    """Return the factors on turn rate, levelling and aiming in a step of `dt` seconds."""
    return (0.5 * dt, 0.25 * LEVELLING_RATE * dt, 0.25 * HEADING_RATE * dt)


def estimate(
    filtered: Numbers, setpoint: Numbers, sample: Numbers, shares: Numbers
) -> tuple[Numbers, Numbers]:
    """Return the next state of the attitude filter, and the turn rates without bias. filtered: the
    filter's state: attitude, gyroscope bias, and sum of the upward specific force. sample: turn
    rate and specific force along body x, y, z. shares: `shares` of a step."""
    w, x, y, z, bx, by, bz, lifted = filtered
    gx, gy, gz, ax, ay, az = sample
    gx, gy, gz = gx - bx, gy - by, gz - bz
    # the estimated up in body axes; its cross product with the measured one is the error
    ux, uy, uz = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    size = sqrt(ax * ax + ay * ay + az * az)
    lifted += ax * ux + ay * uy + az * uz
    k = LEVELLING_RATE / size if MIN_FORCE < size < MAX_FORCE else 0.0
    ex, ey, ez = k * (ay * uz - az * uy), k * (az * ux - ax * uz), k * (ax * uy - ay * ux)
    turn = setpoint[-1]
    tx, ty, tz = turn * ux, turn * uy, turn * uz
    half, slow, aim = shares
    bx, by, bz = bx - slow * ex - aim * tx, by - slow * ey - aim * ty, bz - slow * ez - aim * tz
    hx, hy, hz = half * (gx + ex + tx), half * (gy + ey + ty), half * (gz + ez + tz)
    nw = w - x * hx - y * hy - z * hz
    nx = x + w * hx + y * hz - z * hy
    ny = y + w * hy + z * hx - x * hz
    nz = z + w * hz + x * hy - y * hx
    n = 1.0 / sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    return (nw * n, nx * n, ny * n, nz * n, bx, by, bz, lifted), (gx, gy, gz)


def smooth(gyro: Numbers, rates: Numbers) -> tuple[Numbers, Numbers]:
    """Return the next state of a gyroscope's low-pass, and the filtered turn rates. gyro: the
    low-pass's state: two first-order stages for each axis, and the fraction of a change that a
    stage follows in a step, which is 1 without a filter."""
    ax, ay, az, bx, by, bz, share = gyro
    if share >= 1.0:
        return gyro, rates
    gx, gy, gz = rates
    ax, ay, az = ax + share * (gx - ax), ay + share * (gy - ay), az + share * (gz - az)
    bx, by, bz = bx + share * (ax - bx), by + share * (ay - by), bz + share * (az - bz)
    return (ax, ay, az, bx, by, bz, share), (bx, by, bz)


def control(
    loop: Numbers, filtered: Numbers, rates: Numbers, setpoint: Numbers, gains: Numbers
) -> tuple[Numbers, Numbers]:
    """Return the next state of the control loop, and the rotors' controls. loop: the loop's state:
    the integrals, and the low-passed commands of thrust, roll, pitch and yaw."""
    w, x, y, z, _, _, _, _ = filtered
    gx, gy, gz = rates
    ix, iy, iz, st, sr, sp, sy = loop
    armed, dw, dx, dy, dz, rx, ry, rz, lift, _ = setpoint
    p, py, d, dyaw, i, iyaw, bound, most, kx, ky, kz, blend, lag, lead = gains
    if armed == 0.0:
        return AT_REST, NO_MOTORS
    ec = w * dw + x * dx + y * dy + z * dz
    ea = w * dx - x * dw - y * dz + z * dy
    eb = w * dy + x * dz - y * dw - z * dx
    ez = w * dz - x * dy + y * dx - z * dw
    ex = 2.0 * (ec * ea - ez * eb)
    ey = 2.0 * (ec * eb + ez * ea)
    ez *= 2.0 if ec >= 0.0 else -2.0
    ix += i * ex
    iy += i * ey
    iz += iyaw * ez
    least = -bound
    ix = bound if ix > bound else least if ix < least else ix
    iy = bound if iy > bound else least if iy < least else iy
    iz = bound if iz > bound else least if iz < least else iz
    ax, ay = p * ex, p * ey
    ax = most if ax > most else -most if ax < -most else ax
    ay = most if ay > most else -most if ay < -most else ay
    # the commands minus their low-pass; the lead amplifies this difference
    dt = lift - st
    turned = lag * gz
    ax, ay = ax + d * (rx - gx), ay + d * (ry - gy)
    dr = kx * (ax + turned * ay + ix) - sr
    dp = ky * (ay - turned * ax + iy) - sp
    dy = kz * (py * ez + dyaw * (rz - gz) + iz) - sy
    loop = (ix, iy, iz, st + blend * dt, sr + blend * dr, sp + blend * dp, sy + blend * dy)
    lift, roll, pitch, yaw = st + lead * dt, sr + lead * dr, sp + lead * dp, sy + lead * dy
    yaw = -MOST_YAW if yaw < -MOST_YAW else MOST_YAW if yaw > MOST_YAW else yaw
    a, b = lift + roll - pitch + yaw, lift + roll + pitch - yaw
    c, d = lift - roll + pitch + yaw, lift - roll - pitch - yaw
    if max(a, b, c, d) > 1.0:
        tilt, lean = roll - pitch, roll + pitch
        most, most_other = 1.0 - abs(tilt), 1.0 - abs(lean)
        mean = min(most, max(lift + yaw, 2.0 * lift - most_other))
        other = min(most_other, 2.0 * lift - mean)
        a, b, c, d = mean + tilt, other + lean, mean - tilt, other - lean
    if min(a, b, c, d) < 0.0:
        a, b, c, d = max(a, 0.0), max(b, 0.0), max(c, 0.0), max(d, 0.0)
    return loop, (a, b, c, d)


class Gains(NamedTuple):
    """The gains for roll and pitch, and for yaw: proportional, 1/s^2; derivative, 1/s; integral
    over one step, 1/s^2. bound: limit of an integral, rad/s^2. most: limit of the proportional
    term, rad/s^2. roll, pitch, yaw: fraction of a rotor's largest thrust per rad/s^2. blend:
    fraction of a change that the low-passed commands follow in a step. lag: response time of a
    rotor with lead, seconds; 0 without lead. lead: factor by which the lead makes the rotor
    faster."""

    proportional: float
    proportional_yaw: float
    derivative: float
    derivative_yaw: float
    integral: float
    integral_yaw: float
    bound: float
    most: float
    roll: float
    pitch: float
    yaw: float
    blend: float
    lag: float
    lead: float


def _gains(airframe: Airframe, dt: float) -> Gains:
    loop = airframe.attitude_loop
    led = airframe.rotor_time / loop.lead + dt
    half = airframe.arm / sqrt(2.0)
    jx, jy, jz = airframe.inertia
    return Gains(
        loop.proportional,
        YAW_FREQUENCY**2,
        loop.derivative,
        2.0 * DAMPING * YAW_FREQUENCY,
        dt * loop.integral,
        dt * YAW_FREQUENCY**3 / INTEGRAL,
        INTEGRAL_SHARE * airframe.hover_thrust * half / max(jx, jy),
        ERROR_SHARE * airframe.hover_thrust * half / max(jx, jy),
        jx / (4.0 * half * airframe.thrust),
        jy / (4.0 * half * airframe.thrust),
        jz / (4.0 * airframe.torque_ratio * airframe.thrust),
        dt / led,
        led if loop.lead > 1.0 else 0.0,
        loop.lead,
    )
