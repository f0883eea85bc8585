"""Keep the speed of the setpoint under a limit; follow behind where it asks for more.

A trajectory within the limit passes unchanged, bit for bit. One that is faster, or that jumps, is
followed by a reference governor (`kybflow.runtime.governor`) that goes at most `speed`, changes its
velocity by at most `catch_up`, and catches up without overshoot. Setpoints of velocity are
shortened to the limit, their direction kept. World frame.
"""

from __future__ import annotations

from typing import ClassVar

from kybflow.geometry import ZERO, distance, norm
from kybflow.parts import Processor, param, params
from kybflow.runtime.governor import Follower, motion_of, shortened
from kybflow.signals import Setpoint, SetpointKind, Tick
from kybflow.site import Site
from kybflow.units import Acceleration, Speed

_SLACK = 1.0 + 1e-6


@params
class LimitSpeedParams:
    speed: Speed = param("Largest speed of the setpoint.", default=1.0, above=0.0)
    catch_up: Acceleration = param(
        "Largest acceleration of the setpoint while it follows behind.", default=2.0, above=0.0
    )


class LimitSpeed(Processor[LimitSpeedParams]):
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        SetpointKind.POSITION: SetpointKind.POSITION,
        SetpointKind.VELOCITY: SetpointKind.VELOCITY,
    }

    def __init__(self, params: LimitSpeedParams, site: Site) -> None:
        super().__init__(params, site)
        self._follower = Follower()

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        limit = self.params.speed
        if setpoint.kind is SetpointKind.VELOCITY:
            velocity = setpoint.velocity or ZERO
            if norm(velocity) <= limit:
                return setpoint
            shorter = shortened(velocity, limit)
            return setpoint._replace(velocity=shorter, acceleration=ZERO, jerk=None)
        follower, asked, dt = self._follower, motion_of(setpoint), tick.dt
        follower.resume(asked, tick)
        legal = norm(asked.velocity) <= limit * _SLACK
        if not follower.behind:
            step = distance(asked.position, follower.position)
            if legal and step <= limit * dt * _SLACK + 1e-9:
                follower.join(asked)
                return setpoint
        motion = follower.follow(asked, limit, self.params.catch_up, dt)
        if legal and follower.has_caught_up(asked, self.params.catch_up, dt):
            follower.join(asked)
            return setpoint
        return motion.setpoint_like(setpoint)
