"""What a part is: one base class for each kind.

A part is one file with its docstring, its `@params` and its class; the file name is the name used
in YAML. Parts are
passive: none sleeps, starts a thread, prints, reads a clock or draws from a global generator.
`self.params` is replaced as a whole when an option changes, between ticks; read it in every update.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

from kybflow.geometry import Vec3, distance, heading_of
from kybflow.params import Field, fields_of, param, params
from kybflow.signals import (
    Alarm,
    Command,
    CommandKind,
    Done,
    Estimate,
    Failed,
    Measurement,
    MeasurementKind,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
    Truth,
)
from kybflow.site import Box, Site

if TYPE_CHECKING:
    import random

__all__ = [
    "AIR", "GROUND", "MOVING", "Behavior", "Driver", "Entry", "Estimator", "Field", "Flight",
    "Footprint", "Leg", "Link", "Part", "Processor", "Seat", "Session", "Supervisor", "Tracker",
    "fields_of", "param", "params",
]  # fmt: skip

P = TypeVar("P")


class Part(ABC, Generic[P]):
    """The root of every part. `kind` is the plural that names its folder and its group in the
    catalog. `events` are the events that its alarms become."""

    kind: ClassVar[str]
    events: ClassVar[tuple[str, ...]] = ()
    params: P


class Flight(Enum):
    """Where a vehicle is between behaviors. MOVING is neither: a take-off or a landing was left
    before its end."""

    GROUND = "ground"
    AIR = "air"
    MOVING = "moving"

    def __rshift__(self, end: Flight) -> Leg:
        return Leg(self, end)


class Leg(NamedTuple):
    """One flight type of a behavior: it may begin at `start`, and its normal end leaves the vehicle
    at `end`."""

    start: Flight
    end: Flight


GROUND, AIR, MOVING = Flight.GROUND, Flight.AIR, Flight.MOVING


class Entry(NamedTuple):
    """What a behavior is entered with. setpoint: the last one that the tracker followed, None on
    the ground.

    hover_thrust: newtons that the tracker believes hold the vehicle now. flight: where the vehicle
    is; a missing setpoint does not mean that it is on the ground.
    """

    now: Time
    site: Site
    estimate: Estimate | None
    setpoint: Setpoint | None
    hover_thrust: float
    flight: Flight = Flight.AIR

    @property
    def position(self) -> Vec3:
        """Where the new behavior begins: the last setpoint where the vehicle follows one (within
        0.3 m), else the estimate, else the start. Beginning at the setpoint leaves no step in the
        trajectory."""
        wanted = self.setpoint.position if self.setpoint else None
        if self.estimate is None:
            return wanted or self.site.start
        if wanted is not None and distance(wanted, self.estimate.position) < 0.3:
            return wanted
        return self.estimate.position

    @property
    def heading(self) -> float:
        """The heading to hold: the last setpoint's, else the estimate's, else the start's.
        Radians."""
        if self.setpoint is not None and self.setpoint.heading is not None:
            return self.setpoint.heading
        return heading_of(self.estimate.attitude) if self.estimate else self.site.heading


class Footprint(NamedTuple):
    """Where a behavior will go, for the static checks: `points` bound its path (metres, world),
    `speed` is its fastest (m/s), `exit` where its normal end leaves the vehicle, None when it can't
    be told; `is_endless` when it has no normal end; `acceleration` is the largest horizontal one
    that its curves need (m/s^2)."""

    points: tuple[Vec3, ...]
    speed: float
    exit: Vec3 | None
    is_endless: bool = False
    acceleration: float = 0.0


class Behavior(Part[P]):
    """Decides where the vehicle should be. Made when its state is entered, dropped when it is left.

    The constructor may raise Refused with a reason. The engine calls `update` once a tick while the
    state is active; it returns a Setpoint, or Done or Failed with the last one (or a Command, when
    it `emits` a kind of command, to steer the on-board controller without tracker and estimate).
    Whatever it raises fails its vehicle into the failsafe, as does an IDLE setpoint in the air.
    """

    kind = "behaviors"
    flight: ClassVar[tuple[Leg, ...]]
    emits: ClassVar[SetpointKind | CommandKind]
    needs_estimate: ClassVar[bool] = True

    def __init_subclass__(
        cls,
        *,
        flight: Leg | tuple[Leg, ...],
        emits: SetpointKind | CommandKind,
        needs_estimate: bool = True,
        **rest: Any,
    ) -> None:
        super().__init_subclass__(**rest)
        cls.flight = (flight,) if isinstance(flight, Leg) else flight
        cls.emits = emits
        cls.needs_estimate = needs_estimate

    def __init__(self, params: P, entry: Entry) -> None:
        self.params = params

    @abstractmethod
    def update(self, tick: Tick) -> Setpoint | Command | Done | Failed:
        """The setpoint at `tick.now`."""

    @classmethod
    def footprint(cls, params: P, entry: Vec3 | None) -> Footprint | None:
        """Where it goes when entered at `entry` (None: unknown); None when it can't be told."""
        return None


class Estimator(Part[P]):
    """Turns measurements into an estimate. Lives as long as its vehicle.

    Called once a tick with every measurement that arrived since the last tick, oldest first, of
    whatever kind; `needs` are the kinds without which it can't work. Returns the estimate at `now`,
    or None as long as it has none. One that raises is not asked again, and its vehicle lands.
    """

    kind = "estimators"
    needs: ClassVar[frozenset[MeasurementKind]]

    def __init__(self, params: P, site: Site) -> None:
        self.params = params

    @abstractmethod
    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None: ...


class Processor(Part[P]):
    """Bends a setpoint on its way to the tracker; a callable. Made anew at each take-off.

    `accepts` maps each kind of setpoint that it takes to the kind it returns. Called once a tick,
    in the order of the mission, while a behavior with an estimate flies; `safety` ones from take-
    off to touch-down, the others only in behaviors that stay in the air. Returns the setpoint, or
    an Alarm that asks for a reaction. One that raises is left out, and its vehicle lands.
    """

    kind = "processors"
    accepts: ClassVar[dict[SetpointKind, SetpointKind]]
    safety: ClassVar[bool] = False

    def __init__(self, params: P, site: Site) -> None:
        self.params = params

    @classmethod
    def keeps_inside(cls, params: P, fence: Box) -> Box | None:
        """The box inside `fence` that no setpoint leaves; None when it bounds none."""
        return None

    @abstractmethod
    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Alarm: ...


class Tracker(Part[P]):
    """Turns a setpoint into a command. Made anew at each take-off. `accepts` kinds of setpoint,
    `gives` a command."""

    kind = "trackers"
    accepts: ClassVar[frozenset[SetpointKind]]
    gives: ClassVar[CommandKind]

    def __init__(self, params: P, site: Site) -> None:
        self.params = params

    @property
    @abstractmethod
    def hover_thrust(self) -> float:
        """Newtons that it believes hold the vehicle now."""

    @abstractmethod
    def update(self, setpoint: Setpoint, tick: Tick) -> Command: ...


class Supervisor(Part[P]):
    """Watches one bound and reports; it never acts. Lives as long as its vehicle; `always` ones are
    in every vehicle, named in the mission or not. Called once a tick, before anything else is
    decided. One that raises is not asked again, and its vehicle lands."""

    kind = "supervisors"
    always: ClassVar[bool] = False

    def __init__(self, params: P, site: Site) -> None:
        self.params = params

    @abstractmethod
    def check(self, tick: Tick, airborne: bool) -> Alarm | None: ...


class Seat(NamedTuple):
    """One vehicle that a driver is to open: its place in the world and the driver's parameters for
    it."""

    site: Site
    params: Any


class Link(ABC):
    """One vehicle's connection. The engine reads and sends once a tick."""

    @abstractmethod
    def read(self, now: Time) -> Sequence[Measurement]:
        """The measurements that arrived since the last call, oldest first. Raises DriverError."""

    @abstractmethod
    def send(self, command: Command, now: Time) -> None:
        """Hand over the newest command. Raises DriverError."""

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
