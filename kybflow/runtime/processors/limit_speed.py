"""Keep the speed of the setpoint under a limit; lag behind it at higher speeds.

A trajectory within the limit passes unchanged, bit for bit. One that accelerates towards the limit
is bent shortly before, and may exceed it by 2 % while its acceleration ends. One that is faster, or
that jumps, is followed by a reference governor (`kybflow.flight.governor`) that moves with at most
`speed`, accelerates smoothly and with at most `catch_up`, and catches up without overshoot. A
velocity setpoint that is too fast is followed, in the same way, by its direction with `speed`.
World frame.
"""

from __future__ import annotations

from math import hypot
from typing import ClassVar

from kybflow.core.geometry import ZERO, distance
from kybflow.core.signals import Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Speed
from kybflow.flight.governor import Follower, led
from kybflow.flight.motion import motion_of
from kybflow.parts import Processor, param, params
from kybflow.world.vehicle_context import VehicleContext

_SLACK, _EXCESS = 1.0 + 1e-6, 1.02
"""Factors on the limit: for rounding, and for a setpoint that is still accelerating."""
_VELOCITY = SetpointKind.VELOCITY


@params
class LimitSpeedParams:
    speed: Speed = param("Largest speed of the setpoint.", default=1.0, above=0.0)
    catch_up: Acceleration = param(
        "Largest acceleration of the setpoint while it catches up.", default=2.0, above=0.0
    )


class LimitSpeed(Processor[LimitSpeedParams]):
    slows = True
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        SetpointKind.POSITION: SetpointKind.POSITION,
        SetpointKind.VELOCITY: SetpointKind.VELOCITY,
    }

    def __init__(self, params: LimitSpeedParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._follower = Follower(context.airframe)

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        kind, position, velocity, acceleration, *_ = setpoint
        position, velocity = position or ZERO, velocity or ZERO
        follower, most = self._follower, self.params.speed * _SLACK
        follower.resume(setpoint, tick)
        speed = hypot(*velocity)
        legal = speed <= most and (
            speed < 0.5 * most  # as nearly always; too slow to be too fast ahead
            or hypot(*led(velocity, acceleration or ZERO, follower.lag)) <= most * _EXCESS
        )
        if legal and not follower.behind:
            near = kind is _VELOCITY or (
                distance(position, follower.position) <= most * tick.dt + 1e-9
            )
            if near:
                follower.position, follower.velocity = position, velocity
                follower.acceleration = acceleration or ZERO
                return setpoint
        p, asked, dt = self.params, motion_of(setpoint), tick.dt
        motion = follower.follow(asked, p.speed, p.catch_up, dt)
        if legal and follower.has_caught_up(asked, p.catch_up, dt):
            follower.join(asked)
            return setpoint
        return motion.setpoint_like(setpoint)
