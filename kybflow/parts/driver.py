"""Drivers: the vehicles that a mission flies, in simulation or over a protocol."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from kybflow.core.geometry import Vec3
from kybflow.core.signals import CommandKind, MeasurementKind, Time
from kybflow.parts.base import Claim, Objection, P, Part
from kybflow.parts.link import Link
from kybflow.world.inner_loop import InnerLoop
from kybflow.world.vehicle_context import Airframe, Parcel, VehicleContext

if TYPE_CHECKING:
    import random


class Seat(NamedTuple):
    """One vehicle that a driver should open: its context and the driver's parameters for it."""

    context: VehicleContext
    params: Any


class Charge(NamedTuple):
    """The charge with which a battery begins: the driver's parameter that says it, and its share of
    a full one."""

    parameter: str
    share: float


class Act(NamedTuple):
    """What a vehicle can perform on request, beside flying its mission. moves: it doesn't follow
    commands meanwhile. needs: the driver's parameter that must be true for it; None if there is
    none."""

    moves: bool = False
    needs: str | None = None


class Session(ABC):
    """An open driver: the links of its vehicles, by name, and the world's time."""

    links: dict[str, Link]

    @abstractmethod
    def advance(self, now: Time) -> None:
        """Advance the world to `now`; a simulation steps its physics. Raises DriverError."""

    @abstractmethod
    def close(self) -> None:
        """Release the links and everything behind them."""


class Driver(Part[P]):
    """Connects to the vehicles that fly on it.

    accepts: kinds of command. provides: kinds of measurement. simulated: its vehicles are simulated
    and can have faults. lands: its vehicles have a land mode, and their links are `Lands`.
    lands_blind: that mode needs no position, and lands a vehicle that doesn't take the commands of
    the built-in state `land_blind`. grips: its vehicles may have a servo that holds a payload, and
    their links are `Grips`. acts: what its vehicles perform, by name; their links are `Performs`
    then. shared: a pilot or another program may command its vehicles too.
    brings: sensors that the compiler adds if an estimator needs what they measure.
    preflight_timeout: seconds in which its vehicles must become ready to fly. targets: targets that
    every mission has without declaring them, each with the driver's parameters.
    """

    kind = "drivers"
    helpers = frozenset({"emulation"})
    accepts: ClassVar[frozenset[CommandKind]]
    provides: ClassVar[frozenset[MeasurementKind]]
    simulated: ClassVar[bool] = False
    lands: ClassVar[bool] = False
    lands_blind: ClassVar[bool] = False
    grips: ClassVar[bool] = False
    acts: ClassVar[Mapping[str, Act]] = {}
    shared: ClassVar[bool] = True
    brings: ClassVar[tuple[str, ...]] = ()
    preflight_timeout: ClassVar[float] = 5.0
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {}

    @classmethod
    def takes(cls, params: P) -> frozenset[CommandKind]:
        """Return the kinds in `accepts` that its vehicles follow with these parameters."""
        return cls.accepts

    @classmethod
    def tracker(cls, params: P) -> Mapping[str, str] | None:
        """Return the tracker that replaces the mission's, unless the target names one, as YAML
        would: `use` and its parameters. None keeps the mission's."""
        return None

    @classmethod
    def shows(cls, params: P) -> bool:
        """Return whether its links report a simulator's truth, which simulated sensors observe."""
        return cls.simulated

    @classmethod
    def objection(cls, params: P, start: Vec3, payload: Parcel | None) -> Objection | None:
        """Return why it can't work with these parameters or fly a vehicle that starts at `start`,
        m, world, and has `payload`; None if it can. The objection's parameter may be the
        vehicle's."""
        return None

    @classmethod
    def claim(cls, params: P, vehicle: str, number: int) -> Claim | None:
        """Return what no other vehicle may have; `number` is the vehicle's place among those of
        this driver, from 1. None if there is nothing."""
        return None

    @classmethod
    @abstractmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        """Open every vehicle of `seats` in one session; all randomness comes from `generator`.
        Raises DriverError."""

    @classmethod
    def watchdog(cls, params: P) -> str | None:
        """Return what is dangerous about the vehicle's own watchdog, which lands it if this program
        dies; None if nothing is. The preflight fails with this reason."""
        return None

    @classmethod
    def real_time(cls, params: P) -> bool:
        """Return whether its simulated vehicles need a real-time clock, as behind sockets."""
        return False

    @classmethod
    def world(cls, params: P) -> str | None:
        """Return in a few words the simulated world of a vehicle with these parameters, for which
        the figures of the flight hold; None in reality."""
        return None

    @classmethod
    def inner_loop(cls, params: P, airframe: Airframe) -> InnerLoop | None:
        """Return the inner loop that follows a tracker's commands on `airframe`, for the design of
        gains; None where it isn't known."""
        return None

    @classmethod
    def charge(cls, params: P) -> Charge | None:
        """Return the charge with which a vehicle's battery begins; None where it isn't known."""
        return None

    @classmethod
    def control_rate(cls, params: P) -> int:
        """Return the default control rate of its vehicles, Hz. A mission without `control` flies
        at the highest of its vehicles."""
        return 250

    @classmethod
    def step_rate(cls, params: P) -> float | None:
        """Return the rate (Hz) that the control rate must divide, None if there is none."""
        return None
