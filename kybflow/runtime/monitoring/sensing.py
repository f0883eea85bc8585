"""The sensors of one vehicle beside its link.

What they measure comes in place of what the link measures of the same kinds. One that fails is
reported once, until it works again, and its estimators age; the link is not blamed. It fails by
raising, or where nothing comes and it knows why: once it has worked, or `PATIENCE` seconds after
the start.

What can't be true is left out, of the link as of a sensor: what is stamped more than `AHEAD` after
now, because an estimator that took it would take nothing else until then; a frame of a camera that
the vehicle doesn't have, and one whose image is none. The first of each is reported.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

from kybflow.core.errors import DriverError, described
from kybflow.core.signals import NS, Frame, Measurement, MeasurementKind, Time, kind_name
from kybflow.dsl.plan import SensorPlan, VehiclePlan
from kybflow.parts import Stream
from kybflow.parts.events import MeasurementRefused, SensorFailed, SensorRecovered
from kybflow.runtime.events import Events

PATIENCE = 1.0
"""Until then a sensor may still be connecting."""
AHEAD: Time = NS // 200
"""By how much a stamp may be later than now: clocks are compared by estimates of their offset, and
a tick can be late."""
_BY_TIME = attrgetter("time")
_Note = Callable[[Sequence[Measurement], Time], None]


class OpenSensor(NamedTuple):
    """A sensor and what it has open."""

    plan: SensorPlan
    stream: Stream


class Sensing:
    """`streams` are what is open, by the sensor's label."""

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

    def left_of(self, measurements: Sequence[Measurement], now: Time) -> Sequence[Measurement]:
        """What of the link's measurements counts."""
        if self._replaced:
            measurements = [m for m in measurements if type(m) not in self._replaced]
        return self._admission.admitted(measurements, now, self._driver.name, self._driver.at)

    def joined(
        self, measurements: Sequence[Measurement], now: Time, note: _Note
    ) -> Sequence[Measurement]:
        """The link's measurements with those of the sensors, which are noted first; oldest
        first."""
        found = list(measurements)
        for sensor in self._opened:
            found += self._read(sensor, now, note)
        return sorted(found, key=_BY_TIME)

    def left_out(self, kind: MeasurementKind) -> int:
        """How many measurements of `kind` came that can't be true."""
        return self._admission.left_out(kind)

    def trouble(self, kind: MeasurementKind) -> str | None:
        """Why no measurements of `kind` can come, as far as a sensor knows."""
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
        except Exception as error:  # what it gave is no measurement
            self._fail(sensor, f"what it gives can't be taken: {described(error)}")
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
        """Whether a sensor that has not worked yet should."""
        self._began = now if self._began is None else self._began
        return now - self._began >= PATIENCE * NS

    def _fail(self, sensor: OpenSensor, reason: str) -> None:
        """Report it, once until the sensor works again."""
        name = _name(sensor)
        if name not in self._failed:
            self._failed[name] = reason
            at = sensor.plan.part.at
            self._events.emit(SensorFailed(sensor=name, reason=reason), self._vehicle, at)


def _trouble(sensor: OpenSensor) -> str | None:
    """Why nothing can come from it, as far as it knows."""
    try:
        return sensor.stream.trouble()
    except Exception as error:  # a part may raise anything
        return described(error)


def _name(sensor: OpenSensor) -> str:
    """The sensor's, as events say it."""
    return sensor.plan.part.label.partition(".")[2]


class Admission:
    """Judges the measurements of one vehicle that has these cameras."""

    def __init__(self, vehicle: str, cameras: Collection[str], events: Events) -> None:
        self._vehicle, self._cameras, self._events = vehicle, cameras, events
        self._counts: dict[MeasurementKind, int] = {}
        self._reported: set[tuple[str, MeasurementKind, str]] = set()

    def admitted(
        self, measurements: Sequence[Measurement], now: Time, source: str, at: str
    ) -> Sequence[Measurement]:
        """The measurements that count. source: who gives them, named by the mission's line `at`."""
        latest = now + AHEAD
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

    def left_out(self, kind: MeasurementKind) -> int:
        """How many of a kind."""
        return self._counts.get(kind, 0)

    def _wrong(self, measurement: Measurement, now: Time) -> tuple[str, str] | None:
        """What is wrong with it, and in full; None where nothing is."""
        ahead = measurement.time - now
        if ahead > AHEAD:
            return "time", f"stamped {ahead / NS:.3g} s in the future"
        if isinstance(measurement, Frame) and measurement.camera not in self._cameras:
            known = ", ".join(f"`{name}`" for name in self._cameras) or "none"
            return (
                measurement.camera,
                f"of the camera `{measurement.camera}`; the vehicle has {known}",
            )
        if isinstance(measurement, Frame) and not _is_grey(measurement.image):
            return "image", f"with an image of `{measurement.camera}` that is no grey one"
        return None

    def _refuse(self, kind: MeasurementKind, wrong: tuple[str, str], source: str, at: str) -> None:
        self._counts[kind] = self._counts.get(kind, 0) + 1
        sort, reason = wrong
        if (source, kind, sort) not in self._reported:
            self._reported.add((source, kind, sort))
            refused = MeasurementRefused(source=source, kind=kind_name(kind), reason=reason)
            self._events.emit(refused, self._vehicle, at)


def _is_grey(image: Any) -> bool:
    """Whether it has rows and columns, and at least one of each."""
    shape = getattr(image, "shape", ())
    return len(shape) == 2 and 0 not in shape
