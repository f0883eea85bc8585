"""A body's poses from another thread, as the engine reads them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol

from kybflow.core.clock_offset import Offset
from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import NS, Measurement, Pose, Time
from kybflow.parts.sensor import Stream
from kybflow.sensors._axes import Axes, Units, to_world


class Tracked(Protocol):
    """A pose in the tracker's own units and axes; time: on the monotonic clock."""

    @property
    def time(self) -> Time: ...
    @property
    def position(self) -> Vec3: ...
    @property
    def attitude(self) -> Quat: ...


class PoseSource(Protocol):
    """Where they come from."""

    def take(self) -> Sequence[Tracked]: ...
    def trouble(self) -> str | None: ...
    def close(self) -> None: ...


class PoseStream(Stream):
    """Poses on the run's clock, in the world, what no pose is left out. latency: seconds that are
    taken off every time."""

    def __init__(
        self,
        source: PoseSource,
        units: Units,
        axes: Axes,
        latency: float,
        clock: Callable[[], Time] = time.monotonic_ns,
    ) -> None:
        self._source, self._units, self._axes, self._clock = source, units, axes, clock
        self._latency: Time = round(latency * NS)
        self._offset = Offset()

    def read(self, now: Time) -> Sequence[Measurement]:
        began = self._offset.of(self._clock(), now)  # a tick can be late, never early
        poses: list[Measurement] = []
        for tracked in self._source.take():
            pose = to_world(tracked.position, tracked.attitude, self._units, self._axes)
            if pose is not None:
                poses.append(Pose(min(tracked.time - began, now) - self._latency, *pose))
        return poses

    def trouble(self) -> str | None:
        return self._source.trouble()

    def close(self) -> None:
        self._source.close()
