"""How a run is observed: its events, which listeners receive at once and transitions one tick
later; and `VehicleObserver`, which a recording implements."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

from kybflow.core.errors import described, traceback_of
from kybflow.core.events import BaseEvent
from kybflow.core.signals import Command, Estimate, Event, Measurement, Setpoint, Time, Truth
from kybflow.parts.events import ObserverFailed
from kybflow.parts.link import Contact
from kybflow.world.objects import ObjectState


class Events:
    """Publishes events. A listener that raises is removed. unanswered: the events that no callback
    has handled yet."""

    def __init__(self, listeners: Iterable[Callable[[Event], None]] = ()) -> None:
        self.listeners = list(listeners)
        self.now: Time = 0
        self._fresh: list[Event] = []
        self.unanswered: list[Event] = []
        self._heard: dict[str, set[str]] = {}

    def emit(self, event: BaseEvent, vehicle: str = "", at: str = "") -> None:
        """Publish an event that happened now to the listeners and, if missions can wait for it, to
        transitions and callbacks. at: the mission line that caused it."""
        happened = Event(self.now, event.name, vehicle, event.recorded(), at)
        if event.awaited != "nowhere":
            self._fresh.append(happened)
            self.unanswered.append(happened)
        for listener in self.listeners:
            try:
                listener(happened)
            except Exception as error:  # a listener must not stop the flight
                self.listeners = [other for other in self.listeners if other is not listener]
                failed = ObserverFailed(reason=described(error), traceback=traceback_of(error))
                self.emit(failed)

    def take_unanswered(self) -> list[Event]:
        """Return the events that no callback has handled yet, and clear them."""
        taken, self.unanswered = self.unanswered, []
        return taken

    def turn(self, now: Time) -> None:
        """Begin a tick, in which transitions receive the events of the previous tick."""
        self.now = now
        if self._fresh or self._heard:
            everybody = {f"{e.vehicle}.{e.name}" if e.vehicle else e.name for e in self._fresh}
            everybody |= {f"any.{e.name}" for e in self._fresh if e.vehicle}
            self._heard = {"": everybody} if everybody else {}
            for event in self._fresh:
                self._heard.setdefault(event.vehicle, set(everybody)).add(event.name)
            self._fresh = []

    def heard(self, vehicle: str) -> set[str] | frozenset[str]:
        """Return the names of the events that `vehicle` receives in this tick: `NAME` for its own
        events and those without a vehicle, `VEHICLE.NAME` and `any.NAME` for those of any
        vehicle."""
        if not self._heard:
            return _SILENCE
        return self._heard.get(vehicle) or self._heard[""]


_SILENCE: frozenset[str] = frozenset()


class WorldObserver:
    """Receives what is known of bodies that are not vehicles. This base class discards it. Methods
    must not raise."""

    def body(self, now: Time, name: str, measurement: Measurement) -> None:
        """Record a pose of a moving obstacle or an object, which arrived in the tick at `now`."""

    def objects(
        self, now: Time, states: Mapping[str, ObjectState], forces: Mapping[Contact, float]
    ) -> None:
        """Record the simulator's objects in the tick at `now`: their true states, by name, and the
        force of each contact with a vehicle, N."""


class EstimatorState(Protocol):
    """One estimator after a tick. is_usable: whether it is healthy and within its time limit."""

    @property
    def name(self) -> str: ...
    @property
    def estimate(self) -> Estimate | None: ...
    @property
    def is_usable(self) -> bool: ...


class EstimationState(Protocol):
    """A vehicle's estimators after a tick. source: the name of the estimator in use."""

    @property
    def source(self) -> str | None: ...
    @property
    def candidates(self) -> Sequence[EstimatorState]: ...


class VehicleObserver:
    """Receives the measurements, estimates and commands of one vehicle. This base class discards
    them, which suffices for a preflight. Methods must not raise."""

    def measurement(self, now: Time, measurement: Measurement) -> None:
        """Record a measurement that arrived in the tick at `now`."""

    def answer(self, now: Time, of: str, value: object) -> None:
        """Record what the vehicle's link answered in the tick at `now`, so that a replay can give
        the same answer. of: a method of the link, or another name that
        `kybflow.runtime.vehicle.link.OFFERED` explains."""

    def located(self, now: Time, estimator: str, estimate: Estimate | None) -> None:
        """Record the estimate of an estimator that uses images, which are not recorded."""

    def tick(
        self,
        now: Time,
        estimate: Estimate | None,
        wanted: Setpoint | None,
        setpoint: Setpoint | None,
        command: Command,
        truth: Truth | None,
        estimation: EstimationState,
    ) -> None:
        """Record a tick: the estimate, the setpoint before the processors (`wanted`) and after
        them (`setpoint`), the command that was sent, the simulator's ground truth (None on
        hardware), and the state of every estimator."""
