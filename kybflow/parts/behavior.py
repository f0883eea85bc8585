"""Behaviors: what they are entered with, where they leave the vehicle, where they will go."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from enum import Enum
from typing import Any, ClassVar, NamedTuple

from kybflow.core.geometry import GRAVITY, ZERO, Vec3, add, distance, heading_of, scale
from kybflow.core.signals import (
    Command,
    CommandKind,
    Done,
    Estimate,
    Failed,
    Grip,
    MeasurementKind,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
)
from kybflow.flight.motion import Motion
from kybflow.parts.base import P, Part
from kybflow.world.vehicle_context import VehicleContext

SPEED_SHARE = 0.95
"""The share of the airframe's speed limit that a planned motion uses; the rest is for tracking."""


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
    is; a missing setpoint does not mean that it is on the ground. rest: the specific force along
    body z that the IMU felt at rest on the ground, m/s^2; gravity where nobody knows.
    """

    now: Time
    context: VehicleContext
    estimate: Estimate | None
    setpoint: Setpoint | None
    hover_thrust: float
    flight: Flight = Flight.AIR
    rest: float = GRAVITY

    @property
    def position(self) -> Vec3:
        """Where the new behavior begins: the last setpoint where the vehicle follows one (within
        0.3 m), else the estimate, else the start. Beginning at the setpoint leaves no step in the
        trajectory."""
        wanted = self.setpoint.position if self.setpoint else None
        if self.estimate is None:
            return wanted or self.context.start
        if wanted is not None and distance(wanted, self.estimate.position) < 0.3:
            return wanted
        return self.estimate.position

    @property
    def heading(self) -> float:
        """The heading to hold: the last setpoint's, else the estimate's, else the start's.
        Radians."""
        if self.setpoint is not None and self.setpoint.heading is not None:
            return self.setpoint.heading
        return heading_of(self.estimate.attitude) if self.estimate else self.context.heading

    @property
    def motion(self) -> Motion:
        """The position and the velocity to begin with, at `now`: the last setpoint's where the
        vehicle follows one, gone on by the tick that has passed since; else the estimate's."""
        wanted = self.setpoint
        if wanted is not None and wanted.velocity is not None and wanted.position == self.position:
            moved = scale(wanted.velocity, self.context.dt)
            return Motion(add(self.position, moved), wanted.velocity)
        return Motion(self.position, self.estimate.velocity if self.estimate else ZERO)

    def cruise_speed(self, wanted: float) -> float:
        """`wanted`, but never more than the share of the airframe's limit that plans may use."""
        return min(wanted, SPEED_SHARE * self.context.airframe.speed)


class Origin(NamedTuple):
    """Where a file's footprint comes from, `file:line`: each of its points, where it is fastest,
    and where its curves are sharpest."""

    points: Mapping[Vec3, str]
    fastest: str
    sharpest: str


class Footprint(NamedTuple):
    """Where a behavior will go, for the static checks: `points` bound its path (metres, world),
    `speed` is its fastest (m/s), `exit` where its normal end leaves the vehicle, None when it can't
    be told; `is_endless` when it has no normal end; `acceleration` is the largest horizontal one
    that its curves need (m/s^2); `path` are points along its path, a straight line between each and
    the next (within 1 cm), none where that is not known. Of two `points` they are the path.
    `origin` says where they stand, of a path that a file describes."""

    points: tuple[Vec3, ...]
    speed: float
    exit: Vec3 | None
    is_endless: bool = False
    acceleration: float = 0.0
    path: tuple[Vec3, ...] = ()
    origin: Origin | None = None

    def line_of(self, point: Vec3) -> tuple[str, ...]:
        """Which line of a file leads to `point`, as a note; none where no file does."""
        if self.origin is None or not self.origin.points:
            return ()
        nearest = min(self.origin.points, key=lambda p: distance(p, point))
        return (f"led there by {self.origin.points[nearest]}",)


class Behavior(Part[P]):
    """Decides where the vehicle should be. Made when its state is entered, dropped when it is left.

    The constructor may raise Refused with a reason. The engine calls `update` once a tick while the
    state is active; it returns a Setpoint, or Done or Failed with the last one (or a Command, when
    it `emits` a kind of command, to steer the on-board controller without tracker and estimate; or
    a Grip, when it `grips`, to ask for the servo that holds the payload).
    Whatever it raises fails its vehicle into the failsafe, as does an IDLE setpoint in the air.
    `needs` are kinds of measurement that its vehicle subscribes to while it is active; a driver
    that doesn't provide them is no reason not to fly it.
    """

    kind = "behaviors"
    flight: ClassVar[tuple[Leg, ...]]
    emits: ClassVar[SetpointKind | CommandKind]
    needs_estimate: ClassVar[bool] = True
    needs: ClassVar[frozenset[MeasurementKind]] = frozenset()
    grips: ClassVar[bool] = False

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
    def update(self, tick: Tick) -> Setpoint | Command | Grip | Done | Failed:
        """The setpoint at `tick.now`."""

    @classmethod
    def footprint(cls, params: P, entry: Vec3 | None) -> Footprint | None:
        """Where it goes when entered at `entry` (None: unknown); None when it can't be told."""
        return None

    @classmethod
    def refusal(cls, params: P, entry: Vec3) -> str | None:
        """Why it refuses to start when entered at rest at `entry`; None when it starts."""
        return None
