"""Position control: setpoint and estimate to attitude and thrust, for an on-board attitude loop.

The law of TeleKyb's standard tracker, per axis, with its gains: a = a_des + D (v_des - v) + P
(p_des - p) + I integral(p_des - p) + drag v_des, where the last two are horizontal: drag v_des
compensates the rotors' drag. Vertically the estimated mass replaces an integral, which would wind
up against it. A VELOCITY setpoint has no P term, an ACCELERATION setpoint only the term a_des. The
integral is kept when the kind of setpoint changes, because the disturbance that it compensates
continues.

With `position_gain` P is a matrix K, so that the axes differ, or are coupled:

    a = a_des + D (v_des - v) + K (p_des - p) + ...,    world axes,

as stiff along one direction as it is soft along another. K is symmetric and positive definite, so
that it pulls back along every direction. D and I stay the same along each.

Attitude and thrust give the specific force a + g (`kybflow.flight.steering`: limits, mass, the
on-board attitude's error). The jerk turns it at the rate z x jerk / |a + g|, fed forward as body
rates (Mellinger and Kumar, ICRA 2011, eq. 11). While tilt or thrust is limited, on the ground, and
in steps longer than 40 ms, the integral is frozen.
"""

from __future__ import annotations

from typing import Literal

from kybflow.core.geometry import GRAVITY, ZERO, Vec3, body_z
from kybflow.core.matrices import transform
from kybflow.core.signals import Command, CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.core.units import Matrix, Number
from kybflow.flight.loops.position_loop import OuterLoop, stiffness
from kybflow.flight.steering import Steering, turning
from kybflow.flight.steering_params import SteeringParams
from kybflow.parts import Tracker, param, params
from kybflow.world.vehicle_context import Airframe, InnerLoop, VehicleContext


@params
class CascadeParams(SteeringParams):
    proportional: Number = param("Acceleration per metre of position error.", default=9.0, above=0)
    position_gain: Matrix[Literal[3], Literal[3], Number] | None = param(
        "Acceleration per metre of position error along world x, y and z, in place of"
        " `proportional`; symmetric.",
        default=None, at_least=-100.0, at_most=100.0, is_definite=True,
    )  # fmt: skip
    derivative: Number = param("Acceleration per m/s of velocity error.", default=7.5, above=0)
    integral: Number = param(
        "Acceleration per metre and second of position error.", default=4.5, at_least=0
    )


class Cascade(Tracker[CascadeParams]):
    accepts = frozenset({SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION})
    emits = CommandKind.ATTITUDE_THRUST

    def __init__(self, params: CascadeParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._drag = context.airframe.drag
        self._steering = Steering(context, params.mass_guess)
        self._integral = (0.0, 0.0)

    @classmethod
    def outer_loop(
        cls, params: CascadeParams, airframe: Airframe, inner: InnerLoop | None, period: float
    ) -> OuterLoop:
        p, own = params, params.position_gain
        k, d, i = p.proportional, p.derivative, p.integral
        return OuterLoop(
            k, d, i, p.trim, airframe.drag, period, turning=0.0,
            stiffness=None if own is None else stiffness(own),
        )  # fmt: skip

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
        jerk, turn = setpoint.jerk, setpoint.heading_rate
        rates = (0.0, 0.0, turn) if jerk is None else turning(force, jerk, turn, attitude)
        return steering.command(force, attitude, rates, estimate, up)

    def _wanted(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> Vec3:
        """Return the desired specific force, world frame, m/s^2."""
        p = self.params
        _, position, velocity, acceleration, *_ = setpoint
        ax, ay, az = acceleration or ZERO
        ix, iy = self._integral
        az += GRAVITY
        if velocity is not None:
            wx, wy, wz = velocity
            vx, vy, vz = estimate.velocity
            d, drag = p.derivative, self._drag
            ax += d * (wx - vx) + drag * wx
            ay += d * (wy - vy) + drag * wy
            az += d * (wz - vz)
        if position is not None:
            wx, wy, wz = position
            px, py, pz = estimate.position
            k, ex, ey = p.proportional, wx - px, wy - py
            if p.position_gain is not None:
                kx, ky, kz = transform(p.position_gain, (ex, ey, wz - pz))
                ax, ay, az = ax + kx, ay + ky, az + kz
            else:
                ax += k * ex
                ay += k * ey
                az += k * (wz - pz)
            if self._steering.learns:
                i, most = p.integral * dt, p.integral_limit
                ix, iy = ix + i * ex, iy + i * ey
                ix = most if ix > most else -most if ix < -most else ix
                iy = most if iy > most else -most if iy < -most else iy
                self._integral = (ix, iy)
        return (ax + ix, ay + iy, az)
