"""Fly around an object to the front of one of its surfaces.

The way is planned from where the object and everything that it is joined with are seen: it goes
around all of them, left or right, whichever is shorter and inside the fence
(`kybflow.flight.manipulation.way_round`), at the height of the surface, in straight legs. The
vehicle stops at each corner and turns towards the surface on the way. If the surface has moved by
10 cm since, the way is planned anew. It is done at `distance` in front of the surface;
`approach_contact` goes on from there. Let go of a surface before.

To also keep away from other vehicles and obstacles, the vehicle needs the processor
`avoid_obstacles`. Fails if the object isn't seen, or if the fence leaves no way. World frame,
metres.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import atan2
from typing import NamedTuple

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, AngularRate, Duration, Length, Speed
from kybflow.flight.manipulation.way_round import way_round
from kybflow.flight.motion import Coast, Motion, Straight, Turn, motion_of
from kybflow.parts import AIR, Behavior, Entry, Objection, param, params
from kybflow.runtime.behaviors import _surface
from kybflow.world.objects import Face, base_of, corners, place_of
from kybflow.world.vehicle_context import VehicleContext

_ARRIVED, _MOVED = 0.05, 0.1
"""Distances from the last point that count as there, and as a surface that has moved, m."""


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


class _Way:
    """Straight legs through points, each from rest to rest. end: the last point. duration: of all
    legs, s."""

    def __init__(self, start: Vec3, through: Sequence[Vec3], speed: float, most: float) -> None:
        self._legs = [Straight(a, b, speed, most) for a, b in pairwise((start, *through))]
        self.end = through[-1]
        self.duration = sum(leg.duration for leg in self._legs)

    def at(self, time: float) -> Motion:
        for leg in self._legs[:-1]:
            if time < leg.duration:
                return leg.at(time)
            time -= leg.duration
        return self._legs[-1].at(time)


class _Plan(NamedTuple):
    """What is flown from `since` on, s: a coast to rest, and from there a way and a turn."""

    since: float
    coast: Coast
    way: _Way
    turn: Turn

    def at(self, time: float) -> Setpoint:
        after = time - self.since
        return self.coast.added(self.way.at(after).setpoint(*self.turn.at(after)), after)

    @property
    def end(self) -> float:
        return self.since + max(self.way.duration, self.coast.duration, self.turn.duration)


class GoRound(Behavior[GoRoundParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: GoRoundParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._entry = entry
        self._plan: _Plan | None = None

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        p, plan = self.params, self._plan
        face, trouble = _surface.look(p.surface, self._entry.context, tick)
        if face is not None and not trouble:
            goal = _surface.front(face, p.distance, self._entry.context)
            if plan is None or distance(goal, plan.way.end) > _MOVED:
                plan = self._plan = self._planned(face, goal, plan, tick)
                trouble = "" if plan else "the fence leaves no way round the object"
        if plan is None:
            motion, heading = self._from(None, tick)
            return Failed(Coast.after(motion).at(0.0).setpoint(heading), trouble)
        setpoint, over = plan.at(tick.elapsed), tick.elapsed - plan.end
        gap = distance(tick.known().position, plan.way.end)
        if over > p.patience:
            trouble = trouble or f"still {gap:.3f} m from `{p.surface}`"
        if trouble:
            return Failed(setpoint, trouble)
        return Done(setpoint) if over >= 0.0 and gap < _ARRIVED else setpoint

    def _planned(self, face: Face, goal: Vec3, last: _Plan | None, tick: Tick) -> _Plan | None:
        """Return the plan to `goal`, in front of the surface; None without a way."""
        p, context, (x, y, _) = self.params, self._entry.context, face.outward
        motion, heading = self._from(last, tick)
        coast = Coast.after(motion)
        objects, reach = context.objects, context.airframe.bumper or context.airframe.hull
        base = base_of(objects, p.surface.partition(".")[0])
        joined = [one for name, one in objects.items() if base_of(objects, name) == base]
        points = [
            corner
            for one in joined
            for corner in corners(one, place_of(objects, tick.objects, one.name))
        ]
        through = way_round(points, reach + p.keep, coast.end, goal, context.fence)
        if through is None:
            return None
        way = _Way(coast.end, through, self._entry.cruise_speed(p.speed), p.acceleration)
        return _Plan(tick.elapsed, coast, way, Turn(heading, atan2(-y, -x), p.turn_rate))

    def _from(self, last: _Plan | None, tick: Tick) -> tuple[Motion, float]:
        """Return the motion and the heading from which a plan begins."""
        followed = tick.setpoint
        if last is None or followed is None:
            return self._entry.motion, self._entry.heading
        return motion_of(followed), last.turn.at(tick.elapsed - last.since)[0]

    @classmethod
    def objections(cls, params: GoRoundParams, context: VehicleContext) -> Iterator[Objection]:
        yield from _surface.objections(params.surface, context)

    @classmethod
    def touches(cls, params: GoRoundParams) -> str:
        return ""  # it names a surface, but only goes in front of it
