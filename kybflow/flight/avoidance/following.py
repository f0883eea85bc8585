"""Keeps the setpoints of a vehicle clear of hazards, by `kybflow.flight.avoidance.barrier`.

Setpoints are pursued by a smooth reference (`kybflow.flight.governor`), with the acceleration that
the barriers allow for its position and velocity ahead. The position is the reference's, or the
estimate if that is nearer to something by more than a slack; for setpoints of velocity and
acceleration it is the one ahead of the estimate, and for those of acceleration so is the velocity.
A setpoint that no barrier changes passes bit for bit. World frame.
"""

from __future__ import annotations

from math import cos, inf, sin
from typing import NamedTuple

from kybflow.core.events import Emitting, ProcessorEvent
from kybflow.core.geometry import Vec3, add, dot, norm, scale, sub
from kybflow.core.signals import NEVER, NS, Setpoint, SetpointKind, Tick, Time
from kybflow.flight.avoidance.barrier import (
    Demand,
    braked,
    braking_of,
    demand,
    filtered,
    least_bad,
    reach_of,
    stopped,
    strongest_of,
)
from kybflow.flight.avoidance.clearance import bounded, walls
from kybflow.flight.avoidance.surroundings import Nearby, SecondPoint
from kybflow.flight.governor import Follower, led, shortened
from kybflow.flight.motion import Motion, motion_of
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import Airframe

_TURNING_RATE, _RETURNING_RATE, _MAX_ANGLE = 1.5, 0.5, 1.9
"""Rates at which the angle grows and shrinks, rad/s, and the largest angle, rad."""
_BLOCKED_SPEED = 0.05
"""The least wanted speed that counts as blocked, m/s."""
_FENCE_GAP = 0.3
"""Distance of a detour from the fence, m."""
_BLOCKING_PUSH = 1.0
"""Something ahead blocks the way if it allows less acceleration than this towards it, m/s^2."""


class Detour:
    """Turns the velocity of a blocked vehicle to the right, so that vehicles that meet head on pass
    each other, and vehicles that meet at one point go round it in the same direction.

    The angle grows by `_TURNING_RATE` while the vehicle makes less than half of the wanted speed
    towards its goal because of something ahead; otherwise it shrinks. A detour stays at least 30 cm
    inside the fence."""

    def __init__(self, fence: Box | None) -> None:
        self._angle = 0.0
        self._room = None if fence is None else fence.grown((-_FENCE_GAP, -_FENCE_GAP, 0.0))

    def turned(
        self, goal: Vec3, place: Vec3, velocity: Vec3, demands: list[Demand], dt: float
    ) -> Vec3:
        """Return the velocity to pursue instead of `goal` (m/s, world frame). place, velocity: the
        vehicle's position and velocity."""
        length = norm(goal)
        blocked = (
            length > _BLOCKED_SPEED
            and dot(goal, velocity) < 0.5 * length * length
            and any(
                dot(d.normal, goal) < -0.3 * length and d.least > -_BLOCKING_PUSH for d in demands
            )
        )
        change = _TURNING_RATE * dt if blocked else -_RETURNING_RATE * dt
        self._angle = min(max(self._angle + change, 0.0), _MAX_ANGLE)
        if self._angle == 0.0:
            return goal
        c, s = cos(self._angle), sin(self._angle)
        x, y, z = goal
        turned = (c * x + s * y, c * y - s * x, z)
        return turned if self._room is None else bounded(turned, walls(place, self._room))


_POSITION, _ACCELERATION = SetpointKind.POSITION, SetpointKind.ACCELERATION
ACCEPTS = {kind: kind for kind in (_POSITION, SetpointKind.VELOCITY, _ACCELERATION)}
"""The kinds of setpoint that it changes, each with the kind that results, which is the same."""
_NEAR_STEP, _FAR_STEP = 1e-3, 0.05
"""The largest step in position, beyond the velocity's, that passes if something is near, and if
nothing is, m."""


_BLOCKED_TIME_S = 0.05
"""Seconds without a way after which it is reported: among many vehicles, one tick may have none."""


class AvoidanceBlocked(ProcessorEvent):
    """The vehicle has no safe path left and brakes."""

    reason: str


class Keeping(NamedTuple):
    """keep: the distance between hulls that setpoints keep, metres. slack: by how much less the
    vehicle itself may keep, metres. braking: the planned deceleration, m/s^2. speed: the largest
    speed with which the vehicle catches up, m/s."""

    keep: float
    slack: float
    braking: float
    speed: float


class Avoidance:
    """The barriers of one vehicle.

    nearby: finds the obstacles and vehicles to keep away from. detour: leads the vehicle around
    what blocks its way; None to stop there.
    """

    def __init__(self, airframe: Airframe, nearby: Nearby, detour: Detour | None = None) -> None:
        self._gets_stuck, self._blocked_time = False, 0.0
        self._stuck: Time = -NEVER
        self._nearby, self._hull, self._detour = nearby, airframe.hull, detour
        self._strongest = strongest_of(airframe)
        self._follower = Follower(airframe)

    def bend(self, setpoint: Setpoint, tick: Tick, keeping: Keeping) -> Setpoint | Emitting:
        """Return the setpoint to follow. When the vehicle begins to brake because it has no way
        left, return it in an Emitting with the event."""
        self._gets_stuck = False
        given = self.keep_off(setpoint, tick, keeping)
        if not self._gets_stuck:
            return given
        reason = "obstacles leave no safe acceleration: it brakes"
        return Emitting(given, AvoidanceBlocked(reason=reason))

    def keep_off(self, setpoint: Setpoint, tick: Tick, keeping: Keeping) -> Setpoint:
        """Return the setpoint to follow, clear of hazards."""
        follower, kind = self._follower, setpoint.kind
        lag = follower.lag
        follower.resume(setpoint, tick)
        known = tick.known()
        if kind is not _POSITION:
            follower.position = known.position
        if kind is _ACCELERATION:
            follower.velocity = known.velocity
        place, velocity = follower.ahead()
        keep, strongest = keeping.keep + self._hull, self._strongest
        braking = braking_of(keeping.braking, strongest)
        second = SecondPoint(known.position, keeping.slack) if kind is _POSITION else None
        near = self._nearby.near(
            place, norm(velocity), tick, lambda v: keep + reach_of(v, braking, strongest), second
        )
        # what moves is compared where it will be when the setpoint is at `place`
        there = (h._replace(room=h.room - lag * dot(h.outward, h.velocity)) for h in near)
        demands = [demand(h, keep, velocity, braking, strongest) for h in there]
        return self._followed(setpoint, demands, keeping, tick)

    def _allowed(
        self, wanted: Vec3, velocity: Vec3, demands: list[Demand], strongest: float, tick: Tick
    ) -> Vec3:
        """Return the acceleration nearest to `wanted` that the barriers allow; if there is none,
        brake as well as possible."""
        if self._detour is None:
            given = stopped(wanted, velocity, demands, strongest, tick.dt)
        else:
            given = filtered(wanted, demands, strongest)
        if given is not None:
            return given
        before = self._blocked_time if tick.now - self._stuck <= NS else 0.0
        self._blocked_time = before + tick.dt
        self._gets_stuck = before < _BLOCKED_TIME_S <= self._blocked_time
        self._stuck = tick.now
        slowing = braked(velocity, strongest, tick.dt)
        least = least_bad(slowing, demands, strongest)
        return slowing if least is None else least

    def _followed(
        self, setpoint: Setpoint, demands: list[Demand], keeping: Keeping, tick: Tick
    ) -> Setpoint:
        follower, asked, dt, kind = self._follower, motion_of(setpoint), tick.dt, setpoint.kind
        if not follower.behind and self._passes(kind, asked, demands, dt):
            follower.join(asked)
            return setpoint
        most = self._strongest
        place, velocity = follower.ahead()
        if kind is _ACCELERATION:
            wanted = led(asked.acceleration, asked.jerk, follower.lag)
        else:
            speed = keeping.speed if kind is _POSITION else inf
            goal = follower.pursuit(asked, speed, keeping.braking, dt)
            if self._detour is not None:
                goal = self._detour.turned(goal, place, velocity, demands, dt)
            wanted = shortened(follower.change_to(goal, dt), most)
        given = self._allowed(wanted, velocity, demands, most, tick)
        motion = follower.advance(given, dt)
        if given == wanted and follower.has_caught_up(asked, keeping.braking, dt):
            follower.join(asked)
            return setpoint
        return motion.setpoint_like(setpoint)

    def _passes(self, kind: SetpointKind, asked: Motion, demands: list[Demand], dt: float) -> bool:
        """Return whether a setpoint continues the last one and the barriers allow it."""
        before = self._follower
        if kind is _ACCELERATION:
            change = led(asked.acceleration, asked.jerk, before.lag)
        else:
            change = before.change_to(led(asked.velocity, asked.acceleration, before.lag), dt)
        if kind is _POSITION:
            mean = scale(add(asked.velocity, before.velocity), 0.5 * dt)
            jump = norm(sub(sub(asked.position, before.position), mean))
            if jump > (_NEAR_STEP if demands else _FAR_STEP):
                return False
        return all(d.holds(change) for d in demands)
