"""The poses of motion-capture systems, converted from their units and axes to the world's; and a
socket that wakes the thread that receives them.

With `z_up`, x, y and z are the world's axes. With `y_up`, x points right, y up and z towards the
viewer (Motive's default). With R the quarter turn about x that takes y to z, p_world = R p and
q_world = R q R^-1. A body whose axes were defined parallel to the tracker's while its nose pointed
along x is then level and heads east.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from math import isfinite, sqrt
from typing import Literal, NamedTuple

from kybflow.core.clock_offset import Offset
from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import NS, Measurement, Pose, Time
from kybflow.parts.sensor import Stream

Units = Literal["m", "mm"]
Axes = Literal["z_up", "y_up"]
_METRES = {"m": 1.0, "mm": 1e-3}
MOST_POSES = 2000
"""Largest number of unread poses of a source; older ones are dropped."""


def to_world(position: Vec3, attitude: Quat, units: Units, axes: Axes) -> tuple[Vec3, Quat] | None:
    """Return the pose in the world, metres, with a unit quaternion. Return None if its numbers are
    not finite or no rotation, as a tracker writes them for a lost body."""
    n = sqrt(sum(x * x for x in attitude))
    if not (isfinite(n) and all(map(isfinite, position)) and 0.9 < n < 1.1):
        return None
    s = _METRES[units]
    (x, y, z), (qw, qx, qy, qz) = position, attitude
    if axes == "y_up":
        y, z, qy, qz = -z, y, -qz, qy
    return (s * x, s * y, s * z), (qw / n, qx / n, qy / n, qz / n)


class TrackerPose(NamedTuple):
    """A pose in the tracker's units and axes. time, arrival: the times of its measurement and its
    arrival, on the monotonic clock."""

    time: Time
    arrival: Time
    position: Vec3
    attitude: Quat


class PoseSource(ABC):
    """A source of poses, filled by another thread. It must be closed after use."""

    def __init__(self) -> None:
        self.poses: deque[TrackerPose] = deque(maxlen=MOST_POSES)

    def take(self) -> list[TrackerPose]:
        """Return the poses that arrived since the last call, oldest first."""
        poses = self.poses
        return [poses.popleft() for _ in range(len(poses))]

    @abstractmethod
    def trouble(self) -> str | None:
        """Return why no poses arrive; None if they do."""

    @abstractmethod
    def close(self) -> None: ...


class PoseStream(Stream):
    """A stream of poses in the world frame and on the run's clock, without invalid ones. latency:
    seconds to subtract from each time."""

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


CHUNK = 1 << 16
"""Largest number of bytes to read at once."""


class Waker:
    """Ends another thread's wait on `receiver`. ended: set when the thread must stop."""

    def __init__(self) -> None:
        self.ended = threading.Event()
        self.receiver, self._sender = socket.socketpair()
        self.receiver.setblocking(False)
        self._sender.setblocking(False)

    def wake(self) -> None:
        with contextlib.suppress(OSError):  # full or closed: the thread is awake already
            self._sender.send(b"\0")

    def end(self) -> None:
        self.ended.set()
        self.wake()

    def drain(self) -> None:
        """Discard all wake-ups so far."""
        with contextlib.suppress(OSError):
            self.receiver.recv(CHUNK)

    def close(self) -> None:
        self.receiver.close()
        self._sender.close()
