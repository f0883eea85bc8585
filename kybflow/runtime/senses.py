"""What one vehicle knows: its link's measurements, the estimate they make, the newest of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.dsl.plan import VehiclePlan
from kybflow.errors import PartFailed, described
from kybflow.parts import Link
from kybflow.runtime.estimation import Estimation
from kybflow.runtime.events import Events
from kybflow.runtime.outcome import VehicleScore
from kybflow.runtime.recorder import VehicleChannel
from kybflow.signals import (
    NS,
    Battery,
    Command,
    Estimate,
    Imu,
    Measurement,
    MeasurementKind,
    Pose,
    Time,
    Truth,
)
from kybflow.site import Site

_CLASSES: dict[MeasurementKind, type] = {
    MeasurementKind.POSE: Pose,
    MeasurementKind.BATTERY: Battery,
    MeasurementKind.IMU: Imu,
}


class Senses:
    """`link_error` is what the link said when it failed, None while it works. `link_age`: seconds
    since it delivered anything, or was first read. `report` is told of a part that has failed."""

    def __init__(
        self,
        plan: VehiclePlan,
        site: Site,
        link: Link,
        events: Events,
        channel: VehicleChannel,
        score: VehicleScore,
        report: Callable[[PartFailed], None],
    ) -> None:
        self.estimate: Estimate | None = None
        self.battery: Battery | None = None
        self.imu: Imu | None = None
        self.truth: Truth | None = None
        self.link_error: str | None = None
        self.link_age = 0.0
        self._streams: dict[type, tuple[Time, int]] = {}
        self.estimation = Estimation(plan, site, events, score, report)
        self._link, self._channel, self._score, self._report = link, channel, score, report
        self._driver = plan.driver.label
        self._heard: Time | None = None
        self._subscribed: frozenset[MeasurementKind] = frozenset()
        needs = [estimator.part.cls.needs for estimator in plan.estimators]
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

    def update(self, now: Time) -> None:
        """Read the link and renew the estimate."""
        measurements: Sequence[Measurement] = ()
        try:
            measurements = self._link.read(now)
            self.truth = self._link.truth()
            if measurements or self._heard is None:
                self._heard = now
                self._note(measurements, now)
        except Exception as error:  # see subscribe
            self.truth, measurements = None, ()
            self._heard = now if self._heard is None else self._heard
            self._failed(error)
        self.link_age = (now - self._heard) / NS
        self.estimate = self.estimation.update(measurements, now)

    def send(self, command: Command, now: Time) -> None:
        """Hand the command to the link."""
        try:
            self._link.send(command, now)
        except Exception as error:  # see subscribe
            self._failed(error)

    def rate(self, kind: MeasurementKind) -> float:
        """Measurements of `kind` a second since the first one; zero while they are fewer than three
        or arrive no more."""
        first, count = self._streams.get(_CLASSES[kind], (0, 0))
        now = self._heard
        if count < 3 or now is None or now == first:
            return 0.0
        return (count - 1) * NS / (now - first)

    def parts(self) -> dict[str, Any]:
        """The living estimators by label."""
        return self.estimation.parts()

    def _note(self, measurements: Sequence[Measurement], now: Time) -> None:
        streams = self._streams
        for measurement in measurements:
            self._channel.measurement(now, measurement)
            cls = type(measurement)
            first, count = streams.get(cls, (now, 0))
            streams[cls] = first, count + 1
            if cls is Imu:
                self.imu = measurement  # type: ignore[assignment]
            elif cls is Battery:
                self.battery = measurement  # type: ignore[assignment]
                self._score.battery(measurement.remaining)  # type: ignore[union-attr]

    def _failed(self, error: Exception) -> None:
        """Land by what still works; told once, though reading and sending go on being tried."""
        if self.link_error is None:
            self.link_error = described(error)
            self._report(PartFailed(self._driver, error))
