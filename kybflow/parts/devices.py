"""Drivers and what they open; the rig by which faults break a simulated vehicle."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from kybflow.geometry import ZERO, Vec3
from kybflow.parts.base import P, Part
from kybflow.signals import Command, CommandKind, Measurement, MeasurementKind, Time, Truth
from kybflow.site import Site

if TYPE_CHECKING:
    import random

Filter = Callable[[Measurement, Time], Measurement | None]
"""Changes a measurement on its way, or drops it; `now` is when it arrives."""


class Seat(NamedTuple):
    """One vehicle that a driver is to open: its place in the world and the driver's parameters for
    it."""

    site: Site
    params: Any


@dataclass(slots=True)
class Rig:
    """What of a simulated vehicle can be broken. Faults change it; the simulator obeys.

    filters: what every measurement passes on its way, in this order. wind: m/s, world frame, on top
    of the world's. mass: factor on the body's. rotors: factor on each rotor's thrust. sag: part of
    the battery's charge that is missing. gyro_bias, accelerometer_bias: added to the body's own,
    rad/s and m/s^2. late: seconds by which commands take effect late. fleet: every rig of the
    world, by vehicle; `body` is the vehicle that motion capture takes this one for.
    """

    vehicle: str
    filters: list[Filter] = field(default_factory=list)
    wind: Vec3 = ZERO
    mass: float = 1.0
    rotors: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    sag: float = 0.0
    gyro_bias: Vec3 = ZERO
    accelerometer_bias: Vec3 = ZERO
    late: float = 0.0
    body: str = ""
    fleet: dict[str, Rig] = field(default_factory=dict)


class Link(ABC):
    """One vehicle's connection. The engine reads and sends once a tick. `rig` is None on
    hardware."""

    rig: Rig | None = None

    @abstractmethod
    def read(self, now: Time) -> Sequence[Measurement]:
        """The measurements that arrived since the last call, oldest first. Raises DriverError."""

    @abstractmethod
    def send(self, command: Command, now: Time) -> None:
        """Hand over the newest command. Raises DriverError."""

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:  # noqa: B027 - most have one rate
        """From now on deliver at least these kinds, where the driver provides them. A link may
        deliver all that it has at all times."""

    def truth(self) -> Truth | None:
        """The simulator's truth, for the recorder and the expectations; None on hardware."""
        return None


class Session(ABC):
    """What a driver has open: the links of its vehicles, by name, and the passage of time."""

    links: dict[str, Link]

    @abstractmethod
    def advance(self, now: Time) -> None:
        """Let the world go on until `now`; a simulated one steps its physics. Raises
        DriverError."""

    @abstractmethod
    def close(self) -> None: ...


class Driver(Part[P]):
    """Opens the vehicles that fly on it. `accepts` kinds of command, `provides` kinds of
    measurement."""

    kind = "drivers"
    accepts: ClassVar[frozenset[CommandKind]]
    provides: ClassVar[frozenset[MeasurementKind]]
    simulated: ClassVar[bool] = False

    @classmethod
    @abstractmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        """Open every vehicle of `seats` in one session; `generator` is the only source of chance.
        Raises DriverError."""

    @classmethod
    def step_rate(cls, params: P) -> float | None:
        """The rate (Hz) that the control rate must divide, None where there is none."""
        return None


class Fault(Part[P]):
    """Breaks one thing of one simulated vehicle. Made when it is injected; `generator` is its only
    source of chance. `begin` is called once; `end` once, when its time is over, and undoes it
    exactly: several may be at work on one rig. One that raises is told and left out."""

    kind = "faults"

    def __init__(self, params: P, generator: random.Random) -> None:
        self.params = params
        self.generator = generator

    @abstractmethod
    def begin(self, rig: Rig) -> None: ...

    @abstractmethod
    def end(self, rig: Rig) -> None: ...
