"""The parts between a vehicle's measurements and its command (estimators, processors, trackers) and
the supervisors that watch it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
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
from kybflow.world.inner_loop import InnerLoop
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import Airframe, VehicleContext

if TYPE_CHECKING:
    from kybflow.flight.loops.response import OuterLoop
    from kybflow.flight.pose_gate import Refusal
    from kybflow.vision.locating.locator import Sighting


class Estimator(Part[P]):
    """Turns measurements into an estimate. Lives as long as its vehicle.

    An estimator that raises is not called again, and its vehicle lands.

    needs: the kinds of measurement that it can't work without. needs_tags: it can use frames only
    if the world has tags. own: its estimate comes from the vehicle itself, so it is not sent back
    as an external position. sighting: what it found in the newest camera frames, None in most.
    refusal: why it refuses what arrives of the position, None while it takes it.
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
        """Return the kinds in `needs` that hold with these parameters."""
        return cls.needs

    @abstractmethod
    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        """Return the estimate at `now`, None while there is none. Called once a tick with every
        measurement of any kind that arrived since the last tick, oldest first."""

    def anchor(self, estimate: Estimate) -> None:
        """Receive the estimate that the vehicle flies on, so that dead reckoning can start from it.
        Called after `update` in every tick in which another estimator is in use."""


class Processor(Part[P]):
    """Changes a setpoint on its way to the tracker. Created anew at each take-off.

    Processors run in the order of the mission while a behavior with an estimate flies: `safety`
    ones from take-off to touch-down, the others only in behaviors that stay in the air. A processor
    that raises is not called again, and its vehicle lands. `accepts` maps each kind of setpoint
    that it accepts to the kind that it returns. `clamps`: what it changes is taken away for good,
    as beyond a fence, and does not only come later or around something: it emits
    `clamp_started`, and a behavior that is done while its goal is clamped has failed. idle: it will
    never change anything, and is not called. goes_round: what stands between where the vehicle is
    and where it is led is no hindrance. retunes: the options of the vehicle's tracker that it may
    give other values.
    """

    kind = "processors"
    accepts: ClassVar[dict[SetpointKind, SetpointKind]]
    safety: ClassVar[bool] = False
    clamps: ClassVar[bool] = False
    goes_round: ClassVar[bool] = False
    idle: bool = False
    retunes: ClassVar[frozenset[str]] = frozenset()

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def takes(cls, params: P) -> dict[SetpointKind, SetpointKind]:
        """Return the entries of `accepts` that hold with these parameters."""
        return cls.accepts

    @classmethod
    def keeps_inside(cls, params: P, fence: Box) -> Box | None:
        """Return the box inside `fence` that no setpoint leaves; None if it bounds none."""
        return None

    @classmethod
    def keeps_off(cls, params: P, airframe: Airframe) -> float:
        """Return how far from obstacles it keeps the centre of an airframe, m; 0 if it doesn't."""
        return 0.0

    @classmethod
    def objections(cls, params: P, context: VehicleContext) -> Iterator[Objection]:
        """Yield what makes these parameters senseless for the vehicle of `context`: bounds that are
        crossed at once, or never."""
        yield from ()

    @abstractmethod
    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Alarm | Emitting | Retune:
        """Return the changed setpoint, with one of its `own_events` as an Emitting or values
        that it `retunes` as a Retune, or an Alarm that requests a reaction; called once a tick."""


class Tracker(Part[P]):
    """Turns a setpoint into a command. Created anew at each take-off. accepts: kinds of setpoint.
    emits: the kind of command that it returns; a tracker of several kinds overrides `kinds`."""

    kind = "trackers"
    accepts: ClassVar[frozenset[SetpointKind]]
    emits: ClassVar[CommandKind]

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def kinds(cls, params: P) -> frozenset[CommandKind]:
        """Return the kinds of command that it may emit with these parameters."""
        return frozenset({cls.emits})

    @classmethod
    def uses(cls, params: P) -> frozenset[MeasurementKind]:
        """Return the kinds of measurement that it follows better with."""
        return frozenset()

    @classmethod
    def outer_loop(
        cls, params: P, airframe: Airframe, inner: InnerLoop | None, period: float
    ) -> OuterLoop | None:
        """Return the position loop that it closes around `inner` with these parameters, of which
        margins are computed; None for no such loop. period: of the control, seconds."""
        return None

    @property
    @abstractmethod
    def hover_thrust(self) -> float:
        """The estimated thrust that holds the vehicle now, newtons."""

    @abstractmethod
    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        """Return the command that follows `setpoint`. Called once a tick."""


class Supervisor(Part[P]):
    """Watches one bound and reports; it never acts. Lives as long as its vehicle.

    A supervisor that raises is not called again, and its vehicle lands. always: every vehicle has
    it, named in the mission or not. unhurried: it is called every 20 ms, not once a tick.
    """

    kind = "supervisors"
    always: ClassVar[bool] = False
    unhurried: ClassVar[bool] = False

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def reserve(cls, params: P) -> float:
        """Return the share of a battery's charge, 0 to 1, below which it ends a flight."""
        return 0.0

    @classmethod
    def keeps_apart(cls, params: P, own: float, other: float) -> float:
        """Return the distance (m) of two vehicles' centres below which it alarms, their diameters
        being `own` and `other`; 0 where it watches no such distance."""
        return 0.0

    @classmethod
    def can_emit(cls, context: VehicleContext) -> tuple[str, ...]:
        """Return those of `events` that it can raise for the vehicle of `context`."""
        return cls.events

    @classmethod
    def objections(cls, params: P, context: VehicleContext) -> Iterator[Objection]:
        """Yield what makes these parameters senseless for the vehicle of `context`: bounds that are
        crossed at once, or never."""
        yield from ()

    @abstractmethod
    def check(self, tick: Tick, airborne: bool) -> Alarm | None:
        """Return an Alarm while the bound is crossed. Called before the tick's other decisions."""
