"""Geometric position control, for the trackers `geometric` and `body_rates`. The equations and
their source are in the docstring of `geometric`."""

from __future__ import annotations

from math import cos, sin, sqrt

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Quat,
    Vec3,
    body_z,
    dot,
    heading_of,
    rotate_back,
    scale,
    sub,
)
from kybflow.core.params import param, params
from kybflow.core.signals import Command, Estimate, Imu, MeasurementKind, Setpoint, Tick
from kybflow.core.units import Frequency
from kybflow.flight.force_estimates import DisturbanceObserver
from kybflow.flight.loops.position_loop import FASTEST, DesignedGains, Gains, OuterLoop, completed
from kybflow.flight.steering import Steering
from kybflow.flight.steering_params import SteeringParams
from kybflow.world.vehicle_context import Airframe, InnerLoop, VehicleContext

FRESH_S = 0.03
"""Age (s) of an estimate that counts as without delay, if the driver declares no poses."""
ON_BOARD = 0.07
"""Delay (s) of the on-board loop and the command link for which the gains are designed."""
MAX_LAG_S = 0.1
"""Largest additional delay of an estimate that is considered, s."""
SPREAD_SPEED = 0.5
"""The spread divided by this speed, m/s, counts as a delay, because uncertain poses are filtered
for longer."""
DELAY_AVERAGING_S = 1.0
"""Seconds over which the delay is averaged."""


@params
class GeometricParams(DesignedGains, SteeringParams):
    observer: Frequency = param(
        "Bandwidth of estimating disturbances from the accelerometer; 0 to disable it.",
        default=2.0, at_least=0.0, at_most=20.0, read_only=True,
    )  # fmt: skip


def used_by(params: GeometricParams) -> frozenset[MeasurementKind]:
    """Return the kinds of measurement that improve control."""
    return frozenset({Imu}) if params.observer else frozenset()


def outer_loop(
    params: GeometricParams,
    airframe: Airframe,
    inner: InnerLoop | None,
    period: float,
    attitude: float | None = None,
) -> OuterLoop:
    """Return the loop that the law closes; gains that are None are designed for `inner`. attitude:
    body rates per attitude error, 1/s, of a tracker that also closes the attitude loop."""
    p = params
    law = OuterLoop(*FASTEST, p.trim, airframe.drag, period, p.observer, attitude)
    return completed(law, p, inner)


class GeometricLaw:
    """The control law with its integral. Exists as long as its tracker. attitude: as in
    `outer_loop`."""

    def __init__(
        self, params: GeometricParams, context: VehicleContext, attitude: float | None = None
    ) -> None:
        self._context, self._attitude = context, attitude
        self._gains: Gains = FASTEST
        self._tune(params)
        self._drag = context.airframe.drag
        self._steering = Steering(context, params.mass_guess)
        self._integral = (0.0, 0.0)
        loop = context.loop
        self._fresh = FRESH_S if loop is None else loop.pose_latency + 2.0 * loop.pose_period
        self._late = 0.0
        self._observer = DisturbanceObserver(context.airframe)

    @property
    def hover_thrust(self) -> float:
        """The estimated hover thrust, N."""
        return self._steering.hover_thrust

    @property
    def lean(self) -> tuple[float, float]:
        """The slope that is commanded where the vehicle stands still."""
        return self._steering.lean

    def command(self, params: GeometricParams, setpoint: Setpoint, tick: Tick) -> Command:
        """Return the attitude, body rates and thrust that follow the setpoint."""
        estimate, dt, steering, p = tick.known(), tick.dt, self._steering, params
        if p is not self._tuned:
            self._tune(p)
        steering.weigh(setpoint, estimate, p.lift_off, dt)
        up = body_z(estimate.attitude)
        # how much older the estimate is than the gains were designed for: a camera's is older than
        # motion capture's, and one from GPS is filtered for long
        late = estimate.age + estimate.spread / SPREAD_SPEED - self._fresh
        late = 0.0 if late < 0.0 else MAX_LAG_S if late > MAX_LAG_S else late
        self._late += dt / (DELAY_AVERAGING_S + dt) * (late - self._late)
        wanted, turning = self._wanted(p, setpoint, estimate, up, dt)
        if p.observer == 0.0 or not steering.flies:
            self._observer.rest()
        else:
            given = steering.force_along
            pushed = self._observer.update(tick.imu, estimate, given, p.observer, dt)
            against = setpoint.presses
            if against is not None:
                pushed = sub(pushed, scale(against, dot(pushed, against)))
            wanted = sub(wanted, pushed)
        force, attitude = steering.attitude(wanted, up, setpoint, p, dt)
        still = steering.limited or not steering.flies
        rates = _rates(ZERO if still else turning, force, attitude, setpoint.heading_rate)
        return steering.command(force, attitude, rates, estimate, up)

    def _tune(self, params: GeometricParams) -> None:
        """Update the gains to new parameters."""
        context = self._context
        loop = outer_loop(params, context.airframe, context.loop, context.dt, self._attitude)
        self._tuned, self._gains = params, (loop.proportional, loop.derivative, loop.integral)

    def _wanted(
        self, p: GeometricParams, setpoint: Setpoint, estimate: Estimate, up: Vec3, dt: float
    ) -> tuple[Vec3, Vec3]:
        """Return (f, f'): the desired specific force and its derivative, m/s^2 and m/s^3, world."""
        c = self._drag
        k, d, i = self._gains
        slower = ON_BOARD / (ON_BOARD + self._late)
        k, d, i = k * slower * slower, d * slower, i * slower * slower
        ux, uy, uz = up
        vx, vy, vz = estimate.velocity
        _, position, velocity, acceleration, jerk, _, _, _ = setpoint
        wx, wy, wz = velocity or ZERO
        ax, ay, az = acceleration or ZERO
        jx, jy, jz = jerk or ZERO
        push = self._steering.force_along
        slip = vx * ux + vy * uy + vz * uz
        ex = push * ux - c * (vx - slip * ux) - ax
        ey = push * uy - c * (vy - slip * uy) - ay
        ez = push * uz - c * (vz - slip * uz) - GRAVITY - az
        tx, ty, tz = jx - d * ex + c * ax, jy - d * ey + c * ay, jz - d * ez
        along = wx * ux + wy * uy + wz * uz
        fx = ax + d * (wx - vx) + c * (wx - along * ux)
        fy = ay + d * (wy - vy) + c * (wy - along * uy)
        fz = az + d * (wz - vz) + c * (wz - along * uz) + GRAVITY
        ix, iy = self._integral
        if position is not None:
            sx, sy, sz = position
            px, py, pz = estimate.position
            ex, ey = sx - px, sy - py
            fx, fy, fz = fx + k * ex, fy + k * ey, fz + k * (sz - pz)
            tx, ty, tz = tx + k * (wx - vx), ty + k * (wy - vy), tz + k * (wz - vz)
            if self._steering.learns:
                i, most = i * dt, p.integral_limit
                ix, iy = ix + i * ex, iy + i * ey
                ix = most if ix > most else -most if ix < -most else ix
                iy = most if iy > most else -most if iy < -most else iy
                self._integral = (ix, iy)
        return (fx + ix, fy + iy, fz), (tx, ty, tz)


def _rates(turning: Vec3, force: Vec3, attitude: Quat, heading_rate: float) -> Vec3:
    """Return the body rates with which the attitude along `force` turns while the force changes by
    `turning`.

    About body x and y: z' = (f' - (f' . z) z) / |f|. About body z: the body's y stays normal to the
    level direction h of the heading, y . h = 0, so w_z = (w_x (h . z) + heading_rate (y . (e3 x
    h))) / (h . x).
    """
    fx, fy, fz = force
    per_force = 1.0 / sqrt(fx * fx + fy * fy + fz * fz)
    tx, ty, _ = rotate_back(attitude, turning)
    wx, wy = -ty * per_force, tx * per_force
    heading = heading_of(attitude)
    c, s = cos(heading), sin(heading)
    hx, _, hz = rotate_back(attitude, (c, s, 0.0))
    _, ny, _ = rotate_back(attitude, (-s, c, 0.0))
    return (wx, wy, (wx * hz + heading_rate * ny) / hx)
