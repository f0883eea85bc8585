"""The views of a vehicle that conditions and expectations read (`observables.View`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Battery, Estimate, PayloadState, Setpoint, Sticks
from kybflow.flight.avoidance.surroundings import grown
from kybflow.parts.observables import ObstacleView, State, Unavailable
from kybflow.world.shapes import Sphere

if TYPE_CHECKING:
    from kybflow.runtime.vehicle.vehicle import Vehicle


class BelievedView:
    """The view of a vehicle that conditions read: its state is its own estimate."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

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
    """The view of a vehicle that expectations read: its state is the simulator's ground truth, or
    its estimate on hardware."""

    @property
    def state(self) -> State:
        return self._vehicle.truth or super().state

    def obstacle(self, name: str) -> ObstacleView:
        ball = self._vehicle.context.moving.get(name)
        if ball is None or self._vehicle.truth is None:
            return super().obstacle(name)
        return Sphere(ball.at(self._vehicle.now / NS), ball.radius)

    @property
    def payload_place(self) -> Vec3:
        truth = self._vehicle.truth
        if truth is None or truth.payload is None:
            raise Unavailable
        return truth.payload
