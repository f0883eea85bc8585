"""Which of the measurements that arrive can be true; the others are left out, whoever gives them.

Left out is what is stamped more than `AHEAD` after now: an estimator that took it would take
nothing else until then. So is a frame of a camera that the vehicle doesn't have, and one whose
image is none. The first of each is told.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from kybflow.core.signals import NS, Frame, Measurement, MeasurementKind, Time, kind_name
from kybflow.runtime.events import Events

AHEAD: Time = NS // 200
"""By how much a stamp may be later than now: clocks are compared by estimates of their offset, and
a tick can be late."""


class Admission:
    """Of the measurements of one vehicle, with these cameras."""

    def __init__(self, vehicle: str, cameras: Collection[str], events: Events) -> None:
        self._vehicle, self._cameras, self._events = vehicle, cameras, events
        self._counts: dict[MeasurementKind, int] = {}
        self._told: set[tuple[str, MeasurementKind, str]] = set()

    def admitted(
        self, measurements: Sequence[Measurement], now: Time, source: str, at: str
    ) -> Sequence[Measurement]:
        """Those that count. source: who gives them, named by the mission's line `at`."""
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
        if (source, kind, sort) not in self._told:
            self._told.add((source, kind, sort))
            self._events.tell(
                "measurement_refused",
                self._vehicle,
                at,
                source=source,
                kind=kind_name(kind),
                reason=reason,
            )


def _is_grey(image: Any) -> bool:
    """Whether it has rows and columns, and at least one of each."""
    shape = getattr(image, "shape", ())
    return len(shape) == 2 and 0 not in shape
