"""Drivers: the vehicles that a mission flies, in simulation or over a protocol."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import CommandKind, MeasurementKind, Time
from kybflow.parts.base import Claim, Objection, P, Part
from kybflow.parts.link import Link, SimulatedScene
from kybflow.world.vehicle_context import Airframe, InnerLoop, Parcel, VehicleContext

if TYPE_CHECKING:
    import random


class Seat(NamedTuple):
    """A vehicle for a driver to open: its context and the driver's parameters for it."""

    context: VehicleContext
    params: Any


class Charge(NamedTuple):
    """The initial charge of a battery. parameter: the driver's parameter that sets it. share: the
    charge as a share of a full battery."""

    parameter: str
    share: float


class Air(NamedTuple):
    """The disturbances of a simulated lab. wind: steady, m/s, world frame. gust: standard deviation
    of the wind along each axis, m/s. force: standard deviation of the random force along each axis
    over the vehicle's mass, m/s^2."""

    wind: Vec3 = ZERO
    gust: float = 0.0
    force: float = 0.0


class MeasuredPositions(NamedTuple):
    """The positions that a driver measures, as by GPS: their delay and the time between two, s, and
    the standard deviation along the worst axis, m."""

    latency: float
    period: float
    error: float


class Act(NamedTuple):
    """An act that a vehicle can perform on request, apart from flying its mission. moves: whether
    the vehicle moves by itself and doesn't follow commands meanwhile. needs: the driver's parameter
    that must be true for it, None if there is none."""

    moves: bool = False
    needs: str | None = None


class Session(ABC):
    """An open driver. links: the links of its vehicles, by name. scene: the objects of its
    simulator, None if there is none."""

    links: dict[str, Link]
    scene: SimulatedScene | None = None

    @abstractmethod
    def advance(self, now: Time) -> None:
        """Advance the session to `now`; a simulation steps its physics. Raises DriverError."""

    @abstractmethod
    def close(self) -> None:
        """Close the links and release all their resources."""


class Driver(Part[P]):
    """Connects to the vehicles that use this driver.

    accepts: kinds of command that the vehicles follow. provides: kinds of measurement. streams_imu:
    the IMU arrives, some 25 times a second, even if nothing subscribes to it. simulated:
    the vehicles are simulated and can have faults. lands: the vehicles have a land mode, and their
    links implement `Lands`. lands_blind: the land mode needs no position; it also lands a vehicle
    that doesn't accept the commands of the built-in state `land_blind`. grips: the vehicles may
    have a servo that holds a payload, and their links implement `Grips`. acts: the acts that the
    vehicles perform, by name; if there are any, the links implement `Performs`. shared: a pilot or
    another program may command the vehicles too. brings: sensors that the compiler adds if an
    estimator needs their measurements. moves_objects: the objects of the world move in its
    simulator (`Session.scene`). preflight_timeout: seconds in which the vehicles must become ready
    to fly. caps: what the vehicles themselves limit (`tilt` and `climb` as an airframe does, and
    `height` above the start), each with the driver's parameter that sets the limit. bodies: the
    range of the airframe's parameters that the driver's vehicles have, if it flies only one model.
    targets: targets that every mission has without declaring them, each with the driver's
    parameters.
    """

    kind = "drivers"
    helpers = frozenset({"emulation"})
    accepts: ClassVar[frozenset[CommandKind]]
    provides: ClassVar[frozenset[MeasurementKind]]
    streams_imu: ClassVar[bool] = False
    simulated: ClassVar[bool] = False
    lands: ClassVar[bool] = False
    lands_blind: ClassVar[bool] = False
    grips: ClassVar[bool] = False
    acts: ClassVar[Mapping[str, Act]] = {}
    shared: ClassVar[bool] = True
    brings: ClassVar[tuple[str, ...]] = ()
    moves_objects: ClassVar[bool] = False
    preflight_timeout: ClassVar[float] = 5.0
    caps: ClassVar[Mapping[str, str]] = {}
    bodies: ClassVar[Mapping[str, tuple[float, float]]] = {}
    targets: ClassVar[Mapping[str, Mapping[str, str | bool]]] = {}

    @classmethod
    def takes(cls, params: P) -> frozenset[CommandKind]:
        """Return the kinds in `accepts` that the vehicles follow with these parameters."""
        return cls.accepts

    @classmethod
    def tracker(cls, params: P) -> Mapping[str, str] | None:
        """Return the tracker that replaces the mission's unless the target names one, in the form
        of YAML: `use` and its parameters. None keeps the mission's tracker."""
        return None

    @classmethod
    def shows(cls, params: P) -> bool:
        """Return whether the links report a simulator's truth, which simulated sensors observe."""
        return cls.simulated

    @classmethod
    def objection(cls, params: P, start: Vec3, payload: Parcel | None) -> Objection | None:
        """Return why the driver can't work with these parameters, or can't fly a vehicle with this
        `start` (metres, world frame) and `payload`; None if it can. The objection may name a
        parameter of the driver or of the vehicle."""
        return None

    @classmethod
    def claim(cls, params: P, vehicle: str, number: int) -> Claim | None:
        """Return what this vehicle uses that no other vehicle may use, None if there is nothing.
        number: the vehicle's number among those of this driver, from 1."""
        return None

    @classmethod
    @abstractmethod
    def open(cls, seats: Sequence[Seat], generator: random.Random) -> Session:
        """Open all vehicles of `seats` in one session. All randomness comes from `generator`.
        Raises DriverError."""

    @classmethod
    def watchdog(cls, params: P) -> str | None:
        """Return why the vehicle's own watchdog, which should land it if this program dies, is
        dangerous, or None if it isn't. The reason makes the preflight check fail."""
        return None

    @classmethod
    def real_time(cls, params: P) -> bool:
        """Return whether its simulated vehicles need a real-time clock, for example because they
        are reached over sockets."""
        return False

    @classmethod
    def world(cls, params: P) -> str | None:
        """Return a short name of the simulated world of a vehicle with these parameters, to which
        the reported flight figures apply; None for a real vehicle."""
        return None

    @classmethod
    def inner_loop(cls, params: P, airframe: Airframe) -> InnerLoop | None:
        """Return the inner loop that follows a tracker's commands on `airframe`, from which gains
        are designed; None if unknown."""
        return None

    @classmethod
    def positions(cls, params: P) -> MeasuredPositions | None:
        """Return how late, how often and how exactly positions are measured; None if unknown."""
        return None

    @classmethod
    def pose_error(cls, params: P) -> float:
        """Return the standard deviation of a pose's position along each axis, m; 0 if unknown."""
        return 0.0

    @classmethod
    def air(cls, params: P) -> Air:
        """Return the disturbances of the simulated lab; those of a real one are unknown."""
        return Air()

    @classmethod
    def charge(cls, params: P) -> Charge | None:
        """Return the initial charge of a vehicle's battery, None if unknown."""
        return None

    @classmethod
    def control_rate(cls, params: P) -> int:
        """Return the default control rate of the vehicles, Hz. A mission without `control` uses the
        highest rate of its vehicles."""
        return 125

    @classmethod
    def step_rate(cls, params: P) -> float | None:
        """Return the rate (Hz) that the control rate must divide, None if there is none."""
        return None
