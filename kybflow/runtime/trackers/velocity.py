"""Velocity control, with a position loop around it, for an on-board attitude loop.

It takes setpoints of velocity, and of position through a proportional law, world frame:

    v_cmd = v_des + P (p_des - p), the second part at most `correction` long     (POSITION)
    v_cmd = v_des                                                                (VELOCITY)
    a     = a_des + D (v_cmd - v) + I integral(v_cmd - v) + drag v_des

The position error moves the wanted velocity by no more than `correction`, so that a vehicle far
from its setpoint comes back at a bounded speed; `cascade`, whose position error acts on the
acceleration, comes back as fast as the tilt lets it. The integral is horizontal and takes what
holds the velocity off, such as wind; it is kept when the kind of setpoint changes. Vertically the
estimated mass does its work. TeleKyb's standard tracker has 7.5 for D in its velocity mode.

Attitude, thrust and limits: `kybflow.flight.steering`. The jerk is fed forward as body rates,
z x jerk / |a + g|.
"""

from __future__ import annotations

from kybflow.core.geometry import (
    GRAVITY,
    ZERO,
    Vec3,
    add,
    body_z,
    conjugate,
    cross,
    dot,
    rotate,
    scale,
    sub,
)
from kybflow.core.signals import Command, CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.core.units import Damping, Number, Speed
from kybflow.flight.governor import shortened
from kybflow.flight.steering import Steering
from kybflow.flight.steering_params import SteeringParams
from kybflow.parts import Tracker, param, params
from kybflow.world.vehicle_context import VehicleContext


@params
class VelocityParams(SteeringParams):
    proportional: Damping = param("Velocity per metre of position error.", default=1.2, above=0)
    correction: Speed = param(
        "The most that a position error adds to the velocity.", default=0.5, above=0
    )
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

    @property
    def hover_thrust(self) -> float:
        return self._steering.hover_thrust

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        estimate, dt, steering, p = tick.known(), tick.dt, self._steering, self.params
        steering.weigh(setpoint, estimate, p.lift_off, dt)
        force = steering.bounded(self._wanted(setpoint, estimate, dt), p.tilt)
        up = body_z(estimate.attitude)
        attitude = steering.attitude(force, up, setpoint, p.trim, dt)
        turn = scale(cross(force, setpoint.jerk or ZERO), 1.0 / dot(force, force))
        rates = rotate(conjugate(attitude), add(turn, (0.0, 0.0, setpoint.heading_rate)))
        return steering.command(force, attitude, rates, estimate, up)

    def _wanted(self, setpoint: Setpoint, estimate: Estimate, dt: float) -> Vec3:
        """The specific force that the law asks for, world."""
        p, asked = self.params, setpoint.velocity or ZERO
        error = sub(asked, estimate.velocity)
        if setpoint.position is not None:
            gap = sub(setpoint.position, estimate.position)
            error = add(error, shortened(scale(gap, p.proportional), p.correction))
        if self._steering.learns:
            i, most, (ix, iy) = p.integral * dt, p.integral_limit, self._integral
            self._integral = (
                min(max(ix + i * error[0], -most), most),
                min(max(iy + i * error[1], -most), most),
            )
        (ix, iy), drag = self._integral, self._drag
        ax, ay, az = add(setpoint.acceleration or ZERO, scale(error, p.derivative))
        return (ax + ix + drag * asked[0], ay + iy + drag * asked[1], az + GRAVITY)
