"""Which vehicles touch which objects, as conditions read it: inferred from what vehicles and motion
capture know, never from a simulator.

A vehicle with a bumper touches a surface (`kybflow.flight.manipulation.contact`) if it also leans
towards it when contact begins. Sides of an object that aren't declared as surfaces are not
considered.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import sin
from typing import NamedTuple

from kybflow.core.geometry import body_z, dot
from kybflow.core.signals import SeenObjects, Time
from kybflow.core.units import DEG
from kybflow.flight.manipulation.contact import TouchSense
from kybflow.runtime.fleet.tracked_bodies import UNSEEN_NS
from kybflow.runtime.vehicle.vehicle import Vehicle
from kybflow.world.objects import Face, WorldObject, seen_face, seen_object

_LEANS = sin(1.0 * DEG)
"""The least horizontal part of body z towards a surface when contact begins."""


class Touching(NamedTuple):
    """What a vehicle touches: the object's name, and since when."""

    object: str
    since: Time


class InferredContacts:
    """The contacts of all vehicles. The engine calls `step` in every tick of a mission with
    objects. touching: what each vehicle touches, by name; vehicles that touch nothing are left
    out."""

    def __init__(
        self, vehicles: Sequence[Vehicle], objects: Mapping[str, WorldObject], seen: SeenObjects
    ) -> None:
        self.touching: dict[str, Touching] = {}
        self._objects, self._seen = objects, seen
        paths = [
            f"{one.name}.{surface.name}"
            for one in objects.values() for surface in one.surfaces
        ]  # fmt: skip
        self._senses = [
            (vehicle, {path: TouchSense(bumper) for path in paths})
            for vehicle in vehicles
            if (bumper := vehicle.context.airframe.bumper) is not None
        ]

    def step(self, now: Time, dt: float) -> None:
        for vehicle, senses in self._senses:
            touched = [*self._touched(vehicle, senses, now, dt)]
            before = self.touching.pop(vehicle.name, None)
            if touched:
                since = before.since if before and before.object == touched[0] else now
                self.touching[vehicle.name] = Touching(touched[0], since)

    def _touched(
        self, vehicle: Vehicle, senses: Mapping[str, TouchSense], now: Time, dt: float
    ) -> Iterator[str]:
        """Yield the objects that a vehicle touches."""
        known = vehicle.estimate
        for path, sense in senses.items():
            face = self._face(path, now)
            if known is None or face is None:
                sense.forget()
                continue
            leans = -dot(body_z(known.attitude), face.outward) > _LEANS
            if (sense.touches or leans) and sense.update(face, known, dt):
                yield path.partition(".")[0]

    def _face(self, path: str, now: Time) -> Face | None:
        seen = seen_object(self._objects, self._seen, path.partition(".")[0])
        if seen is None or now - seen.time > UNSEEN_NS:
            return None
        return seen_face(self._objects, self._seen, path)
