"""Follow another vehicle at an offset, in its frame or the world's.

The goal is p + R o. p is the other vehicle's setpoint while that vehicle is within 0.3 m of it,
otherwise its estimate, as it publishes them, extrapolated to now; R turns the offset o by the other
vehicle's heading, and is the identity with `frame: world`. The setpoint follows the goal within
`speed` and `acceleration` (`kybflow.flight.governor`), and moves like the goal once it has caught
up.

While the other vehicle is silent for longer than `freshness`, or has no estimate, this one brakes
and waits; it fails after `patience`. To simulate a radio, received messages are at least `delay`
old. Refuses to follow itself. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from kybflow.core.errors import Refused
from kybflow.core.geometry import Vec3, add, norm, scale, wrap
from kybflow.core.signals import Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Duration, Length, Position, Speed
from kybflow.flight.formation.places import turned_by
from kybflow.flight.governor import Follower
from kybflow.flight.motion import Motion
from kybflow.parts import AIR, Behavior, Entry, Footprint, Objection, param, params
from kybflow.runtime.behaviors._leader import Leader, Leading
from kybflow.world.vehicle_context import VehicleContext

_TURN_RATE = 1.0


@params
class FollowParams:
    vehicle: str = param("The vehicle that is followed.", names="vehicle", read_only=True)
    offset: Position = param(
        "Position relative to the leader: forward, to the left, up.", default=(-1.0, 0.0, 0.0)
    )
    frame: Literal["heading", "world"] = param(
        "Whether the offset and the vehicle turn with the leader's heading, or the offset points "
        "east, north and up.",
        default="heading", read_only=True,
    )  # fmt: skip
    speed: Speed = param("Largest speed.", default=0.8, above=0.0)
    acceleration: Acceleration = param("Largest acceleration.", default=1.0, above=0.0)
    clearance: Length = param(
        "Smallest allowed distance between the centres of the two vehicles.",
        default=0.6, above=0.0,
    )  # fmt: skip
    delay: Duration = param(
        "Smallest age of the leader's messages, to simulate a radio.",
        default=0.0, at_least=0.0, below=0.4, limited_by="freshness",
    )  # fmt: skip
    freshness: Duration = param(
        "Age of the newest message above which the leader counts as silent.",
        default=0.3,
        above=0.0,
        at_most=5.0,
    )
    patience: Duration = param(
        "Time to wait for a silent leader, after which the behavior fails.",
        default=2.0,
        at_least=0.0,
    )


class Follow(Behavior[FollowParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    hears = True

    def __init__(self, params: FollowParams, entry: Entry) -> None:
        super().__init__(params, entry)
        if params.vehicle == entry.context.vehicle:
            raise Refused("a vehicle can't follow itself")
        self._leader = Leader(params.vehicle)
        self._heading, self._rate = entry.heading, 0.0
        self._speed = entry.cruise_speed(params.speed)
        self._follower = Follower(entry.context.airframe)
        self._follower.join(entry.motion)
        self._stop: Vec3 | None = None

    def update(self, tick: Tick) -> Setpoint | Failed:
        p, follower = self.params, self._follower
        leading = self._leader.heard(tick, p.delay, p.freshness)
        if leading is None:
            if self._stop is None:  # where the setpoint comes to rest if it brakes now
                x, v = follower.ahead()
                self._stop = add(x, scale(v, norm(v) / p.acceleration))
            goal, self._rate = Motion(self._stop), 0.0
        else:
            self._stop, goal, self._rate = None, self._goal_at(leading), 0.0
            if p.frame == "heading":
                off = wrap(leading.heading - self._heading)
                self._rate = max(-_TURN_RATE, min(_TURN_RATE, leading.rate + 2.0 * off))
                self._heading = wrap(self._heading + self._rate * tick.dt)
        self.waits_for = (
            None if leading is not None else f"a message, because {self._leader.trouble}"
        )
        motion = follower.follow(goal, self._speed, p.acceleration, tick.dt)
        if follower.has_caught_up(goal, p.acceleration, tick.dt):
            follower.join(goal)
            motion = goal
        setpoint = motion.setpoint(self._heading, self._rate)
        if self._leader.lost > p.patience:
            return Failed(setpoint, self._leader.trouble)
        return setpoint

    def _goal_at(self, leading: Leading) -> Motion:
        p = self.params
        if p.frame == "world":
            place = add(leading.position, p.offset)
            return Motion(place, leading.velocity, leading.acceleration)
        w = leading.rate
        x, y, z = turned_by(leading.heading, p.offset)
        return Motion(
            add(leading.position, (x, y, z)),
            add(leading.velocity, (-w * y, w * x, 0.0)),
            add(leading.acceleration, (-w * w * x, -w * w * y, 0.0)),
        )

    @classmethod
    def objections(cls, params: FollowParams, context: VehicleContext) -> Iterator[Objection]:
        if params.vehicle == context.vehicle:
            yield Objection("vehicle", "is the vehicle itself", "name another")
        elif norm(params.offset) < params.clearance:
            reason = f"is {norm(params.offset):.3g} m, closer than `clearance`"
            yield Objection(
                "offset", reason, f"write at least {params.clearance:.3g} m, or less `clearance`"
            )
        unheard, apart = params.speed * params.freshness, norm(params.offset)
        if unheard > apart > 0.0:
            reason = f"allows a silent leader to move {unheard:.3g} m, and it is {apart:.3g} m away"
            hint = f"write {apart / params.speed:.2g} s at most"
            yield Objection("freshness", reason, hint, is_doubt=True)

    @classmethod
    def footprint(cls, params: FollowParams, entry: Vec3 | None) -> Footprint | None:
        points = () if entry is None else (entry,)
        return Footprint(
            points, params.speed, None, is_endless=True, acceleration=params.acceleration
        )
