"""Ideal objects: bodies with the mass, the friction and the damping that the mission declares, and
without contact dynamics.

A vehicle whose setpoint `presses` with a force against a surface in front of it pushes the
surface's object, and what that is on, with this force, and moves with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from math import copysign, exp

from kybflow.core.geometry import ZERO, Vec3, add, dot, heading_of, norm, scale, sub
from kybflow.parts import ActiveFaults
from kybflow.parts.link import Contact
from kybflow.world.freedoms import Freedom, freedoms_of
from kybflow.world.objects import (
    WORLD,
    Face,
    ObjectState,
    Placement,
    WorldObject,
    face_of,
    in_order,
    turning_of,
)
from kybflow.world.vehicle_context import VehicleContext

_NEAR = 0.1
"""Distance of the bumper from a surface within which it pushes, m."""

Pressing = tuple[VehicleContext, Vec3, Vec3]
"""A vehicle that presses: its context, its position, and the force with which it presses, N."""


class IdealObjects:
    """The objects of an ideal world."""

    def __init__(self, objects: Mapping[str, WorldObject]) -> None:
        self._objects = objects
        starts = {
            name: 0.0 if one.joint is None else one.joint.start for name, one in objects.items()
        }
        self._q, self._gone = starts, dict.fromkeys(objects, ZERO)
        self._states: dict[str, ObjectState] = {}
        self._freedoms = {name: freedoms_of(objects, name) for name in objects}
        every = chain.from_iterable(self._freedoms.values())
        self._every = list({free.name: free for free in every}.values())
        self._rates: dict[str, float] = {}
        self._pressed: set[Contact] = set()
        self._place(dict(starts), 0.0)

    def states(self) -> Mapping[str, ObjectState]:
        """Return the state of every object, by name."""
        return self._states

    def contacts(self) -> Mapping[Contact, float]:
        """Return the contacts, each with a force of 1 N."""
        return dict.fromkeys(self._pressed, 1.0)

    def faults(self) -> Mapping[str, ActiveFaults]:
        """Return nothing: an ideal world has no faults."""
        return {}

    def advance(self, pressing: Iterable[Pressing], dt: float) -> None:
        """Move the objects for `dt` seconds."""
        before, self._pressed = dict(self._q), set()
        forces, masses = dict[str, float](), dict[str, float]()
        for context, position, push in pressing:
            force, mass = norm(push), context.airframe.mass
            direction = scale(push, 1.0 / force)
            for one, surface, face in self._faces():
                ahead, aside, above = face.before(position)
                gap = abs(ahead - (context.airframe.bumper or context.airframe.hull))
                faces = face.spans(aside, above) and dot(direction, face.outward) < -0.7
                if gap < _NEAR and faces:
                    self._pressed.add(Contact(context.vehicle, one.name, surface))
                    for free in self._freedoms[one.name]:
                        place = self._states[free.object]
                        at = Placement(place.position, place.attitude)
                        lever = free.lever(at, face.centre, direction)
                        forces[free.name] = forces.get(free.name, 0.0) + lever * force
                        masses[free.name] = masses.get(free.name, 0.0) + lever**2 * mass
        for free in self._every:
            pushed = forces.get(free.name, 0.0)
            self._move(free, pushed, free.inertia + masses.get(free.name, 0.0), dt)
        self._place(before, dt)

    def _faces(self) -> Iterator[tuple[WorldObject, str, Face]]:
        for name, one in self._objects.items():
            state = self._states[name]
            for surface in one.surfaces:
                place = Placement(state.position, state.attitude)
                yield one, surface.name, face_of(surface, place)

    def _move(self, free: Freedom, force: float, inertia: float, dt: float) -> None:
        """Move one freedom under a force, its friction and its damping."""
        rate, name = self._rates.get(free.name, 0.0) + force / inertia * dt, free.object
        stopped = free.friction / inertia * dt
        rate = copysign(max(0.0, abs(rate) - stopped), rate)
        joint = self._objects[name].joint
        if joint is not None:
            rate *= exp(-joint.damping / inertia * dt)
            q = self._q[name] + rate * dt
            self._q[name] = max(joint.low, min(joint.high, q))
            rate = rate if joint.low < q < joint.high else 0.0
        elif free.turns:
            self._q[name] += rate * dt
        else:
            self._gone[name] = add(self._gone[name], scale(free.axis, rate * dt))
        self._rates[free.name] = rate

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
