"""Logs what viewers draw of a run.

- `/scene`, `/scans`: the world and the vehicles, once, at time zero.
- `/tf`: the frames of all vehicles, `FRAME_RATE` times a second: `NAME` as the vehicle believes
  and, every third time, `NAME/true` as the simulator knows.
- `/tf/obstacles`, `/tf/objects`: the frames of what else moves, as motion capture saw it, 20 times
  a second.
- `/NAME/setpoint_pose`: the followed setpoint, as often as `/tf`, while it has a position.
- `/NAME/position_error`: from there to the vehicle (m, world frame), a third as often.
- `/NAME/trail`: the vehicle's path of the last `TRAIL_SECONDS`, once a second.
- `/log`: every event as a line.

Each message replaces the previous one of its topic, because a viewer that jumps to a time reads
only the newest.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from foxglove import Context, channels
from foxglove import messages as fox

from kybflow.core.geometry import LEVEL, ZERO, Quat, Vec3, from_heading, sub
from kybflow.core.signals import Estimate, SeenObjects, SeenObstacles, Setpoint, Time, Truth
from kybflow.dsl.plan import Plan
from kybflow.recording.appearance import ALARM, COLLISION, EVENT, fields_text, kind_of
from kybflow.recording.viewers.scene import (
    WORLD_FRAME,
    colour,
    colours,
    point,
    pose,
    quaternion,
    scans,
    scene,
    stamp,
    true_frame,
    vector,
)
from kybflow.world.objects import place_of

SCENE_TOPIC, SCANS_TOPIC, LOG_TOPIC = "/scene", "/scans", "/log"
FRAME_RATE = 30
"""The rate of frames and setpoints, Hz; in fact the nearest that takes a whole number of ticks."""
TRAIL_SECONDS = 15
_TRUE_EVERY, _POINT_EVERY = 3, 8
"""How many frames there are for each true pose, and for each point of a trail."""
_LEVELS = {EVENT: fox.LogLevel.Info, ALARM: fox.LogLevel.Warning, COLLISION: fox.LogLevel.Error}


def frame_every(control_rate: int) -> int:
    """Return n such that every n-th tick is drawn."""
    return max(1, round(control_rate / FRAME_RATE))


class DrawnRun:
    """Logs what viewers draw of a run. vehicles: its vehicles, by name."""

    def __init__(self, plan: Plan, context: Context) -> None:
        self._objects = plan.objects
        self._log = channels.LogChannel(LOG_TOPIC, context=context)
        channels.SceneUpdateChannel(SCENE_TOPIC, context=context).log(scene(plan), log_time=0)
        if (points := scans(plan)) is not None:
            channels.PointCloudChannel(SCANS_TOPIC, context=context).log(points, log_time=0)
        self._fleet_frames, self._obstacle_frames, self._object_frames = (
            channels.FrameTransformsChannel(topic, context=context)
            for topic in ("/tf", "/tf/obstacles", "/tf/objects")
        )
        shades = colours(plan)
        self.vehicles = {name: DrawnVehicle(name, shades[name], self, context) for name in shades}
        self._waiting: list[fox.FrameTransform] = []
        self._missing = len(shades)

    def event(self, now: Time, record: Mapping[str, Any]) -> None:
        """Log an event. record: as `kybflow.recording.layout.event_record` writes it."""
        file, _, line = record["at"].rpartition(":")
        message = fox.Log(
            timestamp=stamp(now), level=_LEVELS[kind_of(record)],
            message=f"{record['event']} {fields_text(record)}".rstrip(),
            name=record["vehicle"] or "run", file=file, line=int(line) if line.isdecimal() else 0,
        )  # fmt: skip
        self._log.log(message, log_time=now)

    def obstacles(self, now: Time, seen: SeenObstacles) -> None:
        at = stamp(now)
        frames = [_frame(at, name, one.position, LEVEL) for name, one in seen.items()]
        self._obstacle_frames.log(fox.FrameTransforms(transforms=frames), log_time=now)

    def objects(self, now: Time, seen: SeenObjects) -> None:
        """Log where the objects are. One that nobody has seen is where it starts."""
        at = stamp(now)
        frames = [_frame(at, name, *place_of(self._objects, seen, name)) for name in self._objects]
        self._object_frames.log(fox.FrameTransforms(transforms=frames), log_time=now)

    def moved(self, now: Time, frames: list[fox.FrameTransform]) -> None:
        """Collect the frames of a vehicle, and log those of all once the last has come."""
        self._waiting += frames
        self._missing -= 1
        if self._missing == 0:
            fleet = fox.FrameTransforms(transforms=self._waiting)
            self._fleet_frames.log(fleet, log_time=now)
            self._waiting, self._missing = [], len(self.vehicles)


class DrawnVehicle:
    """Logs what viewers draw of a vehicle."""

    def __init__(self, name: str, shade: str, run: DrawnRun, context: Context) -> None:
        self._name, self._true, self._colour, self._run = name, true_frame(name), colour(shade), run
        self._setpoint = channels.PoseInFrameChannel(f"/{name}/setpoint_pose", context=context)
        self._error = channels.Vector3Channel(f"/{name}/position_error", context=context)
        self._trail = channels.SceneUpdateChannel(f"/{name}/trail", context=context)
        self._path = deque[fox.Point3](maxlen=TRAIL_SECONDS * FRAME_RATE // _POINT_EVERY)
        self._frames = 0

    def draw(
        self, now: Time, estimate: Estimate | None, setpoint: Setpoint | None, truth: Truth | None
    ) -> None:
        """Log a frame. truth: None on hardware."""
        number, self._frames = self._frames, self._frames + 1
        shows_truth, at, frames = number % _TRUE_EVERY == 0, stamp(now), []
        if estimate is not None:
            frames.append(_frame(at, self._name, estimate.position, estimate.attitude))
            if number % _POINT_EVERY == 0:
                self._path.append(point(estimate.position))
        if truth is not None and shows_truth:
            frames.append(_frame(at, self._true, truth.position, truth.attitude))
        self._run.moved(now, frames)
        if setpoint is not None and setpoint.position is not None:
            wanted = pose(setpoint.position, from_heading(setpoint.heading or 0.0))
            goal = fox.PoseInFrame(timestamp=at, frame_id=WORLD_FRAME, pose=wanted)
            self._setpoint.log(goal, log_time=now)
            where = truth or estimate
            if where is not None and shows_truth:
                self._error.log(vector(sub(where.position, setpoint.position)), log_time=now)
        if number % FRAME_RATE == 0:
            self._trail.log(self._path_flown(now), log_time=now)

    def _path_flown(self, now: Time) -> fox.SceneUpdate:
        line = fox.LinePrimitive(
            type=fox.LinePrimitiveLineType.LineStrip, pose=pose(ZERO), thickness=2.0,
            scale_invariant=True, points=[*self._path], color=self._colour,
        )  # fmt: skip
        name = f"{self._name}/trail"
        trail = fox.SceneEntity(timestamp=stamp(now), frame_id=WORLD_FRAME, id=name, lines=[line])
        return fox.SceneUpdate(entities=[trail])


def _frame(at: fox.Timestamp, name: str, position: Vec3, attitude: Quat) -> fox.FrameTransform:
    return fox.FrameTransform(
        timestamp=at, parent_frame_id=WORLD_FRAME, child_frame_id=name,
        translation=vector(position), rotation=quaternion(attitude),
    )  # fmt: skip
