"""The parts that turn a vehicle's measurements into its command (estimators, processors, trackers),
and the supervisors that watch it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.events import Emitting
from kybflow.core.signals import (
    Alarm,
    Command,
    CommandKind,
    Estimate,
    Measurement,
    MeasurementKind,
    Retune,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
)
from kybflow.parts.base import Objection, P, Part
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import Airframe, InnerLoop, VehicleContext

if TYPE_CHECKING:
    from kybflow.flight.loops.position_loop import OuterLoop
    from kybflow.flight.pose_gate import Refusal
    from kybflow.vision.locating.locator import Sighting


class Estimator(Part[P]):
    """Turns measurements into an estimate. Exists as long as its vehicle.

    An estimator that raises is not called again, and its vehicle lands.

    needs: the kinds of measurement that it can't work without. needs_tags: whether it can use
    camera frames only if the world has tags. own: whether its estimate comes from the vehicle
    itself, so that it is not sent back as an external position. sighting: what it found in the
    newest camera frames, None in most ticks. refusal: why it refuses the measured positions, None
    while it accepts them.
    """

    kind = "estimators"
    sighting: Sighting | None = None
    refusal: Refusal | None = None
    needs: ClassVar[frozenset[MeasurementKind]]
    needs_tags: ClassVar[bool] = False
    own: ClassVar[bool] = False

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def uses(cls, params: P) -> frozenset[MeasurementKind]:
        """Return those kinds of measurement in `needs` that the part requires with these
        parameters."""
        return cls.needs

    @classmethod
    def least_spread(cls, params: P, error: float) -> float:
        """Return the least spread (m) of its estimates if a measured position has this standard
        deviation along its worst axis."""
        return 0.0

    @classmethod
    def objections(cls, params: P, context: VehicleContext) -> Iterator[Objection]:
        """Yield why these parameters make no sense for the vehicle of `context`."""
        yield from ()

    @abstractmethod
    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        """Return the estimate at `now`, or None if there is none. Called once a tick with all
        measurements of any kind that arrived since the last tick, oldest first."""

    def anchor(self, estimate: Estimate) -> None:
        """Accept the estimate on which the vehicle flies, so that dead reckoning can start from it.
        Called after `update` in every tick in which another estimator is in use."""


class Processor(Part[P]):
    """Changes a setpoint on its way to the tracker. Created at each take-off.

    Processors run in the order of the mission while a behavior with an estimate flies: `safety`
    ones from take-off to touch-down, the others only in behaviors that stay in the air. A processor
    that raises is not called again, and its vehicle lands.

    accepts: the kinds of setpoint that it accepts, each with the kind that it returns. safety:
    whether it also runs during take-off and landing. clamps: whether a change of the setpoint is
    permanent (a goal beyond a fence), not only a delay or a detour; it then emits `clamp_started`,
    and a behavior that ends while its goal is clamped has failed. goes_round: whether it leads the
    vehicle around obstacles between it and its goal. evades: whether it moves the
    setpoint elsewhere, away from what is near. slows: whether it limits how the setpoint may move.
    idle: whether it will never change anything; it is then not called. retunes: the options of the
    vehicle's tracker that it may change.
    """

    kind = "processors"
    accepts: ClassVar[dict[SetpointKind, SetpointKind]]
    safety: ClassVar[bool] = False
    clamps: ClassVar[bool] = False
    goes_round: ClassVar[bool] = False
    evades: ClassVar[bool] = False
    slows: ClassVar[bool] = False
    idle: bool = False
    retunes: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def takes(cls, params: P) -> dict[SetpointKind, SetpointKind]:
        """Return the entries of `accepts` that apply with these parameters."""
        return cls.accepts

    @classmethod
    def keeps_inside(cls, params: P, fence: Box) -> Box | None:
        """Return the box inside `fence` that no setpoint leaves, or None if there is no such
        box."""
        return None

    @classmethod
    def keeps_off(cls, params: P, airframe: Airframe) -> float:
        """Return the distance (m) that it keeps between obstacles and the centre of an airframe, 0
        for none."""
        return 0.0

    @classmethod
    def objections(cls, params: P, context: VehicleContext) -> Iterator[Objection]:
        """Yield why these parameters make no sense for the vehicle of `context`, such as bounds
        that are crossed at once or never."""
        yield from ()

    @abstractmethod
    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Alarm | Emitting | Retune:
        """Return the changed setpoint. Return an Emitting with one of its `own_events`, a Retune
        with new values of its `retunes`, or an Alarm that requests a reaction, instead if needed.
        Called once a tick."""


class Tracker(Part[P]):
    """Turns a setpoint into a command. Created at each take-off. accepts: kinds of setpoint.
    emits: the kind of command that it returns; a tracker with several kinds overrides `kinds`."""

    kind = "trackers"
    accepts: ClassVar[frozenset[SetpointKind]]
    emits: ClassVar[CommandKind]

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def kinds(cls, params: P) -> frozenset[CommandKind]:
        """Return the kinds of command that the tracker may emit with these parameters."""
        return frozenset({cls.emits})

    @classmethod
    def uses(cls, params: P) -> frozenset[MeasurementKind]:
        """Return the kinds of measurement, beside the estimate, that improve the tracking."""
        return frozenset()

    @classmethod
    def outer_loop(
        cls, params: P, airframe: Airframe, inner: InnerLoop | None, period: float
    ) -> OuterLoop | None:
        """Return the position loop that it closes around `inner` with these parameters, from which
        stability margins are computed; None if it has no such loop. period: the control period,
        seconds."""
        return None

    @property
    @abstractmethod
    def hover_thrust(self) -> float:
        """The thrust that is estimated to carry the vehicle now, newtons."""

    @property
    def lean(self) -> tuple[float, float]:
        """The slope of body z along x and y, world frame, that is commanded where the vehicle
        stands still, for wind and for attitudes that are wrong by a constant."""
        return (0.0, 0.0)

    @abstractmethod
    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        """Return the command that follows `setpoint`. Called once a tick."""


class Supervisor(Part[P]):
    """Watches one bound and reports when it is crossed; it never acts itself. Exists as long as its
    vehicle.

    A supervisor that raises is not called again, and its vehicle lands. always: whether every
    vehicle has it, even if the mission doesn't name it. unhurried: whether it is called every 20 ms
    instead of once a tick.
    """

    kind = "supervisors"
    always: ClassVar[bool] = False
    unhurried: ClassVar[bool] = False

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def reserve(cls, params: P) -> float:
        """Return the share of a battery's charge, 0 to 1, below which the supervisor ends a
        flight."""
        return 0.0

    @classmethod
    def keeps_apart(cls, params: P, own: float, other: float) -> float:
        """Return the distance (m) between the centres of two vehicles with diameters `own` and
        `other` below which it alarms; 0 if it doesn't watch this distance."""
        return 0.0

    @classmethod
    def ends_outside(cls, params: P) -> Mapping[str, tuple[float, float]]:
        """Return the ranges of observables outside which it ends a flight, by name; empty if it
        watches none, or only warns or brakes."""
        return {}

    @classmethod
    def can_emit(cls, context: VehicleContext) -> tuple[str, ...]:
        """Return the `events` that it can emit for the vehicle of `context`."""
        return cls.events

    @classmethod
    def objections(cls, params: P, context: VehicleContext) -> Iterator[Objection]:
        """Yield why these parameters make no sense for the vehicle of `context`, such as bounds
        that are crossed at once or never."""
        yield from ()

    @abstractmethod
    def check(self, tick: Tick, off_ground: bool) -> Alarm | None:
        """Return an Alarm while the bound is crossed, otherwise None. Called before the tick's
        other decisions. off_ground: whether the vehicle is between the start of a take-off, even if
        its rotors don't turn yet, and touch-down."""
