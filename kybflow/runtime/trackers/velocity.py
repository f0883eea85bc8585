"""Velocity control, with a position loop around it, for an on-board attitude loop.

It takes setpoints of velocity, and of position through a proportional law, world frame:

    v_cmd = v_des + P (p_des - p), the second part at most `correction` long     (POSITION)
    v_cmd = v_des                                                                (VELOCITY)
    a     = a_des + D (v_cmd - v) + I integral(v_cmd - v) + drag v_des

The position error moves the wanted velocity by no more than `correction`, so that a vehicle far
from its setpoint comes back at a bounded speed; `cascade`, whose position error acts on the
acceleration, comes back as fast as the tilt lets it. The integral is horizontal and compensates
velocity errors, such as those from wind; it is kept when the kind of setpoint changes. Vertically
the estimated mass replaces it. TeleKyb's standard tracker has 7.5 for D in its velocity mode.

Attitude, thrust and limits: `kybflow.flight.steering`. The jerk is fed forward as body rates,
z x jerk / |a + g|.
"""

from __future__ import annotations

from kybflow.core.geometry import GRAVITY, ZERO, Vec3, body_z
from kybflow.core.signals import Command, CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.core.units import Damping, Number, Speed
from kybflow.flight.governor import shortened
from kybflow.flight.loops.position_loop import OuterLoop
from kybflow.flight.steering import Steering, turning
from kybflow.flight.steering_params import SteeringParams
from kybflow.parts import Tracker, param, params
from kybflow.world.vehicle_context import Airframe, InnerLoop, VehicleContext


@params
class VelocityParams(SteeringParams):
    proportional: Damping = param("Velocity per metre of position error.", default=1.2, above=0)
    correction: Speed = param("Largest velocity that a position error adds.", default=0.5, above=0)
    derivative: Number = param("Acceleration per m/s of velocity error.", default=7.5, above=0)
    integral: Number = param(
        "Acceleration per metre of integrated velocity error.", default=4.5, at_least=0
    )


class Velocity(Tracker[VelocityParams]):
    accepts = frozenset({SetpointKind.POSITION, SetpointKind.VELOCITY})
    emits = CommandKind.ATTITUDE_THRUST

    def __init__(self, params: VelocityParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._drag = context.airframe.drag
        self._steering = Steering(context, params.mass_guess)
        self._integral = (0.0, 0.0)

    @classmethod
    def outer_loop(
        cls, params: VelocityParams, airframe: Airframe, inner: InnerLoop | None, period: float
    ) -> OuterLoop:
        """Return the equivalent outer loop of `cascade`: with v_cmd = P e, its gains are D P + I,
        D and I P."""
        p, k, d, i = params, params.proportional, params.derivative, params.integral
        return OuterLoop(d * k + i, d, i * k, p.trim, airframe.drag, period, turning=0.0)

    @property
    def hover_thrust(self) -> float:
        return self._steering.hover_thrust

    @property
    def lean(self) -> tuple[float, float]:
        return self._steering.lean

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        estimate, dt, steering, p = tick.known(), tick.dt, self._steering, self.params
        steering.weigh(setpoint, estimate, p.lift_off, dt)
        wanted, up = self._wanted(setpoint, estimate, dt), body_z(estimate.attitude)
        force, attitude = steering.attitude(wanted, up, setpoint, p, dt)
        rates = turning(force, setpoint.jerk or ZERO, setpoint.heading_rate, attitude)
        return steering.command(force, attitude, rates, estimate, up)

    def _wanted(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> Vec3:
        """Return the desired specific force, world frame, m/s^2."""
        p = self.params
        _, position, velocity, acceleration, *_ = setpoint
        wx, wy, wz = velocity or ZERO
        vx, vy, vz = estimate.velocity
        ex, ey, ez = wx - vx, wy - vy, wz - vz
        if position is not None:
            k = p.proportional
            sx, sy, sz = position
            px, py, pz = estimate.position
            gap = (k * (sx - px), k * (sy - py), k * (sz - pz))
            cx, cy, cz = shortened(gap, p.correction)
            ex, ey, ez = ex + cx, ey + cy, ez + cz
        ix, iy = self._integral
        if self._steering.learns:
            i, most = p.integral * dt, p.integral_limit
            ix, iy = ix + i * ex, iy + i * ey
            ix = most if ix > most else -most if ix < -most else ix
            iy = most if iy > most else -most if iy < -most else iy
            self._integral = (ix, iy)
        d, drag = p.derivative, self._drag
        ax, ay, az = acceleration or ZERO
        return (ax + d * ex + ix + drag * wx, ay + d * ey + iy + drag * wy, az + d * ez + GRAVITY)
