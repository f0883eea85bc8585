"""Keep the acceleration of the setpoint under a limit; follow behind where it asks for more.

A trajectory within the limit passes unchanged, bit for bit. What counts is the acceleration that
it states and the one that its velocity and position have between two ticks: with |a| <= A,

    |v - u| <= A dt,    |p - q - (u + v) dt / 2| <= A dt^2 / 4

(q, u: the last tick's). One that breaks them is followed by a reference governor
(`kybflow.flight.governor`) that stays within the limit and catches up without overshoot. The rate
of change of setpoints of velocity is limited in the same way. World frame.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import ClassVar

from kybflow.core.geometry import ZERO, Vec3, add, norm, sub
from kybflow.core.signals import Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration
from kybflow.flight.governor import Follower, motion_of, shortened
from kybflow.parts import Processor, param, params
from kybflow.world.vehicle_context import VehicleContext

_SLACK = 1.0 + 1e-6


@params
class LimitAccelerationParams:
    acceleration: Acceleration = param(
        "Largest acceleration of the setpoint.", default=3.0, above=0.0
    )


class LimitAcceleration(Processor[LimitAccelerationParams]):
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        SetpointKind.POSITION: SetpointKind.POSITION,
        SetpointKind.VELOCITY: SetpointKind.VELOCITY,
    }

    def __init__(self, params: LimitAccelerationParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._follower = Follower()

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        follower = self._follower
        position, velocity = setpoint.position or ZERO, setpoint.velocity or ZERO
        follower.resume(setpoint, tick)
        if setpoint.kind is SetpointKind.VELOCITY:
            return self._slew(setpoint, velocity, tick.dt)
        if not follower.behind and self._is_legal(setpoint, position, velocity, tick.dt):
            follower.join(position, velocity)
            return setpoint
        limit, asked = self.params.acceleration, motion_of(setpoint)
        motion = follower.follow(asked, inf, limit, tick.dt)
        if norm(asked.acceleration) <= limit and follower.has_caught_up(asked, limit, tick.dt):
            follower.join(position, velocity)
            return setpoint
        return motion.setpoint_like(setpoint)

    def _is_legal(self, setpoint: Setpoint, position: Vec3, velocity: Vec3, dt: float) -> bool:
        limit, before = self.params.acceleration * _SLACK, self._follower
        if norm(setpoint.acceleration or ZERO) > limit:
            return False
        vx, vy, vz = velocity
        ux, uy, uz = before.velocity
        change = sqrt((vx - ux) ** 2 + (vy - uy) ** 2 + (vz - uz) ** 2)
        if change > limit * dt + 1e-9:
            return False
        (px, py, pz), (qx, qy, qz), half = position, before.position, 0.5 * dt
        x, y, z = px - qx - half * (vx + ux), py - qy - half * (vy + uy), pz - qz - half * (vz + uz)
        return sqrt(x * x + y * y + z * z) <= 0.25 * limit * dt * dt + 1e-9

    def _slew(self, setpoint: Setpoint, asked: Vec3, dt: float) -> Setpoint:
        before = self._follower.velocity
        most = self.params.acceleration * dt
        change = sub(asked, before)
        if norm(change) <= most * _SLACK + 1e-9:
            self._follower.join(ZERO, asked)
            return setpoint
        velocity = add(before, shortened(change, most))
        self._follower.join(ZERO, velocity)
        return setpoint._replace(velocity=velocity, acceleration=ZERO, jerk=None)
