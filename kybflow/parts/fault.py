"""Faults, their effects, and the effects that are active on a simulated vehicle."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import hypot, prod
from typing import TYPE_CHECKING, Any, ClassVar

from kybflow.core.geometry import ZERO, Vec3, add
from kybflow.core.params import fields_of
from kybflow.core.signals import NS, Measurement, MeasurementKind, Time
from kybflow.parts.base import P, Part
from kybflow.world.cameras import SOUND, Weakness

if TYPE_CHECKING:
    import random

Filter = Callable[[Measurement], Measurement | None]
"""Changes a measurement before it arrives, or drops it (None)."""
Air = Callable[[float], Vec3]
"""Wind in the world frame, m/s, as a function of the seconds since the effect began."""
Rotors = tuple[float, float, float, float]
"""A value for each rotor: front left, rear left, rear right, front right."""


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """The effects of a fault on one simulated vehicle or object. The defaults have none.

    filter: changes every arriving measurement, including simulated camera frames. repeats: whether
    the filter sends earlier measurements again; it then runs after all other filters. wind: wind
    that is added to the world's. push: an external force per body mass, m/s^2, world frame. mass: a
    factor on the body's mass and inertia. payload: mass that is added to the body's, kg. rotors: a
    factor on each rotor's thrust. sag: the missing fraction of the battery's charge. gyro_bias,
    accelerometer_bias: biases that are added to the IMU's, rad/s and m/s^2, body frame. late: delay
    of commands, seconds. body: the vehicle whose poses motion capture reports for this one. camera:
    the degradation of its simulated cameras. view: the vehicle from whose position its cameras see.
    estimator: the name of the estimator that fails. deaf: nothing from the vehicle arrives over its
    link. mute: nothing sent over its link reaches the vehicle. silent: its messages to other
    vehicles are lost. force, torque: on an object, N in the world frame, and N m about the
    vertical.
    """

    filter: Filter | None = None
    repeats: bool = False
    wind: Air | None = None
    push: Vec3 = ZERO
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
    silent: bool = False
    force: Vec3 = ZERO
    torque: float = 0.0


class ActiveFaults:
    """The effects that are active on one simulated vehicle or object, oldest first, and their
    combination. An effect leaves no trace when it ends. `changed` is called after each change.

    estimators: the names of the estimators that fail. filters: all filters, in the order in which
    they are applied.
    """

    def __init__(self, vehicle: str, changed: Callable[[], None] = lambda: None) -> None:
        self.vehicle = vehicle
        self.estimators: frozenset[str] = frozenset()
        self.filters: tuple[Filter, ...] = ()
        self._changed = changed
        self._effects: list[tuple[Effect, Time]] = []

    def begin(self, effect: Effect, now: Time) -> None:
        """Activate `effect`."""
        self._combine([*self._effects, (effect, now)])

    def end(self, effect: Effect) -> None:
        """Deactivate `effect`."""
        self._combine([entry for entry in self._effects if entry[0] is not effect])

    def _combine(self, effects: list[tuple[Effect, Time]]) -> None:
        self._effects = effects
        self.estimators = frozenset(e.estimator for e, _ in effects if e.estimator)
        ordered = sorted((e for e, _ in effects), key=lambda e: e.repeats)
        self.filters = tuple(e.filter for e in ordered if e.filter is not None)
        self._changed()

    def filtered(self, measurements: Iterable[Measurement]) -> list[Measurement]:
        """Return the measurements that all filters let pass, as the filters changed them."""
        left = []
        for arriving in measurements:
            measurement: Measurement | None = arriving
            for change in self.filters:
                measurement = None if measurement is None else change(measurement)
            if measurement is not None:
                left.append(measurement)
        return left

    @property
    def blows(self) -> bool:
        """Whether any effect is a wind."""
        return any(e.wind is not None for e, _ in self._effects)

    def wind(self, now: Time) -> Vec3:
        """Return the sum of all winds at `now`, m/s in the world frame."""
        total = ZERO
        for effect, began in self._effects:
            if effect.wind is not None:
                total = add(total, effect.wind((now - began) / NS))
        return total

    @property
    def push(self) -> Vec3:
        """The sum of all forces per body mass, m/s^2, world frame."""
        return _sum(e.push for e, _ in self._effects)

    @property
    def force(self) -> Vec3:
        """The sum of all forces on an object, N, world frame."""
        return _sum(e.force for e, _ in self._effects)

    @property
    def torque(self) -> float:
        """The sum of all torques on an object about the vertical, N m."""
        return sum(e.torque for e, _ in self._effects)

    @property
    def mass(self) -> float:
        """The product of all mass factors."""
        return prod(e.mass for e, _ in self._effects)

    @property
    def payload(self) -> float:
        """The sum of all payload masses, kg."""
        return sum(e.payload for e, _ in self._effects)

    @property
    def rotors(self) -> Rotors:
        """The product of all thrust factors of each rotor."""
        a, b, c, d = (prod(e.rotors[i] for e, _ in self._effects) for i in range(4))
        return (a, b, c, d)

    @property
    def sag(self) -> float:
        """The sum of all missing fractions of charge."""
        return sum(e.sag for e, _ in self._effects)

    @property
    def gyro_bias(self) -> Vec3:
        """The sum of all gyroscope biases, rad/s, body frame."""
        return _sum(e.gyro_bias for e, _ in self._effects)

    @property
    def accelerometer_bias(self) -> Vec3:
        """The sum of all accelerometer biases, m/s^2, body frame."""
        return _sum(e.accelerometer_bias for e, _ in self._effects)

    @property
    def late(self) -> float:
        """The sum of all command delays, seconds."""
        return sum(e.late for e, _ in self._effects)

    @property
    def body(self) -> str:
        """The vehicle whose poses motion capture reports: that of the newest effect with a `body`,
        else the vehicle itself."""
        return next((e.body for e, _ in reversed(self._effects) if e.body), self.vehicle)

    @property
    def camera(self) -> Weakness:
        """The sum of all degradations; for blur, the root of the sum of squares."""
        weak = [e.camera for e, _ in self._effects if e.camera is not SOUND]
        if not weak:
            return SOUND
        covered = sum(w.covered for w in weak)
        blur = hypot(*(w.blur for w in weak))
        return Weakness(covered, blur, any(w.dark for w in weak), _sum(w.offset for w in weak))

    @property
    def view(self) -> str:
        """The vehicle from which the cameras see: that of the newest effect with a `view`, else the
        vehicle itself."""
        return next((e.view for e, _ in reversed(self._effects) if e.view), self.vehicle)

    @property
    def deaf(self) -> bool:
        """Whether any effect cuts the link from the vehicle."""
        return any(e.deaf for e, _ in self._effects)

    @property
    def silent(self) -> bool:
        """Whether any effect keeps the vehicle's messages from other vehicles."""
        return any(e.silent for e, _ in self._effects)

    @property
    def mute(self) -> bool:
        """Whether any effect cuts the link to the vehicle."""
        return any(e.mute for e, _ in self._effects)


def _sum(vectors: Iterable[Vec3]) -> Vec3:
    total = ZERO
    for vector in vectors:
        total = add(total, vector)
    return total


class Fault(Part[P]):
    """Breaks a simulated vehicle, or this program's side of one. Created when it is injected; all
    randomness comes from `generator`.

    A fault that raises is reported as the event `fault_failed` and ends. spoils: the kind of
    measurement that it corrupts; the compiler reports a vehicle whose estimators don't need it.
    ours: whether it affects only this program's side (simulated sensors, the link, an estimator);
    it can then be injected on any simulator, including a firmware's own.
    """

    kind = "faults"
    spoils: ClassVar[MeasurementKind | None] = None
    ours: ClassVar[bool] = False

    def __init__(self, params: P, generator: random.Random) -> None:
        self.params = params
        self.generator = generator

    @classmethod
    def is_nothing(cls, params: P) -> bool:
        """Return whether the fault changes nothing with these parameters, which is so if all its
        vectors are zero."""
        declared: Any = type(params)
        vectors = [f.name for f in fields_of(declared) if f.shape == "vector"]
        return bool(vectors) and all(not any(getattr(params, name)) for name in vectors)

    @abstractmethod
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        """Return the effects by vehicle or object: on `vehicle`, where the fault is injected, and
        on any others. Called once; the effects are active until the fault ends."""
