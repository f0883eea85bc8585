"""Behaviors, the data that a behavior receives on entry, and the footprint of its path."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Any, ClassVar, NamedTuple

from kybflow.core.events import Emitting
from kybflow.core.geometry import GRAVITY, ZERO, Vec3, add, distance, heading_of, scale
from kybflow.core.params import names_in
from kybflow.core.signals import (
    NO_INPUTS,
    Command,
    CommandKind,
    Done,
    Estimate,
    Failed,
    Grip,
    Imu,
    InertialMotion,
    InputReadings,
    Measurement,
    MeasurementKind,
    PlannedPoint,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
)
from kybflow.flight.motion import Motion, Pace
from kybflow.parts.base import Objection, P, Part
from kybflow.world.vehicle_context import VehicleContext

SPEED_SHARE = 0.95
"""The share of the airframe's speed limit that a planned motion may use; the rest is left for
tracking."""


class Flight(Enum):
    """Where a vehicle is between two behaviors. MOVING: a take-off or a landing ended early, so the
    vehicle may be on the ground or in the air."""

    GROUND = "ground"
    AIR = "air"
    MOVING = "moving"

    def __rshift__(self, end: Flight) -> Leg:
        return Leg(self, end)


class Leg(NamedTuple):
    """A flight type, `start >> end`: where the vehicle is when a behavior begins, and where it is
    at the behavior's normal end."""

    start: Flight
    end: Flight


GROUND, AIR, MOVING = Flight.GROUND, Flight.AIR, Flight.MOVING


class Entry(NamedTuple):
    """The situation in which a behavior is entered.

    setpoint: the last setpoint that the tracker followed; None on the ground, while commands are
    late, and sometimes in the air, so use `flight` to tell where the vehicle is. hover_thrust: the
    tracker's estimate of the hover thrust, newtons. resting_force: the specific force along body z
    that the IMU measured at rest on the ground, m/s^2; gravity if unknown. inputs: the current
    readings of the mission's inputs. lost: where there is no estimate, the last one before it was
    lost. imu_motion: the motion by the IMU alone if the frame of the estimate is wrong; None
    otherwise. imu: the newest IMU measurement, None without one. late: by how much later than usual
    commands take effect, s. lean: the slope at which the tracker held the vehicle still
    (`Tracker.lean`).
    """

    now: Time
    context: VehicleContext
    estimate: Estimate | None
    setpoint: Setpoint | None
    hover_thrust: float
    flight: Flight = Flight.AIR
    resting_force: float = GRAVITY
    inputs: InputReadings = NO_INPUTS
    lost: Estimate | None = None
    imu_motion: InertialMotion | None = None
    imu: Imu | None = None
    late: float = 0.0
    lean: tuple[float, float] = (0.0, 0.0)

    @property
    def known(self) -> Estimate | None:
        """The estimate, or the last one before it was lost."""
        return self.estimate or self.lost

    @property
    def position(self) -> Vec3:
        """The position at which the behavior begins, metres, world frame: the last setpoint if the
        vehicle is within 0.3 m of it, so that the trajectory has no step; else the estimate, or the
        last one. If there was none it is the last setpoint, else the vehicle's start."""
        wanted, known = self.setpoint.position if self.setpoint else None, self.known
        if known is None:
            return wanted or self.context.start
        if wanted is not None and distance(wanted, known.position) < 0.3:
            return wanted
        return known.position

    @property
    def heading(self) -> float:
        """The heading to hold, radians: that of the setpoint, else of the estimate or of the
        last one, else of the start."""
        if self.setpoint is not None and self.setpoint.heading is not None:
            return self.setpoint.heading
        known = self.known
        return heading_of(known.attitude) if known else self.context.heading

    @property
    def motion(self) -> Motion:
        """Position and velocity at `now`. If `position` is the last setpoint's, both are the
        setpoint's, advanced by one tick; else they are `position` and the velocity of the estimate,
        or of the last one."""
        wanted, known = self.setpoint, self.known
        if wanted is not None and wanted.velocity is not None and wanted.position == self.position:
            moved = scale(wanted.velocity, self.context.dt)
            return Motion(add(self.position, moved), wanted.velocity)
        return Motion(self.position, known.velocity if known else ZERO)

    def cruise_speed(self, wanted: float) -> float:
        """Return `wanted` (m/s), limited to `SPEED_SHARE` of the airframe's speed limit."""
        return min(wanted, SPEED_SHARE * self.context.airframe.speed)


class Origin(NamedTuple):
    """Source lines, as `file:line`, of a footprint's points, its fastest point and its sharpest
    curve."""

    points: Mapping[Vec3, str]
    fastest: str
    sharpest: str


class Footprint(NamedTuple):
    """Where a behavior will fly, in the world frame; the compiler checks it.

    points: points that bound the path, metres. speed: the highest speed, m/s. exit: the position of
    the vehicle at the behavior's normal end, None if unknown. is_endless: the behavior has no
    normal end. acceleration: the largest horizontal acceleration in its curves, m/s^2. path:
    corners of a polyline within 1 cm of the path; empty if unknown, except that two `points` are
    themselves the path. origin: the source lines of a path that is read from a file. duration: the
    least time from an entry at rest to the normal end, s; if None, `least_time` computes it.
    longest: the time after which the behavior has ended in any case, s, None if unknown. goals:
    positions that the vehicle must have reached for the behavior to go on, each with its tolerance,
    m.
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
        else the time for the straight line to `exit` at `speed`, else zero."""
        if self.duration is not None:
            return self.duration
        if entry is None or self.exit is None or self.speed <= 0.0:
            return 0.0
        return distance(entry, self.exit) / self.speed

    def line_of(self, point: Vec3) -> tuple[str, ...]:
        """Return a note that names the line of the path's file nearest to `point`; empty if the
        path isn't read from a file."""
        if self.origin is None or not self.origin.points:
            return ()
        nearest = min(self.origin.points, key=lambda p: distance(p, point))
        return (f"led there by {self.origin.points[nearest]}",)


class Behavior(Part[P]):
    """Decides where the vehicle should be. Exists while its state is active.

    The constructor may raise Refused with a reason. If `update` raises, or returns an IDLE setpoint
    in the air, the failsafe takes over the vehicle.

    flight: the flight types of the behavior. emits: the kind of setpoint or of command that
    `update` returns. needs_estimate: whether it can fly only with an estimate. needs: kinds of
    measurement to subscribe to while it is active, if the driver provides them. grips: whether
    `update` may return a Grip. waits_for: a description of the obstacle or event that it waits for,
    emitted in `behavior_waits`; None while it isn't waiting. lets_go: whether no command is sent
    now, so that the vehicle's own watchdog lands it. axes: the axes that the inputs named by its
    parameters must have. push: the force on the hand of the person who steers, along the axes x, y
    and z. hears: whether it receives the messages of other vehicles. agreed: the
    parameters that must be equal for all members of the group that fly it together. says: the
    message that its latest update publishes to them, recorded as a measurement of its class.
    keeps_pace: whether it flies one straight line at a `pace` and accepts a slower one by `keep`,
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
    agreed: ClassVar[tuple[str, ...]] = ()
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
        """Return the setpoint at `tick.now`, or Done or Failed with the last setpoint. Called once
        a tick. A behavior that `emits` commands returns a Command, which bypasses the tracker; one
        that `grips` may return a Grip, and one with `own_events` an Emitting."""

    def take(self, point: PlannedPoint, now: Time) -> str | None:
        """Accept a point of an external planner's trajectory, before the update of a tick. Return
        why the point is refused, or None if it is accepted."""
        return "its behavior takes no trajectory"

    def keep(self, pace: Pace) -> None:
        """Fly at the given pace, no faster than the behavior's own, from the second update on.
        Called after the first update if the behavior has `keeps_pace`."""
        raise NotImplementedError

    @classmethod
    def objections(cls, params: P, context: VehicleContext) -> Iterator[Objection]:
        """Yield why these parameters make no sense for the vehicle of `context`."""
        yield from ()

    @classmethod
    def footprint(cls, params: P, entry: Vec3 | None) -> Footprint | None:
        """Return where the behavior flies if it is entered at `entry` (world frame, None if
        unknown), or None if that is unknown."""
        return None

    @classmethod
    def pushes(cls, params: P) -> tuple[str, float | None] | None:
        """Return the surface, `OBJECT.SURFACE`, against which the behavior presses and its force,
        N, or None if a coordinator gives the force; None if it presses against nothing."""
        return None

    @classmethod
    def touches(cls, params: P) -> str:
        """Return the object that the behavior means to touch, empty for none: that of the surface
        which a parameter names. Guards don't keep the vehicle away from it, and touching it is no
        collision."""
        return next((path.partition(".")[0] for _, path in names_in(params, "surface")), "")

    @classmethod
    def objection(cls, params: P, entry: Entry) -> str | None:
        """Return why no `next` and no request may enter the behavior now, so that the vehicle stays
        in its present one; None if they may."""
        return None

    @classmethod
    def refusal(cls, params: P, entry: Vec3) -> str | None:
        """Return why the behavior would refuse to start at rest at `entry` (world frame), or None
        if it would start."""
        return None
