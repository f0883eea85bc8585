"""What one vehicle knows: its link's measurements, the estimate they make, the newest of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.core.errors import PartFailed, Refused, described
from kybflow.core.signals import (
    NS,
    Battery,
    Command,
    Estimate,
    Frame,
    Imu,
    Measurement,
    MeasurementKind,
    Payload,
    Reaction,
    Sticks,
    Time,
    Truth,
    kind_name,
)
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import Link
from kybflow.runtime.events import Events
from kybflow.runtime.monitoring.body_health import Bodies
from kybflow.runtime.monitoring.estimate_history import Whereabouts
from kybflow.runtime.monitoring.sensing import Opened, Sensing
from kybflow.runtime.monitoring.watched_body import WatchedBody
from kybflow.runtime.monitoring.watched_cameras import WatchedCameras
from kybflow.runtime.observer import VehicleObserver
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.asking import Asking
from kybflow.runtime.vehicle.cargo import Cargo
from kybflow.runtime.vehicle.estimation import Estimation
from kybflow.runtime.vehicle.resting_bias import Rest
from kybflow.runtime.vehicle.telling import Telling
from kybflow.world.vehicle_context import VehicleContext

SILENCE = 0.3
"""Seconds without a word of the link after which it has returned when there is one."""
ALIVE = 0.5
"""Seconds since a link delivered anything within which it can be asked for something."""

_Take = Callable[[Any, Time], None]


class _Stream:
    """The measurements of one kind. began: when the first arrived, count: how many did. take: who
    is told of each."""

    __slots__ = ("began", "count", "take")

    def __init__(self, began: Time, take: _Take | None) -> None:
        self.began, self.take = began, take
        self.count = 0


class Senses:
    """`link_error` is what the link said when it failed, None while it works. `link_age`: seconds
    since it delivered anything, or was first read. `rest`: what the IMU felt when the rotors rested
    last. `report` is told of a part that has failed."""

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        link: Link,
        events: Events,
        observer: VehicleObserver,
        score: VehicleScore,
        report: Callable[[PartFailed], None],
        sensors: Sequence[Opened] = (),
        bodies: Bodies | None = None,
        fleet: Whereabouts | None = None,
    ) -> None:
        self.estimate: Estimate | None = None
        self.battery: Battery | None = None
        self.imu: Imu | None = None
        self.sticks: Sticks | None = None
        self.truth: Truth | None = None
        self.link_error: str | None = None
        self.link_age = 0.0
        self.rest = Rest()
        self.cargo = Cargo(plan.name, events)
        self._armed = False
        self._streams: dict[MeasurementKind, _Stream] = {}
        self.estimation = Estimation(plan, context, events, score, report, self._known)
        self._link, self._observer, self._score, self._report = link, observer, score, report
        self._events, self._at = events, plan.driver.at
        self.asking = Asking(link, self._failed)
        self._telling = Telling(plan, self.estimation)
        driver = plan.driver
        self._driver, self._lands = driver.label, driver.cls.lands
        self._lands_blind = driver.cls.lands_blind
        self.sensing = Sensing(plan, sensors, events)
        self._body = WatchedBody(plan, bodies or Bodies(), events)
        self._name, self._fleet = plan.name, fleet or Whereabouts()
        self.cameras = WatchedCameras(plan, self._fleet, events)
        self._heard: Time | None = None
        self._alive: Time | None = None
        self._subscribed: frozenset[MeasurementKind] = frozenset()
        needs = [e.part.cls.uses(e.part.params) for e in plan.estimators]
        self.needs: frozenset[MeasurementKind] = frozenset().union(*needs)
        self.subscribe(self.needs)

    def subscribe(self, kinds: frozenset[MeasurementKind]) -> None:
        """Ask the link for these kinds too, from now on."""
        if kinds <= self._subscribed:
            return
        self._subscribed |= kinds
        try:
            self._link.subscribe(self._subscribed)
        except Exception as error:  # a part may raise anything; it fails this vehicle alone
            self._failed(error)

    def update(self, now: Time, in_air: bool = False) -> None:
        """Read the link, then the sensors beside it, and renew the estimate. in_air: whether the
        vehicle is."""
        measurements = self._listened(now)
        if self.sensing.streams:
            measurements = self.sensing.joined(measurements, now, self._note)
        if measurements or now >= self._body.due:
            measurements = self._body.measured(measurements, now, in_air)
        if self.cameras.is_asked:
            measurements = self.cameras.measured(measurements, now, in_air)
        if self._link.rig is not None and self._link.rig.estimators:
            self.estimation.kill(self._link.rig.estimators)
        self.estimate = self.estimation.update(measurements, now)
        told = self._telling.of(self.estimate) if self.asking.is_told else None
        if told is not None:
            self.asking.tell(told, now)
        if self.cameras.is_asked:
            self.cameras.see(self.estimation.candidates, in_air)
        if self._fleet.is_asked and self.estimate is not None:
            self._fleet.note(self._name, self.estimate)

    def _listened(self, now: Time) -> Sequence[Measurement]:
        """Read the link; what of it counts."""
        measurements: Sequence[Measurement] = ()
        try:
            measurements = self._link.read(now)
            self.truth = self._link.truth()
            if measurements or self._heard is None:
                if self._link.is_heard or self._alive is None:
                    self._greet(now)
                self._heard = now
                measurements = self.sensing.left_of(measurements, now)
                self._note(measurements, now)
        except Exception as error:  # see subscribe
            self.truth, measurements = None, ()
            self._heard = now if self._heard is None else self._heard
            self._alive = now if self._alive is None else self._alive
            self._failed(error)
        self.link_age = 0.0 if self._alive is None else (now - self._alive) / NS
        for severity, text in self.asking.said() if self.asking.speaks else ():
            self._events.tell("vehicle_said", self._name, self._at, severity=severity, text=text)
        return measurements

    def send(self, command: Command, now: Time) -> None:
        """Hand the command to the link."""
        if command.armed is not self._armed:
            self._armed = command.armed
            self.rest = self.rest if self._armed else Rest()
        try:
            self._link.send(command, now)
        except Exception as error:  # see subscribe
            self._failed(error)

    @property
    def can_land(self) -> bool:
        """Whether the vehicle has a land mode of its own and can be asked for it."""
        return self._lands and self.link_error is None and self.link_age <= ALIVE

    def lands_itself(self, reaction: Reaction) -> bool:
        """Whether its own land mode is to be asked for in place of this reaction's state."""
        fit = reaction is Reaction.LAND or (reaction is Reaction.LAND_BLIND and self._lands_blind)
        return fit and self.can_land

    def land(self, now: Time) -> bool:
        """Ask for the vehicle's own land mode; whether it has landed. Raises Refused."""
        try:
            return self._link.land(now)
        except Refused:
            raise
        except Exception as error:  # see subscribe
            self._failed(error)
            raise Refused(described(error)) from error

    def grip(self, is_open: bool, now: Time, at: str) -> None:
        """Ask for the servo that holds the payload, where that makes a difference. Raises
        Refused."""
        if not self.cargo.wants(is_open, now, at):
            return
        try:
            self._link.grip(is_open, now)
        except Refused:
            raise
        except Exception as error:  # see subscribe
            self._failed(error)

    def rate(self, kind: MeasurementKind) -> float:
        """Measurements of `kind` a second since the first one; zero while they are fewer than three
        or arrive no more."""
        stream, now = self._streams.get(kind), self._heard
        if stream is None or stream.count < 3 or now is None or now == stream.began:
            return 0.0
        return (stream.count - 1) * NS / (now - stream.began)

    def parts(self) -> dict[str, Any]:
        """The living estimators by label."""
        return self.estimation.parts()

    def _known(self, kinds: frozenset[MeasurementKind]) -> str:
        """What is known to be wrong with the measurements of these kinds, in words."""
        said = [self.sensing.trouble(kind) for kind in sorted(kinds, key=kind_name)]
        if Frame in kinds:
            said.append(self.cameras.trouble)
        return "; ".join(dict.fromkeys(words for words in said if words))

    def _note(self, measurements: Sequence[Measurement], now: Time) -> None:
        record, streams = self._observer.measurement, self._streams
        for measurement in measurements:
            record(now, measurement)
            kind = type(measurement)
            stream = streams.get(kind) or self._open_stream(kind, now)
            stream.count += 1
            if stream.take is not None:
                stream.take(measurement, now)

    def _open_stream(self, kind: MeasurementKind, now: Time) -> _Stream:
        """Begin to count measurements of a kind. A kind that is not named here concerns none but
        the estimators."""
        takers: dict[MeasurementKind, _Take] = {
            Imu: self._take_imu,
            Battery: self._take_battery,
            Sticks: self._take_sticks,
            Payload: self._take_payload,
        }
        stream = self._streams[kind] = _Stream(now, takers.get(kind))
        return stream

    def _take_imu(self, imu: Imu, now: Time) -> None:
        self.imu = imu
        if not self._armed:
            self.rest.feel(imu)

    def _take_battery(self, battery: Battery, now: Time) -> None:
        self.battery = battery
        self._score.battery(battery.remaining)

    def _take_sticks(self, sticks: Sticks, now: Time) -> None:
        self.sticks = sticks

    def _take_payload(self, payload: Payload, now: Time) -> None:
        self.cargo.hear(payload, self.estimate, now)

    def _greet(self, now: Time) -> None:
        """Something of the vehicle itself arrived."""
        if self._alive is not None and now - self._alive > SILENCE * NS:
            silence = (now - self._alive) / NS
            self._events.tell("link_returned", self._name, self._at, value=silence)
        self._alive = now

    def _failed(self, error: Exception) -> None:
        """Land by what still works; told once, though reading and sending go on being tried."""
        if self.link_error is None:
            self.link_error = described(error)
            self._report(PartFailed(self._driver, error))
