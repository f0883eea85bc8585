"""Fly in front of a surface of an object, and touch it gently.

The vehicle flies to `distance` in front of the surface's middle and turns towards it. From there it
approaches at `speed`, slower and slower, down to `touch_speed`; if the surface moves, it follows.
It is done when it touches (`kybflow.flight.manipulation.contact`): it then presses as hard as its
velocity loop does at `touch_speed`. `push` goes on from there.

It needs an object that motion capture sees and an airframe with a `bumper`. It refuses to start
behind the surface. Fails if the object isn't seen for 0.2 s, and if it doesn't touch it within
`patience` after the planned end. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2

from kybflow.core.geometry import Vec3, add, scale, sub
from kybflow.core.signals import Done, Failed, Setpoint, SetpointKind, Tick
from kybflow.core.units import Acceleration, Duration, Length, Speed
from kybflow.flight.manipulation.contact import TouchSense
from kybflow.flight.motion import Coast, Straight, Turn
from kybflow.parts import AIR, Behavior, Entry, Objection, param, params
from kybflow.runtime.behaviors import _surface
from kybflow.world.objects import Face
from kybflow.world.vehicle_context import VehicleContext

_SLOWING = 1.0
"""The speed above `touch_speed`, per distance from the surface, 1/s."""
_TURN_RATE = 1.0


@params
class ApproachContactParams:
    surface: str = _surface.surface_param()
    distance: Length = param(
        "Distance of the bumper from the surface from which it approaches.",
        default=0.3, above=0.05, read_only=True,
    )  # fmt: skip
    speed: Speed = param("Largest speed.", default=0.25, above=0.0, read_only=True)
    touch_speed: Speed = param(
        "Speed at which it touches the surface.", default=0.06, above=0.02, at_most=0.2
    )
    acceleration: Acceleration = param(
        "Largest acceleration.", default=0.5, above=0.0, read_only=True
    )
    patience: Duration = param(
        "Time past the planned end after which the behavior fails.", default=5.0, above=0.0
    )


class _Way:
    """The way to the front of a surface. begins: when the approach begins, s."""

    def __init__(
        self, coast: Coast, heading: float, goal: Vec3, face: Face, p: ApproachContactParams
    ) -> None:
        x, y, _ = face.outward
        self._coast = coast
        self._line = Straight(coast.end, goal, p.speed, p.acceleration)
        self._turn = Turn(heading, atan2(-y, -x), _TURN_RATE)
        self.begins = max(coast.duration, self._line.duration, self._turn.duration)

    def at(self, time: float, position: Vec3) -> Setpoint:
        """Return the setpoint of a vehicle at `position`."""
        motion = self._line.at(time)
        if time < self._coast.duration:
            motion = motion.plus(self._coast.shift(time))
        wanted = motion.setpoint(*self._turn.at(time))
        back = scale(sub(motion.position, position), _surface.BACK_RATE)
        return wanted._replace(
            kind=SetpointKind.VELOCITY, position=None, velocity=add(motion.velocity, back)
        )


class ApproachContact(
    Behavior[ApproachContactParams], flight=AIR >> AIR, emits=SetpointKind.VELOCITY
):
    def __init__(self, params: ApproachContactParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._context, self._heading = entry.context, entry.heading
        self._touch = TouchSense(entry.context.airframe.bumper or 0.0)
        self._coast = Coast.after(entry.motion)
        self._way: _Way | None = None

    def update(self, tick: Tick) -> Setpoint | Done | Failed:
        p, time, here = self.params, tick.elapsed, tick.known().position
        face, trouble = _surface.look(p.surface, self._context, tick)
        if face is None or trouble:
            stop = self._coast.at(time).setpoint(self._heading)
            return Failed(stop._replace(kind=SetpointKind.VELOCITY, position=None), trouble)
        way = self._way
        if way is None:
            if self._touch.gap(face, here) < 0.0:
                reason = f"the vehicle is not in front of `{p.surface}`"
                return Failed(_surface.facing(face, here, self._context, 0.0, 0.0), reason)
            goal = _surface.front(face, p.distance, self._context)
            way = self._way = _Way(self._coast, self._heading, goal, face, p)
        if time < way.begins:
            return way.at(time, here)
        gap, approaching = self._touch.gap(face, here), time - way.begins
        slow = p.touch_speed + _SLOWING * max(0.0, gap)
        speed = min(p.speed, slow, max(p.touch_speed, p.acceleration * approaching))
        setpoint = _surface.facing(face, here, self._context, speed, 0.0)
        if self._touch.update(face, tick.known(), tick.dt):
            return Done(setpoint)
        if approaching > p.distance / p.touch_speed + p.patience:
            return Failed(setpoint, f"`{p.surface}` is not touched, but {gap:.3f} m away")
        return setpoint

    @classmethod
    def objections(
        cls, params: ApproachContactParams, context: VehicleContext
    ) -> Iterator[Objection]:
        yield from _surface.objections(params.surface, context)
