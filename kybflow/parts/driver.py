"""Drivers and what they open."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from kybflow.core.signals import CommandKind, MeasurementKind, Time
from kybflow.parts.base import Objection, P, Part
from kybflow.parts.link import Link
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random


class Seat(NamedTuple):
    """One vehicle that a driver is to open: its place in the world and the driver's parameters for
    it."""

    context: VehicleContext
    params: Any


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
    measurement. `lands`: its vehicles have a land mode of their own, which `Link.land` asks for;
    `lands_blind`: one that comes down by a barometer of its own where there is no position.
    `grips`: they can have a servo that holds a payload, which `Link.grip` moves.
    `brings`: the sensors that a vehicle on it has without being told, where an estimator needs what
    they measure. `preflight_timeout`: seconds in which its vehicles must have become ready to fly.
    `targets`: the targets that every mission has on it without a word, each with the driver's
    parameters there."""

    kind = "drivers"
    helpers = frozenset({"emulation"})
    accepts: ClassVar[frozenset[CommandKind]]
    provides: ClassVar[frozenset[MeasurementKind]]
    simulated: ClassVar[bool] = False
    lands: ClassVar[bool] = False
    lands_blind: ClassVar[bool] = False
    grips: ClassVar[bool] = False
    brings: ClassVar[tuple[str, ...]] = ()
    preflight_timeout: ClassVar[float] = 5.0
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {}

    @classmethod
    def takes(cls, params: P) -> frozenset[CommandKind]:
        """What of `accepts` its vehicles follow with these parameters."""
        return cls.accepts

    @classmethod
    def tracker(cls, params: P) -> Mapping[str, str] | None:
        """The tracker that its vehicles fly best with, in place of the mission's, as it would be
        written: `use`, and its parameters; None to fly with the mission's. A target may name
        another."""
        return None

    @classmethod
    def shows(cls, params: P) -> bool:
        """Whether its links tell the truth of a simulator, which simulated sensors watch."""
        return cls.simulated

    @classmethod
    def objection(cls, params: P) -> Objection | None:
        """Why it can't work as it is told, None when it can; asked by the compiler."""
        return None

    @classmethod
    @abstractmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        """Open every vehicle of `seats` in one session; `generator` is the only source of chance.
        Raises DriverError."""

    @classmethod
    def watchdog(cls, params: P) -> str | None:
        """What is dangerous about the vehicle's own watchdog, which lands it should this program
        die; None where nothing is. The preflight refuses to fly with it."""
        return None

    @classmethod
    def control_rate(cls, params: P) -> int:
        """Ticks a second with which its vehicles fly well, where the mission's `control` says
        nothing; the run takes the highest that a vehicle of it needs."""
        return 250

    @classmethod
    def step_rate(cls, params: P) -> float | None:
        """The rate (Hz) that the control rate must divide, None where there is none."""
        return None
