"""Behaviors, the context in which one is entered, and the footprint of its path."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Any, ClassVar, NamedTuple

from kybflow.core.events import Emitting
from kybflow.core.geometry import GRAVITY, ZERO, Vec3, add, distance, heading_of, scale
from kybflow.core.signals import (
    NO_INPUTS,
    Command,
    CommandKind,
    Done,
    Estimate,
    Failed,
    Grip,
    InputReadings,
    Measurement,
    MeasurementKind,
    PlannedPoint,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
)
from kybflow.flight.motion import Motion
from kybflow.flight.profiles import Pace
from kybflow.parts.base import Objection, P, Part
from kybflow.world.vehicle_context import VehicleContext

SPEED_SHARE = 0.95
"""The share of the airframe's speed limit that a planned motion may use; tracking has the rest."""


class Flight(Enum):
    """Where a vehicle is between behaviors. MOVING: a take-off or a landing was left before its
    end, so it may be on the ground or in the air."""

    GROUND = "ground"
    AIR = "air"
    MOVING = "moving"

    def __rshift__(self, end: Flight) -> Leg:
        return Leg(self, end)


class Leg(NamedTuple):
    """A flight type, `start >> end`: where a behavior may begin, and where its normal end is."""

    start: Flight
    end: Flight


GROUND, AIR, MOVING = Flight.GROUND, Flight.AIR, Flight.MOVING


class Entry(NamedTuple):
    """What a behavior knows when it is entered.

    setpoint: the last one that the tracker followed, None on the ground (and sometimes in the air:
    `flight` says where the vehicle is). hover_thrust: the tracker's estimate of the thrust that
    holds the vehicle, newtons. resting_force: the specific force along body z that the IMU
    measured at rest on the ground, m/s^2; gravity if unknown.
    inputs: what the mission's inputs say.
    """

    now: Time
    context: VehicleContext
    estimate: Estimate | None
    setpoint: Setpoint | None
    hover_thrust: float
    flight: Flight = Flight.AIR
    resting_force: float = GRAVITY
    inputs: InputReadings = NO_INPUTS

    @property
    def position(self) -> Vec3:
        """Where the behavior begins: the last setpoint if the vehicle is within 0.3 m of it, which
        leaves no step in the trajectory; else the estimate; else the vehicle's start. Without an
        estimate the setpoint counts at any distance."""
        wanted = self.setpoint.position if self.setpoint else None
        if self.estimate is None:
            return wanted or self.context.start
        if wanted is not None and distance(wanted, self.estimate.position) < 0.3:
            return wanted
        return self.estimate.position

    @property
    def heading(self) -> float:
        """The heading to hold, radians: the setpoint's, else the estimate's, else the start's."""
        if self.setpoint is not None and self.setpoint.heading is not None:
            return self.setpoint.heading
        return heading_of(self.estimate.attitude) if self.estimate else self.context.heading

    @property
    def motion(self) -> Motion:
        """Position and velocity at `now`: the last setpoint's, advanced by one tick, if `position`
        is the setpoint's; else `position` with the estimate's velocity."""
        wanted = self.setpoint
        if wanted is not None and wanted.velocity is not None and wanted.position == self.position:
            moved = scale(wanted.velocity, self.context.dt)
            return Motion(add(self.position, moved), wanted.velocity)
        return Motion(self.position, self.estimate.velocity if self.estimate else ZERO)

    def cruise_speed(self, wanted: float) -> float:
        """Return `wanted` (m/s), limited to `SPEED_SHARE` of the airframe's speed limit."""
        return min(wanted, SPEED_SHARE * self.context.airframe.speed)


class Origin(NamedTuple):
    """`file:line` of each of a footprint's points, of its fastest and its sharpest place."""

    points: Mapping[Vec3, str]
    fastest: str
    sharpest: str


class Footprint(NamedTuple):
    """Where a behavior will fly, for the compiler's checks, in the world frame.

    points: bound its path, metres. speed: its largest, m/s. exit: where its normal end leaves the
    vehicle, None if unknown. is_endless: it has no normal end. acceleration: the largest horizontal
    one that its curves need, m/s^2. path: corners of a polyline within 1 cm of the path, empty if
    unknown (but two `points` are the path). origin: where a path from a file is described.
    duration: the least time from an entry at rest to its normal end, s; None: see `least_time`.
    longest: the time after which it has ended in any case, s, None if unknown. goals: the places
    that it must have reached to go on, each with the distance (m) within which it has.
    """

    points: tuple[Vec3, ...]
    speed: float
    exit: Vec3 | None
    is_endless: bool = False
    acceleration: float = 0.0
    path: tuple[Vec3, ...] = ()
    origin: Origin | None = None
    duration: float | None = None
    longest: float | None = None
    goals: tuple[tuple[Vec3, float], ...] = ()

    def least_time(self, entry: Vec3 | None) -> float:
        """Return a lower bound (s) of the time from an entry at rest to the normal end: `duration`,
        else the straight line to `exit` at `speed`, else zero."""
        if self.duration is not None:
            return self.duration
        if entry is None or self.exit is None or self.speed <= 0.0:
            return 0.0
        return distance(entry, self.exit) / self.speed

    def line_of(self, point: Vec3) -> tuple[str, ...]:
        """Return a note with the line of the file that leads to `point`; empty without a file."""
        if self.origin is None or not self.origin.points:
            return ()
        nearest = min(self.origin.points, key=lambda p: distance(p, point))
        return (f"led there by {self.origin.points[nearest]}",)


class Behavior(Part[P]):
    """Decides where the vehicle should be; it lives while its state is active.

    The constructor may raise Refused with a reason. An exception of `update`, or an IDLE setpoint
    in the air, hands the vehicle to the failsafe.

    flight: its flight types. emits: the kind of setpoint that `update` returns, or of command.
    needs_estimate: whether it can fly only with an estimate. needs: kinds of measurement to
    subscribe to while it is active, if the driver provides them. grips: `update` may return a Grip.
    waits_for: what it waits for, in words, None while it goes on; it emits `behavior_waits`.
    lets_go: whether no command is sent now, so that the vehicle's own watchdog brings it down.
    axes: the axes that the inputs named by its parameters must have. push: the force on the hand
    that steers it, along the axes x, y and z. hears: whether it receives what other vehicles
    publish. says: what it publishes to them in its latest update, recorded as a measurement of its
    class. keeps_pace: whether it flies one straight line at a `pace` and can `keep` a slower one,
    so that several vehicles arrive together.
    """

    kind = "behaviors"
    flight: ClassVar[tuple[Leg, ...]]
    emits: ClassVar[SetpointKind | CommandKind]
    needs_estimate: ClassVar[bool] = True
    needs: ClassVar[frozenset[MeasurementKind]] = frozenset()
    grips: ClassVar[bool] = False
    waits_for: str | None = None
    lets_go: bool = False
    axes: ClassVar[tuple[str, ...]] = ()
    push: Vec3 = ZERO
    hears: ClassVar[bool] = False
    keeps_pace: ClassVar[bool] = False
    pace: Pace | None = None
    says: Measurement | None = None

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
    def update(self, tick: Tick) -> Setpoint | Command | Grip | Emitting | Done | Failed:
        """Return the setpoint at `tick.now`, or Done or Failed with the last one; called once a
        tick. A behavior that `emits` commands returns a Command, which bypasses the tracker; one
        that `grips` may return a Grip, one with `own_events` an Emitting."""

    def take(self, point: PlannedPoint, now: Time) -> str | None:
        """Take a point of an external planner's trajectory before the update of a tick; return why
        it is refused, None where it is not."""
        return "its behavior takes no trajectory"

    def keep(self, pace: Pace) -> None:
        """Fly at another pace, no quicker than its own, from the second update on. Called after the
        first update if it `keeps_pace`."""
        raise NotImplementedError

    @classmethod
    def prepare(cls) -> None:
        """Load what takes long to load. Called before take-off for behaviors with `hears`."""

    @classmethod
    def objections(cls, params: P, context: VehicleContext) -> Iterator[Objection]:
        """Yield what makes these parameters senseless for the vehicle of `context`."""
        yield from ()

    @classmethod
    def footprint(cls, params: P, entry: Vec3 | None) -> Footprint | None:
        """Return where it flies when entered at `entry` (world, None: unknown); None if unknown."""
        return None

    @classmethod
    def objection(cls, params: P, entry: Entry) -> str | None:
        """Return why no `next` and no request may enter it now, so that the vehicle stays in its
        present behavior; None if one may."""
        return None

    @classmethod
    def refusal(cls, params: P, entry: Vec3) -> str | None:
        """Return why it would refuse to start at rest at `entry` (world); None if it starts."""
        return None
