"""Keep the acceleration of the setpoint under a limit; lag behind it at higher accelerations.

A trajectory within the limit passes unchanged, bit for bit. The limit applies to the acceleration
in the setpoint, and to that computed from its velocity and position in two successive ticks: with
|a| <= A,

    |v - u| <= A dt,    |p - q - (u + v) dt / 2| <= A dt^2 / 4

(q, u: position and velocity in the last tick). A trajectory that violates these conditions is
followed by a reference governor (`kybflow.flight.governor`) that stays within the limit and catches
up smoothly, without overshoot. The rate of change of velocity setpoints is limited to A as well.
World frame.
"""

from __future__ import annotations

from math import hypot, inf
from typing import ClassVar

from kybflow.core.geometry import ZERO, Vec3, distance
from kybflow.core.signals import Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration
from kybflow.flight.governor import Follower
from kybflow.flight.motion import motion_of
from kybflow.parts import Processor, param, params
from kybflow.world.vehicle_context import VehicleContext

_SLACK = 1.0 + 1e-6


@params
class LimitAccelerationParams:
    acceleration: Acceleration = param(
        "Largest acceleration of the setpoint.", default=3.0, above=0.0
    )


class LimitAcceleration(Processor[LimitAccelerationParams]):
    slows = True
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        SetpointKind.POSITION: SetpointKind.POSITION,
        SetpointKind.VELOCITY: SetpointKind.VELOCITY,
    }

    def __init__(self, params: LimitAccelerationParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._follower = Follower(context.airframe)

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        _, position, velocity, acceleration, *_ = setpoint
        position, velocity = position or ZERO, velocity or ZERO
        follower, limit, dt = self._follower, self.params.acceleration, tick.dt
        follower.resume(setpoint, tick)
        legal = hypot(*(acceleration or ZERO)) <= limit * _SLACK
        if legal and not follower.behind and self._is_near(setpoint, position, velocity, dt):
            follower.position, follower.velocity = position, velocity
            follower.acceleration = acceleration or ZERO
            return setpoint
        asked = motion_of(setpoint)
        motion = follower.follow(asked, inf, limit, dt)
        if legal and follower.has_caught_up(asked, limit, dt):
            follower.join(asked)
            return setpoint
        return motion.setpoint_like(setpoint)

    def _is_near(self, asked: Setpoint, position: Vec3, velocity: Vec3, dt: float) -> bool:
        """Return whether the motion of the last tick can continue with this position and velocity
        without exceeding the limit."""
        before, most = self._follower, self.params.acceleration * _SLACK * dt
        if distance(velocity, before.velocity) > most + 1e-9:
            return False
        if asked.kind is SetpointKind.VELOCITY:
            return True
        vx, vy, vz = velocity
        ux, uy, uz = before.velocity
        qx, qy, qz = before.position
        half = 0.5 * dt
        mean = (qx + half * (vx + ux), qy + half * (vy + uy), qz + half * (vz + uz))
        return distance(position, mean) <= 0.25 * most * dt + 1e-9
