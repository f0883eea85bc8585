"""Everything a vehicle knows: measurements of its link and sensors ─► monitors ─► estimate.

This module only receives; `output` sends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.core.errors import PartFailed
from kybflow.core.signals import (
    NS,
    Battery,
    Estimate,
    Frame,
    Imu,
    Measurement,
    MeasurementKind,
    Payload,
    Sticks,
    Time,
    kind_name,
)
from kybflow.dsl.plan import VehiclePlan
from kybflow.runtime.events import Events, VehicleObserver
from kybflow.runtime.monitoring.bodies import Bodies, BodyMonitor
from kybflow.runtime.monitoring.cameras import CameraMonitor
from kybflow.runtime.monitoring.estimate_history import EstimateHistory
from kybflow.runtime.monitoring.resting_bias import RestingBias
from kybflow.runtime.monitoring.sensing import OpenSensor, Sensing
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.estimation import Estimation
from kybflow.runtime.vehicle.link import LinkIn
from kybflow.runtime.vehicle.payload import PayloadTracker
from kybflow.world.vehicle_context import VehicleContext

_Take = Callable[[Any, Time], None]


class _Stream:
    """The measurements of one kind. began: when the first one arrived. count: how many have
    arrived. take: is called with each of them."""

    __slots__ = ("began", "count", "take")

    def __init__(self, began: Time, take: _Take | None) -> None:
        self.began, self.take = began, take
        self.count = 0


class Knowledge:
    """The estimate and the latest battery, IMU and stick measurements, each None before the first.

    resting: the accelerometer's bias at rest.
    needs: the kinds of measurement that the estimators use.
    now: the time of the last update.
    report: is called with the failure of a part.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        link: LinkIn,
        events: Events,
        observer: VehicleObserver,
        score: VehicleScore,
        report: Callable[[PartFailed], None],
        sensors: Sequence[OpenSensor] = (),
        bodies: Bodies | None = None,
        fleet: EstimateHistory | None = None,
    ) -> None:
        self.now: Time = 0
        self.estimate: Estimate | None = None
        self.battery: Battery | None = None
        self.imu: Imu | None = None
        self.sticks: Sticks | None = None
        self.resting = RestingBias()
        self.payload = PayloadTracker(plan.name, events)
        self.link_in = link
        self.estimation = Estimation(plan, context, events, score, report, self._known)
        self.sensing = Sensing(plan, sensors, events)
        self._name, self._observer, self._score = plan.name, observer, score
        self._faults = link.faults
        self._listen, self._accept = link.listen, self._accepted
        self._fleet = fleet or EstimateHistory()
        self._body = BodyMonitor(plan, bodies or Bodies(), events, lambda: self.estimate)
        self.cameras = CameraMonitor(plan, self._fleet, events)
        self._streams: dict[MeasurementKind, _Stream] = {}
        needs = [e.part.cls.uses(e.part.params) for e in plan.estimators]
        self.needs: frozenset[MeasurementKind] = frozenset().union(*needs)
        tracker = plan.tracker
        link.subscribe(self.needs | tracker.cls.uses(tracker.params))

    def update(self, now: Time, in_air: bool) -> Estimate | None:
        """Read the measurements; update and return the estimate. in_air: whether the vehicle
        flies."""
        self.now = now
        measurements = self._listen(now, self._accept)
        if self.sensing.streams:
            measurements = self.sensing.merged(measurements, now, self._note)
        if measurements or now >= self._body.due:
            measurements = self._body.measured(measurements, now, in_air)
        if self.cameras.is_asked:
            measurements = self.cameras.measured(measurements, now, in_air)
        if self._faults is not None and self._faults.estimators:
            self.estimation.kill(self._faults.estimators)
        self.estimate = estimate = self.estimation.update(measurements, now)
        if self.cameras.is_asked:
            self.cameras.judge(self.estimation.candidates, in_air)
        if self._fleet.is_asked and estimate is not None:
            self._fleet.note(self._name, estimate)
        return estimate

    def rate(self, kind: MeasurementKind) -> float:
        """Return the average rate (Hz) of measurements of `kind`; zero before the third one."""
        stream, now = self._streams.get(kind), self.link_in.heard
        if stream is None or stream.count < 3 or now is None or now == stream.began:
            return 0.0
        return (stream.count - 1) * NS / (now - stream.began)

    def parts(self) -> dict[str, Any]:
        """Return the estimators that have not failed, by label."""
        return self.estimation.parts()

    def _known(self, kinds: frozenset[MeasurementKind]) -> str:
        """Return a description of the known faults of these kinds of measurement; empty without
        any."""
        found = [self.sensing.trouble(kind) for kind in sorted(kinds, key=kind_name)]
        if Frame in kinds:
            found.append(self.cameras.trouble)
        return "; ".join(dict.fromkeys(words for words in found if words))

    def _accepted(self, measurements: Sequence[Measurement], now: Time) -> Sequence[Measurement]:
        """Record and return those measurements of the link that are plausible and that no sensor
        replaces."""
        measurements = self.sensing.of_link(measurements, now)
        self._note(measurements, now)
        return measurements

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
        """Begin to count the measurements of a kind. Kinds that no `_take_` method handles are used
        only by the estimators."""
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
        if not self.resting.rotors_turn:
            self.resting.add(imu)

    def _take_battery(self, battery: Battery, now: Time) -> None:
        self.battery = battery
        self._score.battery(battery.remaining)

    def _take_sticks(self, sticks: Sticks, now: Time) -> None:
        self.sticks = sticks

    def _take_payload(self, payload: Payload, now: Time) -> None:
        self.payload.update(payload, self.estimate, now)
