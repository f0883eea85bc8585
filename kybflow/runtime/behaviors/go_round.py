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

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import atan2

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, AngularRate, Duration, Length, Speed
from kybflow.flight.manipulation.way_round import way_round
from kybflow.flight.motion import Coast, Motion, Straight, Turn
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


class GoRound(Behavior[GoRoundParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: GoRoundParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._entry = entry
        self._coast = Coast.after(entry.motion)
        self._planned: tuple[_Way, Turn] | None = None

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        if self._planned is None:
            face, trouble = _surface.look(self.params.surface, self._entry.context, tick)
            through = None if face is None or trouble else self._corners(face, tick)
            if face is None or through is None:
                stop = self._coast.at(tick.elapsed).setpoint(self._entry.heading)
                return Failed(stop, trouble or "the fence leaves no way round the object")
            self._planned = self._plan(through, face)
        return self._fly(tick, *self._planned)

    def _corners(self, face: Face, tick: Tick) -> tuple[Vec3, ...] | None:
        """Return the corners of the way to the front of the surface, None without a way."""
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

    def _plan(self, through: tuple[Vec3, ...], face: Face) -> tuple[_Way, Turn]:
        p, (x, y, _), entry = self.params, face.outward, self._entry
        way = _Way(self._coast.end, through, entry.cruise_speed(p.speed), p.acceleration)
        return way, Turn(entry.heading, atan2(-y, -x), p.turn_rate)

    def _fly(self, tick: Tick, way: _Way, turn: Turn) -> Setpoint | Done | Failed:
        time = tick.elapsed
        setpoint = self._coast.added(way.at(time).setpoint(*turn.at(time)), time)
        over = time - max(way.duration, self._coast.duration, turn.duration)
        gap = distance(tick.known().position, way.end)
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
