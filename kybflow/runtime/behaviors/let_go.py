"""Fly back from a surface of an object, straight out of it, and stop.

The vehicle keeps its heading. Where the surface hasn't been seen, it flies back from where it is
headed, since a vehicle that pushes faces what it pushes. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, hypot, sin

from kybflow.core.geometry import Vec3, add
from kybflow.core.signals import Done, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Length, Speed
from kybflow.flight.motion import Coast, Straight
from kybflow.parts import AIR, Behavior, Entry, Objection, param, params
from kybflow.runtime.behaviors import _surface
from kybflow.world.vehicle_context import VehicleContext


@params
class LetGoParams:
    surface: str = _surface.surface_param()
    distance: Length = param("How far it flies back.", default=0.4, above=0.0, read_only=True)
    speed: Speed = param("Largest speed.", default=0.25, above=0.0, read_only=True)
    acceleration: Acceleration = param(
        "Largest acceleration.", default=0.5, above=0.0, read_only=True
    )


class LetGo(Behavior[LetGoParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: LetGoParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._context, self._heading = entry.context, entry.heading
        self._coast = Coast.after(entry.motion)
        self._way: Straight | None = None

    def update(self, tick: Tick) -> Setpoint | Done:
        way, time = self._way, tick.elapsed
        if way is None:
            p = self.params
            goal = add(self._coast.end, self._back(tick))
            way = self._way = Straight(self._coast.end, goal, p.speed, p.acceleration)
        motion = way.at(time)
        if time < self._coast.duration:
            motion = motion.plus(self._coast.shift(time))
        setpoint = motion.setpoint(self._heading)
        return Done(setpoint) if time >= max(way.duration, self._coast.duration) else setpoint

    def _back(self, tick: Tick) -> Vec3:
        """Return the way back."""
        face, _ = _surface.look(self.params.surface, self._context, tick)
        x, y = -cos(self._heading), -sin(self._heading)
        if face is not None:
            x, y, _ = face.outward
        far = self.params.distance / hypot(x, y)
        return (far * x, far * y, 0.0)

    @classmethod
    def objections(cls, params: LetGoParams, context: VehicleContext) -> Iterator[Objection]:
        yield from _surface.objections(params.surface, context)
