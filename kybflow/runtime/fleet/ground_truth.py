"""Publishes events that only a simulator can detect: collisions, hard landings, flights outside the
fence, contacts with objects, and payloads that come to rest after their release. Scores how near
the vehicles fly to obstacles.

Listeners such as a recording receive these events; vehicles, flows and callbacks don't.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from contextlib import suppress
from functools import partial
from types import MappingProxyType

from kybflow.core.geometry import Vec3, distance, norm
from kybflow.core.signals import NS, PayloadState, Time
from kybflow.dsl.expressions import Clearance
from kybflow.parts import Link, Session
from kybflow.parts.events import (
    Collided,
    ContactBegan,
    ContactEnded,
    FenceLeft,
    LandedHard,
    PayloadRested,
)
from kybflow.parts.link import Contact, ReportsTouches, Touch
from kybflow.parts.observables import Unavailable, View
from kybflow.runtime.conditions import value_of
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.inferred_contacts import Touching
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.world.objects import WorldObject, mover_of
from kybflow.world.shapes import Box

HARD_TOUCH_DOWN = 1.5
"""The speed (m/s) above which a touch-down is too hard."""
BEYOND_FENCE = 0.1
"""Distance (m) from the fence up to which an estimate may still be inside."""
CONTACT_S, LEAST_FORCE = 0.05, 0.01
"""Time over which the force of a contact is averaged, s, and the average below which it ends, N."""
_REST_DISTANCE = 0.001
"""Largest distance (m) that a payload at rest moves between two steps."""
_REST_STEPS = 10
"""Number of consecutive steps in which a payload must be at rest."""


class Impacts:
    """Publishes collisions (`collided`) and landings that are too fast (`landed_hard`). Each of
    them fails the run. first: a description of the first one, or None.

    If a vehicle that may touch down touches a surface that can carry it, it touches down there.
    Every other touch is a collision, even with the floor, unless the mission allows it
    (`touchable`), or the vehicle's behavior means to touch that one of the `objects`. The speed of
    a landing is that in the tick before the touch.
    """

    def __init__(
        self,
        vehicles: Sequence[Vehicle],
        links: Mapping[str, Link],
        events: Events,
        touchable: Set[str] = frozenset(),
        objects: Mapping[str, WorldObject] = MappingProxyType({}),
    ) -> None:
        self.first: str | None = None
        self._events, self._touchable, self._objects = events, touchable, objects
        for vehicle in vehicles:
            link = links.get(vehicle.name)
            if isinstance(link, ReportsTouches):
                link.report_touches(partial(self._touched, vehicle))

    def _touched(self, vehicle: Vehicle, touch: Touch) -> None:
        name, into = vehicle.name, touch.into
        vehicle.note_touch(touch)
        if into in self._touchable or self._is_meant(vehicle, into):
            return
        if not (touch.carries and vehicle.may_touch_down):
            self.first = self.first or f"`{name}` ran into `{into}`"
            self._events.emit(Collided(into=into), name)
            return
        truth = vehicle.truth
        speed = 0.0 if truth is None else norm(truth.velocity)
        if speed > HARD_TOUCH_DOWN:
            self.first = self.first or f"`{name}` landed hard ({speed:.2f} m/s) on `{into}`"
            self._events.emit(LandedHard(onto=into, speed=speed), name)

    def _is_meant(self, vehicle: Vehicle, into: str) -> bool:
        """Return whether a vehicle's behavior means to touch this, or an object of which it is a
        part, or that is a part of it."""
        objects = self._objects
        if into not in objects or not vehicle.touches:
            return False
        return mover_of(objects, vehicle.touches) is mover_of(objects, into)


class Excursions:
    """Publishes that a vehicle flies outside the fence (`fence_left`), once per vehicle, which
    fails the run. The engine calls `step` twenty times a second."""

    def __init__(self, vehicles: Sequence[Vehicle], fence: Box | None, events: Events) -> None:
        self._vehicles = () if fence is None else tuple(vehicles)
        self._fence, self._events = fence, events
        self._farthest: dict[str, float] = {}

    @property
    def first(self) -> str | None:
        """Return how far the first vehicle outside the fence flew beyond it; None if there is
        none."""
        first = next(iter(self._farthest.items()), None)
        return None if first is None else f"`{first[0]}` flew {first[1]:.2f} m outside the fence"

    def step(self) -> None:
        for vehicle in self._vehicles:
            truth = vehicle.truth
            if truth is None or self._fence is None or not vehicle.airborne:
                continue
            sides = zip(truth.position, *self._fence, strict=True)
            beyond = max(max(low - at, at - high) for at, low, high in sides)
            if beyond > self._farthest.get(vehicle.name, BEYOND_FENCE):
                if vehicle.name not in self._farthest:
                    self._events.emit(FenceLeft(beyond=beyond), vehicle.name)
                self._farthest[vehicle.name] = beyond


class Clearances:
    """Adds to each vehicle's score how near it flies to the obstacles that it keeps away from. The
    engine calls `step` twenty times a second. views: the vehicles' true states in simulation, their
    estimates on hardware."""

    def __init__(
        self, vehicles: Sequence[Vehicle], views: Mapping[str, View], obstacles: tuple[str, ...]
    ) -> None:
        self._watched = [
            (vehicle, value_of(Clearance(vehicle.name, obstacles), views, None, lambda: 0.0))
            for vehicle in (vehicles if obstacles else ())
        ]

    def step(self) -> None:
        for vehicle, clearance in self._watched:
            if vehicle.airborne:
                with suppress(Unavailable):
                    vehicle.score.clearance(clearance())


class ObjectContacts:
    """Publishes when vehicles begin and end to touch objects (`contact_began`, `contact_ended`).
    The engine calls `step` in every tick of a mission with objects. forces: the force of each
    contact now, averaged over `CONTACT_S`, N. felt: the forces at this moment, N.

    MuJoCo's forces alternate from step to step, so that a contact ends once its average has almost
    vanished.
    """

    def __init__(self, sessions: Sequence[Session], events: Events) -> None:
        self.felt: Mapping[Contact, float] = {}
        self.forces: dict[Contact, float] = {}
        self._scenes = [session.scene for session in sessions if session.scene is not None]
        self._events = events
        self._begun: dict[Contact, tuple[Time, float]] = {}

    def touching(self, vehicle: str) -> Touching | None:
        """Return what a vehicle touches, the longest contact if there are several."""
        own = [(began, c[1]) for c, (began, _) in self._begun.items() if c[0] == vehicle]
        began, touched = min(own, default=(0, ""))
        return Touching(touched, began) if touched else None

    def step(self, now: Time, dt: float) -> None:
        found = {c: force for one in self._scenes for c, force in one.contacts().items()}
        self.felt = found
        share = min(1.0, dt / CONTACT_S)
        for contact in {*found, *self.forces}:
            before = self.forces.get(contact, 0.0)
            force = before + share * (found.get(contact, 0.0) - before)
            vehicle, touched, surface = contact
            if contact in found or force >= LEAST_FORCE:
                if contact not in self._begun:
                    self._events.emit(ContactBegan(object=touched, surface=surface), vehicle)
                began, most = self._begun.get(contact, (now, 0.0))
                self._begun[contact] = began, max(most, force)
                self.forces[contact] = force
            else:
                del self.forces[contact]
                began, most = self._begun.pop(contact)
                lasted = (now - began) / NS
                self._events.emit(
                    ContactEnded(object=touched, surface=surface, lasted=lasted, force=most),
                    vehicle,
                )


class PayloadDrops:
    """Publishes where payloads come to rest. The engine calls `step` twenty times a second."""

    def __init__(self, vehicles: Sequence[Vehicle], events: Events) -> None:
        self._falling = [_PayloadDrop(v, events) for v in vehicles if v.plan.payload is not None]

    def step(self) -> None:
        """Publish an event for each payload that has come to rest in this step."""
        for drop in self._falling:
            drop.look()


class _PayloadDrop:
    def __init__(self, vehicle: Vehicle, events: Events) -> None:
        self._vehicle, self._events = vehicle, events
        self._last: Vec3 | None = None
        self._still = 0

    def look(self) -> None:
        truth = self._vehicle.truth
        place = None if truth is None else truth.payload
        if place is None or self._vehicle.knowledge.payload.state is not PayloadState.RELEASED:
            self._last, self._still = None, 0
            return
        rests = self._last is not None and distance(place, self._last) < _REST_DISTANCE
        self._still = self._still + 1 if rests else 0
        self._last = place
        if self._still == _REST_STEPS:
            x, y, z = place
            self._events.emit(PayloadRested(x=x, y=y, z=z), self._vehicle.name)
