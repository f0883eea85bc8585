"""Reads a run folder for the report: `log.mcap`, `events.jsonl`, `summary.json`, the obstacles and
points of `mission.resolved.yaml`, the pictures in `frames/` and the tables in `inputs/`.

A run that was killed has no summary and a truncated log; the report shows what can be read.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from mcap.exceptions import McapError
from numpy.typing import NDArray

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.geometry import Vec3
from kybflow.core.signals import NS, Battery
from kybflow.core.units import ANGLE, LENGTH, NUMBER, parse_quantity
from kybflow.dsl.reading.reader import PROVENANCE, RESOLVED
from kybflow.inputs.rows import InputRows, parse
from kybflow.recording.layout import (
    HAS_POSITION,
    HAS_VELOCITY,
    OBSTACLES_TOPIC,
    dtype_spec,
)
from kybflow.recording.messages import Messages, Recording, read_recording
from kybflow.recording.run_folder import (
    EVENTS,
    FRAMES,
    INPUTS,
    LOG,
    SUMMARY,
    RunFolderError,
    whole_lines,
)
from kybflow.report.estimators import Array, EstimatorTrack, norm, read_estimators
from kybflow.report.objects import RecordedObjects, read_objects
from kybflow.world.obstacle_files import occupied_places, read_image, read_info, read_points
from kybflow.world.scanned import METRES, Columns, PointCloud, placed, thinned
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere


@dataclass(frozen=True)
class RecordedWorld:
    """The named points and the obstacles of a mission, by name; metres, world frame."""

    points: dict[str, Vec3] = field(default_factory=dict)
    obstacles: dict[str, Shape] = field(default_factory=dict)


def read_world(path: Path) -> RecordedWorld:
    """Read the world of the mission file at `path`; an empty one if there is no file. Raises
    ValueError."""
    if not path.exists():
        return RecordedWorld()
    try:
        world = yaml.safe_load(path.read_text(encoding="utf-8")).get("world") or {}
        points = {name: _vector(at) for name, at in world.get("points", {}).items()}
        obstacles = {
            name: shape
            for name, found in world.get("obstacles", {}).items()
            if "moving_sphere" not in found and (shape := _shape(found, path.parent))
        }
    except (yaml.YAMLError, FileError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"`{path.name}` has no readable world: {error}") from error
    return RecordedWorld(points, obstacles)


def _shape(obstacle: dict[str, Any], folder: Path) -> Shape | None:
    ((kind, of),) = ((key, of) for key, of in obstacle.items() if isinstance(of, dict))
    if kind == "point_cloud":
        return _cloud(of, folder)
    if kind == "occupancy":
        return _columns(of, folder)
    if kind == "box":
        return Box(_vector(of["from"]), _vector(of["to"]))
    at = _vector(of["at"])
    if kind == "cylinder":
        return Cylinder(at, _length(of["radius"]), _length(of["height"]))
    if kind == "sphere":
        return Sphere(at, _length(of["radius"]))
    x, y, z = (parse_quantity(str(n), NUMBER) for n in of["facing"])
    return Plane(at, (x, y, z))


def _cloud(of: dict[str, Any], folder: Path) -> PointCloud | None:
    """Read a point cloud from the copy of its file; None if there is no copy."""
    file = _copy(folder, of["file"])
    if file is None:
        return None
    above = None if "above" not in of else _length(of["above"])
    heading = parse_quantity(str(of["heading"]), ANGLE)
    scan = read_points(file)
    points = placed(scan, METRES[of["units"]], _vector(of["at"]), heading, above)
    radius = _length(of["radius"])
    return PointCloud.of(thinned(points, radius), radius)


def _columns(of: dict[str, Any], folder: Path) -> Columns | None:
    """Read an occupancy map from the copies of its files; None if one is missing."""
    file = _copy(folder, of["file"])
    info = None if file is None else read_info(file)
    image = None if info is None else _copy((folder / of["file"]).parent, info.image)
    if info is None or image is None:
        return None
    places = occupied_places(info, read_image(image))
    low = _length(of["foot"])
    return Columns.over(places, info.resolution, low, low + _length(of["height"]))


def _copy(folder: Path, name: str) -> File | None:
    """Read the copy of a mission's file in a run folder; None if there is no copy."""
    try:
        text = (folder / name).read_bytes().decode("utf-8-sig", "surrogateescape")
    except OSError:
        return None
    return File(name, "", text)


def _vector(texts: list[str]) -> Vec3:
    x, y, z = (_length(text) for text in texts)
    return (x, y, z)


def _length(text: str) -> float:
    return parse_quantity(text, LENGTH)


MOST_TICKS = 6000
"""The most ticks per vehicle in the report; of a longer run only every n-th tick is used."""
MOST_PICTURES = 96
"""The most pictures in a report; the others remain in the folder."""

_SETPOINT = np.dtype(dtype_spec("Setpoint"))
_BATTERY = np.dtype(dtype_spec(Battery))
_PICTURE_NAME = re.compile(r"(\d+\.\d+)s-(?:(\d+)-used-(\d+)-rejected|no-pose)\.jpg")


@dataclass(frozen=True)
class StateVisit:
    """One visit to a state, from `start` to `end` seconds.

    ended: how its behavior ended; empty if the recording ends first. aloft: whether the behavior
    neither takes off nor lands. built_in: whether the language adds the state. hears: whether the
    behavior uses what other vehicles publish.
    """

    name: str
    part: str
    start: float
    end: float
    ended: str
    aloft: bool
    built_in: bool
    hears: bool = False


@dataclass(frozen=True)
class Track:
    """One vehicle over time. SI units; not-a-number where there is no value.

    position: the true position in simulation, otherwise the estimate. reference: the setpoint that
    the tracker followed. position_error, velocity_error: the distances from the behavior's
    setpoint, while in the air. to_target: the distance from the position to the last setpoint of
    the behavior.
    """

    name: str
    start: list[float]
    time: Array
    position: Array
    reference: Array
    position_error: Array
    velocity_error: Array
    to_target: Array
    battery_time: Array
    battery: Array
    visits: tuple[StateVisit, ...]


@dataclass(frozen=True)
class MovingTrack:
    """A moving obstacle. time: seconds, (n,). position: metres, world, (n, 3). radius: metres."""

    time: Array
    position: Array
    radius: float


@dataclass(frozen=True)
class Picture:
    """A camera frame with its tags marked.

    time: seconds. used, rejected: the numbers of tags that the pose estimate used and rejected;
    None if there was no pose.
    """

    vehicle: str
    estimator: str
    camera: str
    time: float
    used: int | None
    rejected: int | None
    data: bytes


@dataclass(frozen=True)
class RecordedRun:
    """The content of a report.

    mission: the metadata of the recording. summary: empty for a run that was killed. end: the run's
    end, s. estimators: an estimator without a name stands for the estimates that its vehicle flew
    on.
    """

    mission: dict[str, Any]
    summary: dict[str, Any]
    provenance: dict[str, Any]
    events: list[dict[str, Any]]
    tracks: tuple[Track, ...]
    end: float
    world: RecordedWorld
    estimators: tuple[EstimatorTrack, ...] = ()
    pictures: tuple[Picture, ...] = ()
    inputs: dict[str, InputRows] = field(default_factory=dict)
    moving: dict[str, MovingTrack] = field(default_factory=dict)
    objects: RecordedObjects = field(default_factory=RecordedObjects)

    @property
    def simulated(self) -> bool:
        """Whether the recording holds the truth."""
        return self.mission.get("simulated") is not False


def read_run(folder: Path) -> RecordedRun:
    """Read the run in `folder`. Raises RunFolderError."""
    try:
        log = read_recording(folder / LOG)
        events = [json.loads(line) for line in whole_lines(folder / EVENTS)]
        world = read_world(folder / RESOLVED)
        summary, provenance = _read_json(folder / SUMMARY), _read_json(folder / PROVENANCE)
        pictures = read_pictures(folder)
        inputs = read_inputs(folder)
    except (OSError, ValueError, FileError, McapError) as error:
        raise RunFolderError(f"`{folder}` is not a readable run: {error}") from error
    end = log.end / NS
    tracks = tuple(
        _track(name, facts, log, _visits(events, name, facts["states"], end), summary)
        for name, facts in log.mission["vehicles"].items()
    )
    estimators = tuple(e for name in log.mission["vehicles"] for e in read_estimators(log, name))
    return RecordedRun(
        log.mission, summary, provenance, events, tracks, end, world, estimators, pictures, inputs,
        read_moving(log), read_objects(log),
    )  # fmt: skip


def read_moving(log: Recording) -> dict[str, MovingTrack]:
    """Return the moving obstacles by name."""
    rows: dict[str, list[dict[str, Any]]] = {}
    for obstacles in log[OBSTACLES_TOPIC].json():
        for name, one in obstacles.items():
            rows.setdefault(name, []).append(one)
    return {
        name: MovingTrack(
            np.array([row["seen_s"] for row in seen]),
            np.array([row["position"] for row in seen]),
            seen[0]["radius"],
        )
        for name, seen in rows.items()
    }


def read_inputs(folder: Path) -> dict[str, InputRows]:
    """Return the recorded rows of each input by name, without inputs that have none. Raises
    FileError."""
    texts = {p.stem: whole_lines(p) for p in sorted((folder / INPUTS).glob("*.csv"))}
    return {name: parse("\n".join(lines)) for name, lines in texts.items() if len(lines) > 1}


def _read_json(path: Path) -> dict[str, Any]:
    value = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return value if isinstance(value, dict) else {}


def _visits(
    events: list[dict[str, Any]], vehicle: str, states: dict[str, dict[str, bool]], end: float
) -> tuple[StateVisit, ...]:
    visits: list[StateVisit] = []
    for event in events:
        if event["vehicle"] != vehicle:
            continue
        fields, t = event["fields"], event["t_s"]
        if event["event"] == "behavior_started":
            name, part = fields["behavior"], fields["part"]
            visits.append(StateVisit(name, part, t, end, "", **states[name]))
        elif event["event"] == "behavior_ended" and visits:
            visits[-1] = replace(visits[-1], end=t, ended=fields["how"])
    return tuple(visits)


def _track(
    name: str,
    facts: dict[str, Any],
    log: Recording,
    visits: tuple[StateVisit, ...],
    summary: dict[str, Any],
) -> Track:
    rows = log.ticks(name)
    stamps, ticks = rows.every(max(1, math.ceil(len(rows.times) / MOST_TICKS)))
    time = stamps / NS
    charged, battery = log[f"/{name}/battery"].decoded(_BATTERY)
    position, velocity = _state(ticks, "position"), _state(ticks, "velocity")
    reference = _field(ticks["setpoint"], "position", HAS_POSITION)
    wanted = _wanted(ticks["setpoint"], stamps, log[f"/{name}/wanted"])
    goal = _field(wanted, "position", HAS_POSITION)
    flies = np.zeros(len(time), bool)
    own = summary.get("vehicles", {}).get(name, {})
    for begin, finish in own.get("airborne_s", [[0.0, None]]):  # a killed run has no summary
        flies |= (time >= begin) & (time < (np.inf if finish is None else finish))
    return Track(
        name=name,
        start=list(facts["start"]),
        time=time,
        position=position,
        reference=reference,
        position_error=np.where(flies, norm(position - goal), np.nan),
        velocity_error=np.where(
            flies, norm(velocity - _field(wanted, "velocity", HAS_VELOCITY)), np.nan
        ),
        to_target=_to_target(time, position, goal, visits),
        battery_time=charged / NS,
        battery=battery["remaining"],
        visits=visits,
    )


def _wanted(followed: NDArray[Any], stamps: NDArray[np.int64], others: Messages) -> NDArray[Any]:
    """Return the behavior's setpoint in each tick: the one from `/wanted` at that time, or else the
    one that the tracker followed."""
    wanted, (times, other) = followed.copy(), others.decoded(_SETPOINT)
    _, index, of = np.intersect1d(stamps, times, return_indices=True)
    wanted[index] = other[of]
    return wanted


def _state(ticks: NDArray[Any], name: str) -> Array:
    """Return the truth if it is known, otherwise the estimate, per tick."""
    truth, estimate = ticks["truth"], ticks["estimate"]
    estimated = np.where(estimate["present"][:, None], estimate[name], np.nan)
    return np.where(truth["present"][:, None], truth[name], estimated)


def _field(setpoints: NDArray[Any], name: str, mark: int) -> Array:
    return np.where((setpoints["present"] & mark)[:, None] > 0, setpoints[name], np.nan)


def _to_target(
    time: Array, position: Array, wanted: Array, visits: tuple[StateVisit, ...]
) -> Array:
    distances = np.full(len(time), np.nan)
    for visit in visits:
        inside = (time >= visit.start) & (time < visit.end)
        goals = wanted[inside]
        goals = goals[~np.isnan(goals[:, 0])]
        if len(goals):
            distances[inside] = norm(position[inside] - goals[-1])
    return distances


def read_pictures(folder: Path) -> tuple[Picture, ...]:
    """Read the pictures of a run, for each camera in order of time. Raises OSError."""
    found: list[Picture] = []
    for path in sorted((folder / FRAMES).glob("*/*/*/*.jpg")):
        named = _PICTURE_NAME.fullmatch(path.name)
        if named is not None and len(found) < MOST_PICTURES:
            vehicle, estimator, camera = path.parts[-4:-1]
            used, rejected = (None if n is None else int(n) for n in named.groups()[1:])
            data, time = path.read_bytes(), float(named[1])
            found.append(Picture(vehicle, estimator, camera, time, used, rejected, data))
    return tuple(found)
