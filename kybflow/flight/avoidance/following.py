"""Keeps the setpoints of a vehicle clear of hazards, by `kybflow.flight.avoidance.barrier`.

Position setpoints are pursued by a reference, a position q and a velocity u
(`kybflow.flight.governor`), with the acceleration that the barriers allow. Distances count from q,
or from the estimate if that is nearer by more than a slack. For a velocity setpoint, the barriers
bound its change from what the tracker followed; for an acceleration setpoint, they bound the
acceleration itself. For both, distances count from the estimate. A setpoint that no barrier changes
passes bit for bit. World frame.
"""

from __future__ import annotations

from math import cos, sin, tan
from typing import NamedTuple

from kybflow.core.events import Emitting, ProcessorEvent
from kybflow.core.geometry import GRAVITY, ZERO, Vec3, add, dot, norm, scale, sub
from kybflow.core.signals import NEVER, NS, Setpoint, SetpointKind, Tick, Time
from kybflow.flight.avoidance.barrier import (
    Demand,
    braked,
    demand,
    filtered,
    least_bad,
    reach_of,
    stopped,
)
from kybflow.flight.avoidance.clearance import bounded, walls
from kybflow.flight.avoidance.surroundings import Nearby, SecondPoint
from kybflow.flight.governor import Follower, shortened
from kybflow.flight.motion import motion_of
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


_POSITION, _VELOCITY = SetpointKind.POSITION, SetpointKind.VELOCITY
ACCEPTS = {kind: kind for kind in (_POSITION, _VELOCITY, SetpointKind.ACCELERATION)}
"""The kinds of setpoint that it changes, each with the kind that results, which is the same."""
_MAX_ACCELERATION, _TILT_SHARE, _PLANNED_SHARE = 3.0, 0.8, 0.8
"""The largest acceleration, m/s^2; the largest share of the acceleration that the airframe's tilt
allows; and the share of the smaller of these with which braking is planned."""
_NEAR_STEP, _FAR_STEP = 1e-3, 0.05
"""The largest step in position, beyond the velocity's, that passes if something is near, and if
nothing is, m."""


class AvoidanceBlocked(ProcessorEvent):
    """The vehicle has no way left and brakes."""

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

    nearby: finds what the vehicle keeps away from. detour: leads the vehicle around what blocks its
    way; None to stop there.
    """

    def __init__(self, airframe: Airframe, nearby: Nearby, detour: Detour | None = None) -> None:
        self._gets_stuck = False
        self._stuck: Time = -NEVER
        self._nearby, self._hull, self._detour = nearby, airframe.hull, detour
        self._strongest = min(_MAX_ACCELERATION, _TILT_SHARE * GRAVITY * tan(airframe.tilt))
        self._follower = Follower()

    def bend(self, setpoint: Setpoint, tick: Tick, keeping: Keeping) -> Setpoint | Emitting:
        """Return the setpoint to follow. When the vehicle begins to brake because it has no way
        left, return it in an Emitting with the event."""
        self._gets_stuck = False
        given = self.keep_off(setpoint, tick, keeping)
        if not self._gets_stuck:
            return given
        reason = "what is near leaves no way: it brakes, and gives way"
        return Emitting(given, AvoidanceBlocked(reason=reason))

    def keep_off(self, setpoint: Setpoint, tick: Tick, keeping: Keeping) -> Setpoint:
        """Return the setpoint to follow, clear of hazards."""
        follower, kind = self._follower, setpoint.kind
        follower.resume(setpoint, tick)
        known = tick.known()
        if kind is _POSITION:
            place, velocity = follower.position, follower.velocity
        elif kind is _VELOCITY:
            place, velocity = known.position, follower.velocity
        else:
            place, velocity = known.position, known.velocity
        keep, strongest = keeping.keep + self._hull, self._strongest
        braking = min(keeping.braking, _PLANNED_SHARE * strongest)
        second = SecondPoint(known.position, keeping.slack) if kind is _POSITION else None
        near = self._nearby.near(
            place, norm(velocity), tick, lambda v: keep + reach_of(v, braking, strongest), second
        )
        demands = [demand(h, keep, velocity, braking, strongest) for h in near]
        if kind is _POSITION:
            return self._followed(setpoint, demands, keeping, strongest, tick)
        if kind is _VELOCITY:
            return self._slewed(setpoint, demands, strongest, tick)
        wanted = setpoint.acceleration or ZERO
        given = self._allowed(wanted, known.velocity, demands, strongest, tick)
        return setpoint if given == wanted else setpoint._replace(acceleration=given, jerk=None)

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
        self._gets_stuck = tick.now - self._stuck > NS
        self._stuck = tick.now
        slowing = braked(velocity, strongest, tick.dt)
        least = least_bad(slowing, demands, strongest)
        return slowing if least is None else least

    def _followed(
        self, setpoint: Setpoint, demands: list[Demand], keeping: Keeping, most: float, tick: Tick
    ) -> Setpoint:
        follower, asked, dt = self._follower, motion_of(setpoint), tick.dt
        if not follower.behind and self._passes(setpoint, demands, dt):
            follower.join(asked.position, asked.velocity)
            return setpoint
        goal = follower.pursuit(asked, keeping.speed, keeping.braking, dt)
        if self._detour is not None:
            goal = self._detour.turned(goal, follower.position, follower.velocity, demands, dt)
        wanted = scale(shortened(sub(goal, follower.velocity), most * dt), 1.0 / dt)
        given = self._allowed(wanted, follower.velocity, demands, most, tick)
        if given == wanted and follower.has_caught_up(asked, keeping.braking, dt):
            follower.join(asked.position, asked.velocity)
            return setpoint
        return follower.advance(scale(given, dt), dt).setpoint_like(setpoint)

    def _passes(self, setpoint: Setpoint, demands: list[Demand], dt: float) -> bool:
        """Return whether a setpoint continues the last one and the barriers allow it."""
        before, velocity = self._follower, setpoint.velocity or ZERO
        mean = scale(add(velocity, before.velocity), 0.5 * dt)
        jump = norm(sub(sub(setpoint.position or ZERO, before.position), mean))
        change = scale(sub(velocity, before.velocity), 1.0 / dt)
        return jump <= (_NEAR_STEP if demands else _FAR_STEP) and all(
            d.holds(change) for d in demands
        )

    def _slewed(
        self, setpoint: Setpoint, demands: list[Demand], most: float, tick: Tick
    ) -> Setpoint:
        dt = tick.dt
        before, asked = self._follower.velocity, setpoint.velocity or ZERO
        goal = asked
        if self._detour is not None and demands:
            goal = self._detour.turned(asked, tick.known().position, before, demands, dt)
        wanted = scale(sub(goal, before), 1.0 / dt)
        given = self._allowed(wanted, before, demands, most, tick)
        if goal == asked and given == wanted:
            self._follower.join(ZERO, asked)
            return setpoint
        velocity = add(before, scale(given, dt))
        self._follower.join(ZERO, velocity)
        return setpoint._replace(velocity=velocity, acceleration=given, jerk=None)
