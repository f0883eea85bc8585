"""The sensors of one vehicle beside its link.

What they measure comes in place of what the link measures of the same kinds. One that fails is told
once, until it works again, and its estimators age; the link is not blamed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import NamedTuple

from kybflow.dsl.plan import SensorPlan
from kybflow.errors import DriverError, described
from kybflow.parts import Stream
from kybflow.runtime.events import Events
from kybflow.signals import CLASSES, Measurement, MeasurementKind, Time

_BY_TIME = attrgetter("time")


class Opened(NamedTuple):
    """A sensor and what it has open."""

    plan: SensorPlan
    stream: Stream


class Sensing:
    """`streams` are what is open, by the sensor's label."""

    def __init__(self, vehicle: str, opened: Sequence[Opened], events: Events) -> None:
        self._vehicle, self._opened, self._events = vehicle, opened, events
        self._failed: set[str] = set()
        kinds = (kind for sensor in opened for kind in sensor.plan.part.cls.provides)
        self._replaced = frozenset(CLASSES[kind] for kind in kinds)
        self.streams: dict[str, Stream] = {s.plan.part.label: s.stream for s in opened}

    def left_of(self, measurements: Sequence[Measurement]) -> Sequence[Measurement]:
        """What of the link's measurements counts."""
        if not self._replaced:
            return measurements
        return [m for m in measurements if type(m) not in self._replaced]

    def joined(
        self,
        measurements: Sequence[Measurement],
        now: Time,
        note: Callable[[Sequence[Measurement], Time], None],
    ) -> Sequence[Measurement]:
        """The link's measurements with those of the sensors, which are noted first; oldest
        first."""
        found = list(measurements)
        for sensor in self._opened:
            found += self._read(sensor, now, note)
        return sorted(found, key=_BY_TIME)

    def trouble(self, kind: MeasurementKind) -> str | None:
        """Why no measurements of `kind` can come, as far as a sensor knows."""
        for sensor in self._opened:
            if kind in sensor.plan.part.cls.provides:
                try:
                    trouble = sensor.stream.trouble()
                except Exception as error:  # a part may raise anything
                    trouble = described(error)
                if trouble is not None:
                    return trouble
        return None

    def _read(
        self, sensor: Opened, now: Time, note: Callable[[Sequence[Measurement], Time], None]
    ) -> Sequence[Measurement]:
        part = sensor.plan.part
        name = part.label.rpartition(".")[2]
        try:
            found = sensor.stream.read(now)
            note(found, now)
        except Exception as error:  # a part may raise anything; it ends no other
            if name not in self._failed:
                self._failed.add(name)
                reason = str(error) if isinstance(error, DriverError) else described(error)
                self._events.tell(
                    "sensor_failed", self._vehicle, part.at, sensor=name, reason=reason
                )
            return ()
        if found and name in self._failed:
            self._failed.remove(name)
            self._events.tell("sensor_recovered", self._vehicle, part.at, sensor=name)
        return found
