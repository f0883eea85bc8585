"""The views of a vehicle that conditions and expectations read (`observables.View`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add, rotate
from kybflow.core.signals import (
    NS,
    Battery,
    Estimate,
    PayloadState,
    SeenObject,
    Setpoint,
    Sticks,
)
from kybflow.flight.avoidance.surroundings import grown
from kybflow.parts.observables import NOTHING, ObjectView, ObstacleView, State, Unavailable
from kybflow.parts.true_objects import TrueObjects
from kybflow.runtime.fleet.inferred_contacts import InferredContacts, Touching
from kybflow.runtime.fleet.tracked_bodies import UNSEEN_NS
from kybflow.world.objects import WorldObject, seen_object
from kybflow.world.shapes import Sphere

if TYPE_CHECKING:
    from kybflow.runtime.fleet.ground_truth import ObjectContacts
    from kybflow.runtime.vehicle.vehicle import Vehicle


class KnownObjects(NamedTuple):
    """What is known of the world's objects. made: the objects. seen: what motion capture has seen
    of them. true: their true states, those of the simulator. inferred, contacts: the contacts with
    them, inferred and the simulator's."""

    made: Mapping[str, WorldObject]
    seen: Mapping[str, SeenObject]
    true: TrueObjects
    inferred: InferredContacts
    contacts: ObjectContacts


class BelievedView:
    """The view of a vehicle that conditions read: its state is its own estimate, and objects are
    where motion capture has seen them."""

    def __init__(self, vehicle: Vehicle, objects: KnownObjects) -> None:
        self._vehicle, self._objects = vehicle, objects

    @property
    def state(self) -> State:
        return self._estimate()

    @property
    def wanted(self) -> Setpoint:
        setpoint = self._vehicle.wanted
        if setpoint is None:
            raise Unavailable
        return setpoint

    @property
    def battery(self) -> Battery:
        battery = self._vehicle.battery
        if battery is None:
            raise Unavailable
        return battery

    @property
    def behavior(self) -> str:
        runner = self._vehicle.runner
        return runner.machine.state if runner.begun else ""

    @property
    def estimator(self) -> str:
        source = self._vehicle.estimator
        if source is None:
            raise Unavailable
        return source

    @property
    def elapsed(self) -> float:
        return (self._vehicle.now - self._vehicle.runner.entered) / NS

    @property
    def airborne(self) -> bool:
        return self._vehicle.airborne

    @property
    def start(self) -> Vec3:
        return self._vehicle.context.start

    @property
    def age(self) -> float:
        return self._estimate().age

    @property
    def spread(self) -> float:
        return self._estimate().spread

    @property
    def payload(self) -> PayloadState:
        state = self._vehicle.knowledge.payload.state
        if state is None:
            raise Unavailable
        return state

    @property
    def payload_place(self) -> Vec3:
        raise Unavailable

    @property
    def hull(self) -> float:
        return self._vehicle.context.airframe.hull

    def obstacle(self, name: str) -> ObstacleView:
        shape = self._vehicle.context.obstacles.get(name)
        if shape is not None:
            return shape
        seen = self._vehicle.moving.get(name)
        if seen is None:
            raise Unavailable
        known = grown(seen, self._vehicle.now)
        return Sphere(known.position, known.radius)

    @property
    def contact(self) -> str:
        touching = self._touching()
        return NOTHING if touching is None else touching.object

    @property
    def contact_time(self) -> float:
        touching = self._touching()
        return 0.0 if touching is None else (self._vehicle.now - touching.since) / NS

    def _touching(self) -> Touching | None:
        return self._objects.inferred.touching.get(self._vehicle.name)

    def object(self, name: str) -> ObjectView:
        seen = seen_object(self._objects.made, self._objects.seen, name)
        if seen is None or self._vehicle.now - seen.time > UNSEEN_NS:
            raise Unavailable
        return seen

    def object_place(self, name: str, surface: str) -> Vec3:
        state = self.object(name)
        surfaces = self._objects.made[name].surfaces
        at = next((one.at for one in surfaces if one.name == surface), ZERO)
        return add(state.position, rotate(state.attitude, at))

    @property
    def releases(self) -> int:
        return self._vehicle.knowledge.payload.releases

    @property
    def sticks(self) -> Sticks:
        sticks = self._vehicle.knowledge.sticks
        if sticks is None:
            raise Unavailable
        return sticks

    def _estimate(self) -> Estimate:
        estimate = self._vehicle.estimate
        if estimate is None:
            raise Unavailable
        return estimate


class TrueView(BelievedView):
    """The view of a vehicle that expectations read: its state and those of objects are the
    simulator's ground truth, or what conditions read on hardware."""

    @property
    def state(self) -> State:
        return self._vehicle.truth or super().state

    def obstacle(self, name: str) -> ObstacleView:
        ball = self._vehicle.context.moving.get(name)
        if ball is None or self._vehicle.truth is None:
            return super().obstacle(name)
        return Sphere(ball.at(self._vehicle.now / NS), ball.radius)

    def _touching(self) -> Touching | None:
        if self._vehicle.truth is None:
            return super()._touching()
        return self._objects.contacts.touching(self._vehicle.name)

    def object(self, name: str) -> ObjectView:
        if self._vehicle.truth is None:
            return super().object(name)
        return self._objects.true.states[name]

    @property
    def payload_place(self) -> Vec3:
        truth = self._vehicle.truth
        if truth is None or truth.payload is None:
            raise Unavailable
        return truth.payload
