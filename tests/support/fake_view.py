"""A view of a vehicle whose values are set by hand, for tests of conditions and expectations."""

from __future__ import annotations

from dataclasses import dataclass, field

from kybflow.core.geometry import LEVEL, ZERO, Quat, Vec3
from kybflow.core.signals import Battery, Setpoint, SetpointKind, Truth
from kybflow.parts.observables import ObjectView, ObstacleView, State, Unavailable


@dataclass
class FakeView:
    """A `kybflow.parts.observables.View`; what is None can't be known."""

    behavior: str = "up"
    position: Vec3 | None = ZERO
    velocity: Vec3 = ZERO
    attitude: Quat = LEVEL
    wanted_position: Vec3 | None = None
    remaining: float | None = None
    estimator: str = "mocap"
    elapsed: float = 0.0
    airborne: bool = False
    start: Vec3 = ZERO
    age: float = 0.0
    spread: float = 0.0
    hull: float = 0.0
    obstacles: dict[str, ObstacleView] = field(default_factory=dict)
    objects: dict[str, ObjectView] = field(default_factory=dict)
    asked: list[str] = field(default_factory=list)

    def object(self, name: str) -> ObjectView:
        if name not in self.objects:
            raise Unavailable
        return self.objects[name]

    def object_place(self, name: str, surface: str) -> Vec3:
        x, y, z = self.object(name).position
        return (x, y + (0.5 if surface == "left" else 0.0), z)

    def obstacle(self, name: str) -> ObstacleView:
        if name not in self.obstacles:
            raise Unavailable
        return self.obstacles[name]

    @property
    def state(self) -> State:
        self.asked.append("state")
        if self.position is None:
            raise Unavailable
        return Truth(self.position, self.velocity, self.attitude, (0.0, 0.0, 0.0))

    @property
    def wanted(self) -> Setpoint:
        if self.wanted_position is None:
            raise Unavailable
        return Setpoint(SetpointKind.POSITION, self.wanted_position, ZERO, ZERO)

    @property
    def battery(self) -> Battery:
        if self.remaining is None:
            raise Unavailable
        return Battery(0, self.remaining, 12.0)
