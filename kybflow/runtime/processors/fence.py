"""Keep the setpoint inside the mission's fence, shrunk by a margin; fails closed.

A setpoint that stays inside passes unchanged, bit for bit, and so does every setpoint if the
mission has no fence. One that would leave is followed by a smooth reference
(`kybflow.flight.governor`) to the nearest point inside, axis by axis. Towards each face the
reference brakes as `kybflow.flight.avoidance.barrier` says, from positions with 2 m/s^2 and from
velocities, which count from the estimate, with 1 m/s^2. Beyond the face it leads back with at most
0.3 m/s, and a setpoint outside never goes further out. If the margin leaves no room along an axis,
only the middle of the fence counts as inside.

The floor is different, because take-off and landing cross it, and the height of the ground varies:
a position below it is allowed down to 0.5 m below the vehicle, which is enough for every landing.
World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import ClassVar

from kybflow.core.geometry import ZERO, Vec3, add, dot, scale
from kybflow.core.signals import Setpoint, SetpointKind, Tick, Time
from kybflow.core.units import Length
from kybflow.flight.avoidance.barrier import Demand, braking_of, demand, strongest_of
from kybflow.flight.avoidance.clearance import walls
from kybflow.flight.avoidance.surroundings import Hazard
from kybflow.flight.governor import Follower, led, shortened
from kybflow.flight.motion import Motion, motion_of
from kybflow.parts import Objection, Processor, param, params
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import VehicleContext

_FLOOR_ROOM = 0.5
_BRAKING = {SetpointKind.POSITION: 2.0, SetpointKind.VELOCITY: 1.0}
_SIGHT = 1.5
"""Seconds within which a setpoint that keeps its velocity reaches no face that it must brake for
now."""


@params
class FenceProcessorParams:
    margin: Length = param(
        "Distance that the setpoint keeps from the fence.",
        default=0.2,
        at_least=0.0,
        tightens="up",
    )


class FenceProcessor(Processor[FenceProcessorParams]):
    accepts: ClassVar[dict[SetpointKind, SetpointKind]] = {
        SetpointKind.POSITION: SetpointKind.POSITION,
        SetpointKind.VELOCITY: SetpointKind.VELOCITY,
    }
    safety = True
    clamps = True

    def __init__(self, params: FenceProcessorParams, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._fence = context.fence
        self._margin = params.margin
        self._room = _shrunk(context.fence, params.margin) if context.fence is not None else None
        self._follower = Follower(context.airframe)
        self._passed: Setpoint | None = None
        self._passed_at: Time = 0
        self._strongest = strongest_of(context.airframe)

    @classmethod
    def objections(
        cls, params: FenceProcessorParams, context: VehicleContext
    ) -> Iterator[Objection]:
        fence, margin = context.fence, params.margin
        if fence is not None and margin >= 0.5 * (least := min(fence.size)):
            reason = f"leaves no room: a side of the fence is {least:.3g} m long"
            yield Objection("margin", reason, "write `margin: 20 cm`", is_doubt=True)

    @classmethod
    def keeps_inside(cls, params: FenceProcessorParams, fence: Box) -> Box | None:
        return _shrunk(fence, params.margin)

    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint:
        if self._fence is None or self._room is None:
            return setpoint
        if self.params.margin != self._margin:
            self._margin = self.params.margin
            self._room = _shrunk(self._fence, self._margin)
        room, known = self._room, tick.known()
        place = setpoint.position or known.position
        if not self._follower.behind and room.contains(place):
            x, y, z = place
            vx, vy, vz = setpoint.velocity or ZERO
            if room.contains((x + _SIGHT * vx, y + _SIGHT * vy, z + _SIGHT * vz)):
                self._passed, self._passed_at = setpoint, tick.now
                return setpoint
        x, y, floor = room.low
        return self._kept(
            setpoint, tick, Box((x, y, min(floor, known.position[2] - _FLOOR_ROOM)), room.high)
        )

    def _kept(self, setpoint: Setpoint, tick: Tick, room: Box) -> Setpoint:
        """Return the setpoint to follow, inside `room`."""
        follower, asked, dt, kind = self._follower, motion_of(setpoint), tick.dt, setpoint.kind
        follower.resume(setpoint, tick)
        passed, self._passed = self._passed, None
        is_recent = tick.now - self._passed_at <= 1.5e9 * dt and tick.elapsed > 0.0
        if passed is not None and passed.kind is kind and is_recent:
            follower.join(motion_of(passed))  # a later processor may follow behind
        elif tick.setpoint is None or tick.setpoint.position is None:
            follower.position = _inside(Motion(follower.position), room).position
        if kind is SetpointKind.VELOCITY:
            follower.position = tick.known().position
        last = follower.position
        place, velocity = follower.ahead()
        most = self._strongest
        braking = braking_of(_BRAKING[kind], most)
        demands = [
            demand(Hazard("fence", left, inward), 0.0, velocity, braking, most)
            for left, inward in walls(place, room)
        ]
        if kind is SetpointKind.POSITION:
            target = _inside(asked, room)
            leaves = target is not asked
        else:
            target, leaves = asked, False
        change = follower.change_to(led(asked.velocity, asked.acceleration, follower.lag), dt)
        if not (leaves or follower.behind) and all(d.holds(change) for d in demands):
            follower.join(asked)
            return setpoint
        goal = follower.pursuit(target, inf, braking, dt)
        wanted = shortened(follower.change_to(goal, dt), most)
        given = _bounded(wanted, demands)
        motion = follower.advance(given, dt)
        if kind is SetpointKind.POSITION:
            reached = _with(room, last)
            if not reached.contains(motion.position):  # too fast to brake
                motion = _inside(motion, reached)
                follower.join(motion)
                follower.behind = True
        if not leaves and given == wanted and follower.has_caught_up(asked, braking, dt):
            follower.join(asked)
            return setpoint
        return motion.setpoint_like(setpoint)


def _shrunk(fence: Box, margin: float) -> Box:
    """Return the fence shrunk by the margin on every side but the floor."""
    low, high = list(fence.low), list(fence.high)
    for i, below in enumerate((margin, margin, 0.0)):
        low[i], high[i] = low[i] + below, high[i] - margin
        if low[i] > high[i]:
            low[i] = high[i] = 0.5 * (fence.low[i] + fence.high[i])
    return Box(_vector(low), _vector(high))


def _inside(asked: Motion, room: Box) -> Motion:
    """Return the motion, its position moved to the nearest point in `room`; on an axis on which it
    was outside, it is at rest unless it moves inwards. If it was inside, the returned object is the
    argument."""
    if room.contains(asked.position):
        return asked
    position, velocity = list(asked.position), list(asked.velocity)
    acceleration, jerk = list(asked.acceleration), list(asked.jerk)
    for i in range(3):
        inside = min(max(position[i], room.low[i]), room.high[i])
        outward = position[i] - inside
        if outward != 0.0:
            position[i] = inside
            velocity[i] = 0.0 if velocity[i] * outward > 0.0 else velocity[i]
            acceleration[i] = jerk[i] = 0.0
    return Motion(*map(_vector, (position, velocity, acceleration, jerk)))


def _with(room: Box, point: Vec3) -> Box:
    """Return the smallest box around `room` and `point`."""
    low = [min(a, b) for a, b in zip(room.low, point, strict=True)]
    high = [max(a, b) for a, b in zip(room.high, point, strict=True)]
    return Box(_vector(low), _vector(high))


def _bounded(wanted: Vec3, demands: list[Demand]) -> Vec3:
    """Return the acceleration nearest to `wanted` that meets the demands of a box's faces."""
    for normal, least in demands:
        lack = least - dot(normal, wanted)
        if lack > 0.0:
            wanted = add(wanted, scale(normal, lack))
    return wanted


def _vector(numbers: list[float]) -> Vec3:
    return (numbers[0], numbers[1], numbers[2])
