"""What a recording knows of the world's objects: how they moved, in truth and as motion capture saw
them, and which vehicles touched them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kybflow.core.signals import NS
from kybflow.recording.layout import OBJECTS_TOPIC
from kybflow.recording.messages import Recording
from kybflow.report.estimators import Array, heading


@dataclass(frozen=True)
class ObjectMotion:
    """The motion of an object. time: s, (n,). position: m, world, (n, 3). attitude: quaternions,
    (n, 4). q: the coordinate of its joint, m or rad, (n,)."""

    time: Array
    position: Array
    attitude: Array
    q: Array

    def coordinate(self, name: str) -> Array:
        """Return a coordinate by its name in conditions, SI, without jumps of a turn."""
        if name in ("angle", "yaw"):
            return np.unwrap(self.q if name == "angle" else heading(self.attitude))
        return self.q if name == "position" else self.position[:, "xyz".index(name)]


@dataclass(frozen=True)
class ObjectTrack:
    """An object that moves. coordinates, stops, goals: as in the recording's head. boxes: the
    corners of its box and plates, in its axes, m, (k, 8, 3). motions: how it moved, by `true`, in
    simulation, and `seen`, by motion capture."""

    coordinates: list[str]
    boxes: Array
    stops: list[tuple[list[float], list[float]]]
    goals: Mapping[str, Mapping[str, float]]
    motions: Mapping[str, ObjectMotion]

    def outlines(self, moment: float) -> list[Array]:
        """Return its boxes and plates from above at `moment` (s): corners, world frame, (n, 2)."""
        motion = next(iter(self.motions.values()))
        row = max(0, int(np.searchsorted(motion.time, moment, side="right")) - 1)
        return self._outlines(motion.position[row], motion.attitude[row])

    def at_stops(self) -> list[Array]:
        """Return its outlines at the stops of its joint."""
        return [outline for pose in self.stops for outline in self._outlines(*pose)]

    def _outlines(self, position: Any, attitude: Any) -> list[Array]:
        from scipy.spatial import ConvexHull

        w, x, y, z = attitude
        flat = np.array([  # the first two rows of the rotation matrix
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        ])  # fmt: skip
        corners = [box @ flat.T + position[:2] for box in self.boxes]
        return [box[ConvexHull(box).vertices] for box in corners]


@dataclass(frozen=True)
class RecordedObjects:
    """The objects that move, by name, and the contacts with them at the times `time`, s, (n,).

    forces: those of a vehicle on a surface, by vehicle and `OBJECT.SURFACE` or, on its box,
    `OBJECT`; N, (n,). touched: 1 while a vehicle touches an object as conditions read it, by
    vehicle and object. Both are not-a-number without contact.
    """

    tracks: dict[str, ObjectTrack] = field(default_factory=dict)
    forces: dict[tuple[str, str], Array] = field(default_factory=dict)
    touched: dict[tuple[str, str], Array] = field(default_factory=dict)
    time: Array = field(default_factory=lambda: np.zeros(0))


def read_objects(log: Recording) -> RecordedObjects:
    """Read the objects of a recording; none if nothing was recorded of them."""
    moments, time = [*log[OBJECTS_TOPIC].json()], log[OBJECTS_TOPIC].times / NS
    found = RecordedObjects(time=time)
    for name, made in log.mission.get("objects", {}).items():
        motions = {}
        for known in ("true", "seen"):
            rows = [
                (of.get("seen_s", t), of["position"], of["attitude"], of["q"])
                for t, moment in zip(time, moments, strict=True)
                if (of := moment.get(name, {}).get(known))
            ]
            if rows:
                motions[known] = ObjectMotion(*map(np.array, zip(*rows, strict=True)))
        boxes = np.array(made["boxes"]).reshape(-1, 8, 3)
        if motions:
            found.tracks[name] = ObjectTrack(
                made["coordinates"], boxes, made["stops"], made["goals"], motions
            )
    for row, moment in enumerate(moments):
        for name, one in moment.items():
            for key, force in one["force_n"].items():
                vehicle, _, surface = key.partition(".")
                path = (vehicle, f"{name}.{surface}".removesuffix("."))
                found.forces.setdefault(path, np.full(len(time), np.nan))[row] = force
            for vehicle in one["touched_by"]:
                found.touched.setdefault((vehicle, name), np.full(len(time), np.nan))[row] = 1.0
    return found
