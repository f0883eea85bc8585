"""Ideal objects, which move as slowly as they are pushed: without mass, friction or contact forces.

A vehicle whose setpoint `presses` with a force against a surface in front of it moves the surface's
object, and what that is on, at `PUSHED_SPEED`, whether one vehicle pushes or several: along its
slide, about its turn, or anywhere if it is free.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from kybflow.core.geometry import ZERO, Vec3, add, cross, dot, heading_of, norm, rotate, scale, sub
from kybflow.parts import ActiveFaults
from kybflow.parts.link import Contact
from kybflow.world.objects import (
    WORLD,
    Face,
    ObjectState,
    Placement,
    TurnJoint,
    WorldObject,
    face_of,
    in_order,
    turning_of,
)
from kybflow.world.vehicle_context import VehicleContext

PUSHED_SPEED = 0.1
"""The speed of a surface that is pushed, m/s."""
_NEAR = 0.1
"""Distance of the bumper from a surface within which it pushes, m."""

Pressing = tuple[VehicleContext, Vec3, Vec3]
"""A vehicle that presses: its context, its position, and the direction in which it presses."""


class IdealObjects:
    """The objects of an ideal world."""

    def __init__(self, objects: Mapping[str, WorldObject]) -> None:
        self._objects = objects
        starts = {
            name: 0.0 if one.joint is None else one.joint.start for name, one in objects.items()
        }
        self._q, self._gone = starts, dict.fromkeys(objects, ZERO)
        self._states: dict[str, ObjectState] = {}
        self._pressed: set[Contact] = set()
        self._place(dict(starts), 0.0)

    def states(self) -> Mapping[str, ObjectState]:
        """Return the state of every object, by name."""
        return self._states

    def contacts(self) -> Mapping[Contact, float]:
        """Return the contacts with a force of 1 N, which moves everything."""
        return dict.fromkeys(self._pressed, 1.0)

    def faults(self) -> Mapping[str, ActiveFaults]:
        """Return nothing: an ideal world has no faults."""
        return {}

    def advance(self, pressing: Iterable[Pressing], dt: float) -> None:
        """Move what is pressed for `dt` seconds."""
        before, self._pressed = dict(self._q), set()
        pushed: list[tuple[WorldObject, Face]] = []
        for context, position, direction in pressing:
            for one, surface, face in self._faces():
                ahead, aside, above = face.before(position)
                gap = abs(ahead - (context.airframe.bumper or context.airframe.hull))
                faces = face.spans(aside, above) and dot(direction, face.outward) < -0.7
                if gap < _NEAR and faces:
                    self._pressed.add(Contact(context.vehicle, one.name, surface))
                    pushed.append((one, face))
        for one, face in pushed:
            self._push(one, face, dt / sum(other is one for other, _ in pushed))
        self._place(before, dt)

    def _faces(self) -> Iterator[tuple[WorldObject, str, Face]]:
        for name, one in self._objects.items():
            state = self._states[name]
            for surface in one.surfaces:
                place = Placement(state.position, state.attitude)
                yield one, surface.name, face_of(surface, place)

    def _push(self, one: WorldObject, face: Face, dt: float) -> None:
        """Move an object away from a face, and everything that it is on."""
        state, step = self._states[one.name], PUSHED_SPEED * dt
        inwards, joint = scale(face.outward, -1.0), one.joint
        if one.is_free:
            x, y, _ = inwards
            self._gone[one.name] = add(self._gone[one.name], scale((x, y, 0.0), step))
        elif joint is not None:
            axis = rotate(state.attitude, one.axis)
            arm = 1.0
            if isinstance(joint, TurnJoint):
                axis = cross(axis, sub(face.centre, state.position))
                arm = max(norm(axis), 1e-3)
            share = dot(axis, inwards) / arm
            q = self._q[one.name] + share * step / arm
            self._q[one.name] = max(joint.low, min(joint.high, q))
        if one.on is not None:
            self._push(self._objects[one.on], face, dt)

    def _place(self, before: Mapping[str, float], dt: float) -> None:
        """Compute the states from the coordinates. before: the coordinates `dt` seconds ago."""
        old, self._states = self._states, {}
        places: dict[str, Placement] = {}
        for one in in_order(self._objects.values()):
            name, below = one.name, WORLD if one.on is None else places[one.on]
            position, attitude = one.placed(below, self._q[name])
            places[name] = here = Placement(add(position, self._gone[name]), attitude)
            velocity, speed = ZERO, 0.0
            if dt > 0.0:
                velocity = scale(sub(here.position, old[name].position), 1.0 / dt)
                speed = (self._q[name] - before[name]) / dt
            q = heading_of(attitude) if one.joint is None else self._q[name]
            turning = turning_of(one, attitude, speed)
            self._states[name] = ObjectState(here.position, attitude, velocity, q, speed, turning)
