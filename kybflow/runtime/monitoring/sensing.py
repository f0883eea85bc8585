"""The sensors that a vehicle has besides its link.

Their measurements replace the link's measurements of the same kinds. A sensor's failure is reported
once until the sensor works again. The estimates that depend on the sensor then grow old; the link
is not affected. A sensor has failed if it raises, or if it gives no measurements and reports a
reason; the latter counts only once the sensor has worked, or `CONNECTING_TIME_S` after the
start.

Implausible measurements of the link and of sensors are refused: measurements stamped more than
`MAX_LEAD_NS` in the future, because an estimator that accepted one would ignore all others until
then; frames of a camera that the vehicle doesn't have; and frames without a grey image. The first
refusal of each sort is reported."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from operator import attrgetter
from typing import NamedTuple

from kybflow.core.errors import DriverError, described
from kybflow.core.signals import NS, Frame, Measurement, MeasurementKind, Time, kind_name
from kybflow.dsl.plan import SensorPlan, VehiclePlan
from kybflow.parts import Stream
from kybflow.parts.events import MeasurementRefused, SensorFailed, SensorRecovered
from kybflow.runtime.events import Events

CONNECTING_TIME_S = 1.0
"""Seconds that a sensor may need to connect."""
MAX_LEAD_NS: Time = NS // 200
"""How far a time stamp may be in the future, since clock offsets are estimates and ticks can be
late."""
_BY_TIME = attrgetter("time")
_Note = Callable[[Sequence[Measurement], Time], None]


class OpenSensor(NamedTuple):
    """A sensor and its open stream."""

    plan: SensorPlan
    stream: Stream


class Sensing:
    """Reads one vehicle's sensors and reports their failures. streams: the open streams, by the
    label of their sensor."""

    def __init__(self, plan: VehiclePlan, opened: Sequence[OpenSensor], events: Events) -> None:
        self._vehicle, self._driver = plan.name, plan.driver
        self._opened, self._events = opened, events
        self._failed: dict[str, str] = {}
        self._worked: set[str] = set()
        self._began: Time | None = None
        kinds = (kind for sensor in opened for kind in sensor.plan.part.cls.provides)
        self._replaced = frozenset(kind for kind in kinds)
        self._admission = Admission(plan.name, plan.cameras, events)
        self.streams: dict[str, Stream] = {s.plan.part.label: s.stream for s in opened}

    def of_link(self, measurements: Sequence[Measurement], now: Time) -> Sequence[Measurement]:
        """Return the link's measurements that are plausible and that no sensor replaces."""
        if self._replaced:
            measurements = [m for m in measurements if type(m) not in self._replaced]
        return self._admission.admitted(measurements, now, self._driver.name, self._driver.at)

    def merged(
        self, measurements: Sequence[Measurement], now: Time, note: _Note
    ) -> Sequence[Measurement]:
        """Return the given measurements of the link and the new ones of the sensors, oldest first.
        note: is called with the sensors' measurements."""
        found = list(measurements)
        for sensor in self._opened:
            found += self._read(sensor, now, note)
        return sorted(found, key=_BY_TIME)

    def refused(self, kind: MeasurementKind) -> int:
        """Return how many measurements of `kind` were refused."""
        return self._admission.refused(kind)

    def trouble(self, kind: MeasurementKind) -> str | None:
        """Return why a sensor can't give measurements of `kind`, or None if no reason is known."""
        for sensor in self._opened:
            if kind in sensor.plan.part.cls.provides:
                trouble = _trouble(sensor) or self._failed.get(_name(sensor))
                if trouble is not None:
                    return trouble
        return None

    def _read(self, sensor: OpenSensor, now: Time, note: _Note) -> Sequence[Measurement]:
        part = sensor.plan.part
        name = _name(sensor)
        try:
            came = sensor.stream.read(now)
            found = self._admission.admitted(came, now, name, part.at)
        except Exception as error:  # a part may raise anything; it ends no other
            self._fail(sensor, str(error) if isinstance(error, DriverError) else described(error))
            return ()
        try:
            note(found, now)
        except Exception as error:  # it gave something other than measurements
            self._fail(sensor, f"its measurement can't be used: {described(error)}")
            return ()
        if found:
            self._worked.add(name)
            if self._failed.pop(name, None) is not None:
                self._events.emit(SensorRecovered(sensor=name), self._vehicle, part.at)
        elif name not in self._failed and (name in self._worked or self._is_late(now)):
            trouble = _trouble(sensor)
            if trouble is not None:
                self._fail(sensor, trouble)
        return found

    def _is_late(self, now: Time) -> bool:
        """Return whether a sensor that has not worked yet has had enough time to connect."""
        self._began = now if self._began is None else self._began
        return now - self._began >= CONNECTING_TIME_S * NS

    def _fail(self, sensor: OpenSensor, reason: str) -> None:
        """Report a sensor's failure, but only once until the sensor works again."""
        name = _name(sensor)
        if name not in self._failed:
            self._failed[name] = reason
            at = sensor.plan.part.at
            self._events.emit(SensorFailed(sensor=name, reason=reason), self._vehicle, at)


def _trouble(sensor: OpenSensor) -> str | None:
    """Return why the sensor gives no measurements, or None if it knows no reason."""
    try:
        return sensor.stream.trouble()
    except Exception as error:  # a part may raise anything
        return described(error)


def _name(sensor: OpenSensor) -> str:
    """Return the sensor's name, as used in events."""
    return sensor.plan.part.label.partition(".")[2]


class Admission:
    """Refuses implausible measurements of one vehicle."""

    def __init__(self, vehicle: str, cameras: Collection[str], events: Events) -> None:
        self._vehicle, self._cameras, self._events = vehicle, cameras, events
        self._counts: dict[MeasurementKind, int] = {}
        self._reported: set[tuple[str, MeasurementKind, str]] = set()

    def admitted(
        self, measurements: Sequence[Measurement], now: Time, source: str, at: str
    ) -> Sequence[Measurement]:
        """Return the plausible measurements. source: the name of the sensor or driver that gave
        them. at: its mission line."""
        latest = now + MAX_LEAD_NS
        for measurement in measurements:
            if measurement.time > latest or type(measurement) is Frame:
                break
        else:
            return measurements  # as nearly always
        admitted: list[Measurement] = []
        for measurement in measurements:
            wrong = self._wrong(measurement, now)
            if wrong is None:
                admitted.append(measurement)
            else:
                self._refuse(type(measurement), wrong, source, at)
        return admitted

    def refused(self, kind: MeasurementKind) -> int:
        return self._counts.get(kind, 0)

    def _wrong(self, measurement: Measurement, now: Time) -> tuple[str, str] | None:
        """Return (sort of fault, reason for an event) of an implausible measurement, or None."""
        ahead = measurement.time - now
        if ahead > MAX_LEAD_NS:
            return "time", f"stamped {ahead / NS:.3g} s in the future"
        if not isinstance(measurement, Frame):
            return None
        camera, shape = measurement.camera, getattr(measurement.image, "shape", ())
        if camera not in self._cameras:
            known = ", ".join(f"`{name}`" for name in self._cameras) or "none"
            return camera, f"of the camera `{camera}`; the vehicle has {known}"
        if len(shape) != 2 or 0 in shape:
            return "image", f"with an image of `{camera}` that is not a grey image"
        return None

    def _refuse(self, kind: MeasurementKind, wrong: tuple[str, str], source: str, at: str) -> None:
        self._counts[kind] = self._counts.get(kind, 0) + 1
        sort, reason = wrong
        if (source, kind, sort) not in self._reported:
            self._reported.add((source, kind, sort))
            refused = MeasurementRefused(source=source, kind=kind_name(kind), reason=reason)
            self._events.emit(refused, self._vehicle, at)
