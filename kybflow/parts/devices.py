"""Drivers and what they open."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from kybflow.core.errors import Refused
from kybflow.core.signals import (
    Command,
    CommandKind,
    Estimate,
    Measurement,
    MeasurementKind,
    Time,
    Truth,
)
from kybflow.parts.base import Objection, P, Part
from kybflow.parts.fault import Rig
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random


class Seat(NamedTuple):
    """One vehicle that a driver is to open: its place in the world and the driver's parameters for
    it."""

    context: VehicleContext
    params: Any


class Check(NamedTuple):
    """One line of the preflight that the vehicle itself answers: what was looked at, whether it is
    well, what was found, in words that say what to change, which may carry a table (`details`).
    waits: whether it may become well without anybody's doing."""

    name: str
    green: bool
    reason: str
    waits: bool = True


class Said(NamedTuple):
    """Something that the vehicle says of itself, in its own words. severity: `warning`, `error` or
    `critical`, or `notice` and less."""

    severity: str
    text: str


class Taken(NamedTuple):
    """Why a vehicle whose link lives does not obey. lands: its own failsafe has it, not a person,
    and it is to be landed. refused: why it was not given back when it was asked for; empty while
    nobody has asked, and while that is awaited."""

    reason: str
    lands: bool = False
    refused: str = ""


class Link(ABC):
    """One vehicle's connection. The engine reads and sends once a tick. `rig` is None on hardware.

    `taken`: why the vehicle does not obey any more, though its link lives: a pilot flies it, or it
    has gone into a mode of its own; None while it obeys. Meanwhile the link sends no command, until
    somebody asks for the vehicle back (`reclaim`). `armed`: whether its rotors may turn, as the
    vehicle says; None where it says nothing, and they rest when they are told to. `is_heard`:
    whether what was read last has something of the vehicle itself in it, and not only what a
    simulator gives beside it.
    """

    rig: Rig | None = None
    taken: Taken | None = None
    armed: bool | None = None
    is_heard: bool = True

    @abstractmethod
    def read(self, now: Time) -> Sequence[Measurement]:
        """The measurements that arrived since the last call, oldest first. One that is later than
        `now` by more than 5 ms is left out, and told. Raises DriverError."""

    @abstractmethod
    def send(self, command: Command, now: Time) -> None:
        """Hand over the newest command. Raises DriverError."""

    def arm(self, command: Command, now: Time) -> bool:
        """Get ready to obey: whether the rotors turn and commands are followed. Called once a tick,
        in place of `send`, from the first armed command on until it returns True; the behavior's
        time stands still meanwhile. command: what is asked of the vehicle then. Raises Refused with
        the vehicle's own words when it won't; DriverError."""
        return True

    def cut(self, now: Time) -> None:  # noqa: B027 - where rotors rest at once without a word
        """The rotors are to stop at once, in the air too. Called in the tick in which they are to;
        commands that aren't armed follow."""

    def tell(self, estimate: Estimate, now: Time) -> None:  # noqa: B027 - most see for themselves
        """Where the vehicle is as somebody outside it knows, once a tick while somebody does."""

    def checks(self, now: Time) -> Sequence[Check]:
        """What the vehicle itself has to say before take-off, asked once a tick until all is
        well."""
        return ()

    def said(self) -> Sequence[Said]:
        """What the vehicle said of itself since the last call, oldest first; each thing once."""
        return ()

    def reclaim(self, now: Time) -> None:  # noqa: B027 - most are never taken
        """Ask for a vehicle back that was `taken`. One that does not come says why in `refused`."""

    def land(self, now: Time) -> bool:
        """Land by the land mode of the vehicle itself; whether it is on the ground and its rotors
        rest. Called instead of `send`, once a tick, while the failsafe lands a vehicle whose driver
        `lands`; the first call begins the mode, the next `send` ends it. Raises Refused when the
        vehicle won't, or does not any more, with its own words; DriverError."""
        raise Refused("it has no land mode")

    def grip(self, is_open: bool, now: Time) -> None:
        """Open or close the servo that holds the payload, on the channel that its context says.
        Called every tick until a Payload measurement acknowledges it, so that nothing is lost on a
        bad link; a link sends again as often as its protocol wants. Raises Refused when the vehicle
        won't, with its own words; DriverError."""
        raise Refused("it has no servo for a payload")

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:  # noqa: B027 - most have one rate
        """From now on deliver at least these kinds, where the driver provides them. A link may
        deliver all that it has at all times."""

    def truth(self) -> Truth | None:
        """The simulator's truth, for the recorder and the expectations; None on hardware."""
        return None

    def view(self) -> Truth | None:
        """Where a simulated camera sees from: the vehicle's truth, or another's where a fault has
        exchanged their cameras; None on hardware."""
        return self.truth()

    def collisions(self) -> Sequence[str]:
        """What the vehicle ran into in the air since the last call, as the simulator knows; for the
        recorder and the expectations."""
        return ()


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
    they measure. `patience`: seconds in which its vehicles must have become ready to fly.
    `targets`: the targets that every mission has on it without a word, each with the driver's
    parameters there."""

    kind = "drivers"
    accepts: ClassVar[frozenset[CommandKind]]
    provides: ClassVar[frozenset[MeasurementKind]]
    simulated: ClassVar[bool] = False
    lands: ClassVar[bool] = False
    lands_blind: ClassVar[bool] = False
    grips: ClassVar[bool] = False
    brings: ClassVar[tuple[str, ...]] = ()
    patience: ClassVar[float] = 5.0
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
