"""The parts between a vehicle's measurements and its command: estimators, processors, trackers; and
the supervisors that watch them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from kybflow.core.signals import (
    Alarm,
    Command,
    CommandKind,
    Estimate,
    Measurement,
    MeasurementKind,
    Setpoint,
    SetpointKind,
    Tick,
    Time,
)
from kybflow.parts.base import P, Part
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    from kybflow.vision.locating.locator import Sighting


class Estimator(Part[P]):
    """Turns measurements into an estimate. Lives as long as its vehicle.

    Called once a tick with every measurement that arrived since the last tick, oldest first, of
    whatever kind; `needs` are the kinds without which it can't work. Returns the estimate at `now`,
    or None as long as it has none. One that `needs_tags` makes nothing of frames where the world
    has no tags. One that raises is not asked again, and its vehicle lands. `sighting` is what it
    made of the newest camera frames, for the pictures in the run folder; most see none. `own`: its
    estimate comes from the vehicle itself, which is not told of it again.
    """

    kind = "estimators"
    sighting: Sighting | None = None
    needs: ClassVar[frozenset[MeasurementKind]]
    needs_tags: ClassVar[bool] = False
    own: ClassVar[bool] = False

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def uses(cls, params: P) -> frozenset[MeasurementKind]:
        """What of `needs` it can't work without with these parameters."""
        return cls.needs

    @abstractmethod
    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None: ...

    def anchor(self, estimate: Estimate) -> None:
        """Told of the estimate that the vehicle flies on, in every tick in which that is another
        estimator's, after `update`; dead reckoning starts from it. Most need none."""


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

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def takes(cls, params: P) -> dict[SetpointKind, SetpointKind]:
        """What of `accepts` it takes with these parameters."""
        return cls.accepts

    @classmethod
    def keeps_inside(cls, params: P, fence: Box) -> Box | None:
        """The box inside `fence` that no setpoint leaves; None when it bounds none."""
        return None

    @abstractmethod
    def __call__(self, setpoint: Setpoint, tick: Tick) -> Setpoint | Alarm: ...


class Tracker(Part[P]):
    """Turns a setpoint into a command. Made anew at each take-off. `accepts` kinds of setpoint,
    `emits` a kind of command; one that may emit several says so in `kinds`."""

    kind = "trackers"
    accepts: ClassVar[frozenset[SetpointKind]]
    emits: ClassVar[CommandKind]

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @classmethod
    def kinds(cls, params: P) -> frozenset[CommandKind]:
        """The kinds of command that it may emit with these parameters."""
        return frozenset({cls.emits})

    @property
    @abstractmethod
    def hover_thrust(self) -> float:
        """Newtons that it believes hold the vehicle now."""

    @abstractmethod
    def update(self, setpoint: Setpoint, tick: Tick) -> Command: ...


class Supervisor(Part[P]):
    """Watches one bound and reports; it never acts. Lives as long as its vehicle; `always` ones are
    in every vehicle, named in the mission or not. Called once a tick, or every 20 ms when it is
    `unhurried`, before anything else is decided. One that raises is not asked again, and its
    vehicle lands."""

    kind = "supervisors"
    always: ClassVar[bool] = False
    unhurried: ClassVar[bool] = False

    def __init__(self, params: P, context: VehicleContext) -> None:
        self.params = params

    @abstractmethod
    def check(self, tick: Tick, airborne: bool) -> Alarm | None: ...
