"""The poses of a body from another thread, in the units and axes of its tracker, as the engine
reads them; the only place where a tracker's units and axes are converted to those of the world.

`z_up`: x, y, z are the world's. `y_up`: x to the right, y up, z towards the viewer (Motive's
default), so with R the quarter turn about x that lifts y to z, p_world = R p and q_world = R q
R^-1: a body whose own axes were defined parallel to the tracker's while its nose pointed along x is
level and heads east.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from math import isfinite, sqrt
from typing import Literal, Protocol

from kybflow.core.clock_offset import Offset
from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import NS, Measurement, Pose, Time
from kybflow.parts.sensor import Stream

Units = Literal["m", "mm"]
Axes = Literal["z_up", "y_up"]
_METRES = {"m": 1.0, "mm": 1e-3}


def to_world(position: Vec3, attitude: Quat, units: Units, axes: Axes) -> tuple[Vec3, Quat] | None:
    """The pose in the world, the attitude of unit length; None for what is no pose: not finite, or
    no rotation, as a tracker writes for a body that it has lost."""
    n = sqrt(sum(x * x for x in attitude))
    if not (isfinite(n) and all(map(isfinite, position)) and 0.9 < n < 1.1):
        return None
    s = _METRES[units]
    (x, y, z), (qw, qx, qy, qz) = position, attitude
    if axes == "y_up":
        y, z, qy, qz = -z, y, -qz, qy
    return (s * x, s * y, s * z), (qw / n, qx / n, qy / n, qz / n)


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
