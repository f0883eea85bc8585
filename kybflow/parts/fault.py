"""Faults and the rig by which they break a simulated vehicle."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import hypot, prod
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.geometry import ZERO, Vec3, add
from kybflow.core.signals import NS, Measurement, MeasurementKind, Time
from kybflow.parts.base import P, Part
from kybflow.vision.optics import SOUND, Weakness

if TYPE_CHECKING:
    import random

Filter = Callable[[Measurement], Measurement | None]
"""Changes a measurement on its way to the program, or drops it."""
Air = Callable[[float], Vec3]
"""Wind, m/s in the world frame, so many seconds after it began."""
Rotors = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """What a fault does to one simulated vehicle; where it says nothing, nothing.

    filter: what every measurement passes as it arrives, a simulated camera's frames too. wind: on
    top of the world's. mass: factor on the body's, its inertia with it. payload: kg on top of that.
    rotors: factor on the thrust of each, front left, rear left, rear right, front right. sag: part
    of the battery's charge that is missing. gyro_bias, accelerometer_bias: added to the IMU's own,
    rad/s and m/s^2, body frame. late: seconds by which commands take effect late. body: the vehicle
    that motion capture takes this one for, if it is another. camera: what is wrong with its
    simulated cameras. view: the vehicle from whose place these see, if it is another. estimator:
    the one of its estimators that fails, by name. deaf: nothing that comes over its link arrives
    here. mute: nothing that is sent over its link arrives there.
    """

    filter: Filter | None = None
    wind: Air | None = None
    mass: float = 1.0
    payload: float = 0.0
    rotors: Rotors = (1.0, 1.0, 1.0, 1.0)
    sag: float = 0.0
    gyro_bias: Vec3 = ZERO
    accelerometer_bias: Vec3 = ZERO
    late: float = 0.0
    body: str = ""
    camera: Weakness = SOUND
    view: str = ""
    estimator: str = ""
    deaf: bool = False
    mute: bool = False


class Rig:
    """How a simulated vehicle is broken now: the effects at work on it, oldest first, and what they
    are together. An effect that is taken away leaves nothing. Calls `changed` after each change."""

    def __init__(self, vehicle: str, changed: Callable[[], None] = lambda: None) -> None:
        self.vehicle = vehicle
        self._changed = changed
        self._effects: list[tuple[Effect, Time]] = []

    def begin(self, effect: Effect, now: Time) -> None:
        self._effects.append((effect, now))
        self._changed()

    def end(self, effect: Effect) -> None:
        self._effects = [entry for entry in self._effects if entry[0] is not effect]
        self._changed()

    @property
    def filters(self) -> tuple[Filter, ...]:
        return tuple(e.filter for e, _ in self._effects if e.filter is not None)

    @property
    def blows(self) -> bool:
        return any(e.wind is not None for e, _ in self._effects)

    def wind(self, now: Time) -> Vec3:
        """The wind at `now`, the sum of all."""
        total = ZERO
        for effect, began in self._effects:
            if effect.wind is not None:
                total = add(total, effect.wind((now - began) / NS))
        return total

    @property
    def mass(self) -> float:
        """The product of all."""
        return prod(e.mass for e, _ in self._effects)

    @property
    def payload(self) -> float:
        """The sum of all, like the sag, the biases and the lateness."""
        return sum(e.payload for e, _ in self._effects)

    @property
    def rotors(self) -> Rotors:
        """The product of all."""
        a, b, c, d = (prod(e.rotors[i] for e, _ in self._effects) for i in range(4))
        return (a, b, c, d)

    @property
    def sag(self) -> float:
        return sum(e.sag for e, _ in self._effects)

    @property
    def gyro_bias(self) -> Vec3:
        return _sum(e.gyro_bias for e, _ in self._effects)

    @property
    def accelerometer_bias(self) -> Vec3:
        return _sum(e.accelerometer_bias for e, _ in self._effects)

    @property
    def late(self) -> float:
        return sum(e.late for e, _ in self._effects)

    @property
    def body(self) -> str:
        """The newest counts."""
        return next((e.body for e, _ in reversed(self._effects) if e.body), self.vehicle)

    @property
    def camera(self) -> Weakness:
        """The sum of all; of blurs the root of the squares' sum."""
        weak = [e.camera for e, _ in self._effects if e.camera is not SOUND]
        if not weak:
            return SOUND
        covered = sum(w.covered for w in weak)
        blur = hypot(*(w.blur for w in weak))
        return Weakness(covered, blur, any(w.dark for w in weak), _sum(w.offset for w in weak))

    @property
    def view(self) -> str:
        """The newest counts."""
        return next((e.view for e, _ in reversed(self._effects) if e.view), self.vehicle)

    @property
    def estimators(self) -> frozenset[str]:
        """All that fail."""
        return frozenset(e.estimator for e, _ in self._effects if e.estimator)

    @property
    def deaf(self) -> bool:
        return any(e.deaf for e, _ in self._effects)

    @property
    def mute(self) -> bool:
        return any(e.mute for e, _ in self._effects)


def _sum(vectors: Iterable[Vec3]) -> Vec3:
    total = ZERO
    for vector in vectors:
        total = add(total, vector)
    return total


class Fault(Part[P]):
    """Breaks simulated vehicles. Made when it is injected; `generator` is its only source of
    chance. `effects` is asked once, then; what it gives is at work until the fault's time is over.
    One that raises is told and left out. `spoils` is the one kind of measurement that it is about:
    a vehicle none of whose estimators needs that can't be broken by it."""

    kind = "faults"
    spoils: ClassVar[MeasurementKind | None] = None

    def __init__(self, params: P, generator: random.Random) -> None:
        self.params = params
        self.generator = generator

    @abstractmethod
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        """What it does to `vehicle`, on which it is injected, and to others, by name."""
