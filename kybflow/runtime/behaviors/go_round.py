"""Fly around an object to the front of one of its surfaces.

The way is planned when the behavior begins, from where the object and everything that it is joined
with are seen: it goes around all of them, left or right, whichever is shorter and inside the fence
(`kybflow.flight.manipulation.way_round`), at the height of the surface, in straight legs. The
vehicle stops at each corner and turns towards the surface on the way. It is done at `distance` in
front of the surface; `approach_contact` goes on from there. Let go of a surface before.

To also keep away from other vehicles and obstacles, the vehicle needs the processor
`avoid_obstacles`. Fails if the object isn't seen, or if the fence leaves no way. World frame,
metres.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, AngularRate, Duration, Length, Speed
from kybflow.flight.manipulation.way_round import way_round
from kybflow.flight.motion import Coast, Straight, Turn
from kybflow.parts import AIR, Behavior, Entry, Objection, param, params
from kybflow.runtime.behaviors import _surface
from kybflow.world.objects import Face, base_of, corners, place_of
from kybflow.world.vehicle_context import VehicleContext

_ARRIVED = 0.05
"""Distance from the last point that counts as there, m."""


@params
class GoRoundParams:
    surface: str = _surface.surface_param()
    distance: Length = param(
        "Distance of the bumper from the surface at the end.", default=0.4, above=0.05,
        read_only=True,
    )  # fmt: skip
    keep: Length = param(
        "Distance between the bumper and the objects on the way.", default=0.25, above=0.0,
        read_only=True,
    )  # fmt: skip
    speed: Speed = param("Largest speed.", default=0.5, above=0.0, read_only=True)
    acceleration: Acceleration = param(
        "Largest acceleration.", default=0.5, above=0.0, read_only=True
    )
    turn_rate: AngularRate = param(
        "Largest rate of turning.", default=1.0, above=0.0, read_only=True
    )
    patience: Duration = param(
        "Time past the planned end after which the behavior fails.", default=5.0, above=0.0
    )


class GoRound(Behavior[GoRoundParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: GoRoundParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._entry = entry
        self._coast = Coast.after(entry.motion)
        self._legs: list[Straight] | None = None
        self._turn = Turn(entry.heading, None, params.turn_rate)
        self._left = 0.0

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        if self._legs is None:
            face, trouble = _surface.look(self.params.surface, self._entry.context, tick)
            way = None if face is None or trouble else self._way(face, tick)
            if way is None or face is None:
                stop = self._coast.at(tick.elapsed).setpoint(self._entry.heading)
                return Failed(stop, trouble or "the fence leaves no way round the object")
            self._begin(way, face)
        return self._fly(tick)

    def _way(self, face: Face, tick: Tick) -> tuple[Vec3, ...] | None:
        """Return the way to the front of the surface."""
        p, context = self.params, self._entry.context
        objects, reach = context.objects, context.airframe.bumper or context.airframe.hull
        base = base_of(objects, p.surface.partition(".")[0])
        joined = [one for name, one in objects.items() if base_of(objects, name) == base]
        points = [
            corner
            for one in joined
            for corner in corners(one, place_of(objects, tick.objects, one.name))
        ]
        goal = _surface.front(face, p.distance, context)
        return way_round(points, reach + p.keep, self._coast.end, goal, context.fence)

    def _begin(self, way: tuple[Vec3, ...], face: Face) -> None:
        p, (x, y, _) = self.params, face.outward
        speed, start = self._entry.cruise_speed(p.speed), self._coast.end
        self._legs = []
        for corner in way:
            self._legs.append(Straight(start, corner, speed, p.acceleration))
            start = corner
        self._turn = Turn(self._entry.heading, atan2(-y, -x), p.turn_rate)
        self._left = max(self._coast.duration, self._turn.duration)
        self._end = start

    def _fly(self, tick: Tick) -> Setpoint | Done | Failed:
        """Return the setpoint on the legs, each of which begins when the one before is over."""
        assert self._legs is not None
        time = tick.elapsed
        since, leg = time, self._legs[0]
        for leg in self._legs:
            if since < leg.duration or leg is self._legs[-1]:
                break
            since -= leg.duration
        motion = leg.at(since)
        if time < self._coast.duration:
            motion = motion.plus(self._coast.shift(time))
        setpoint = motion.setpoint(*self._turn.at(time))
        over = time - max(self._left, sum(one.duration for one in self._legs))
        gap = distance(tick.known().position, self._end)
        if over >= 0.0 and gap < _ARRIVED:
            return Done(setpoint)
        if over > self.params.patience:
            return Failed(setpoint, f"still {gap:.3f} m from `{self.params.surface}`")
        return setpoint

    @classmethod
    def objections(cls, params: GoRoundParams, context: VehicleContext) -> Iterator[Objection]:
        yield from _surface.objections(params.surface, context)

    @classmethod
    def touches(cls, params: GoRoundParams) -> str:
        return ""  # it names a surface, but only goes in front of it
