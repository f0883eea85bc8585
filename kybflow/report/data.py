"""A run folder read back, as arrays for the report: `log.mcap`, `events.jsonl`, `summary.json`,
the world of `mission.resolved.yaml`, the pictures in `frames/`.

A run that was killed has no summary and a log without an end; what is readable is read.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import McapError
from numpy.typing import NDArray

from kybflow.core.signals import NS
from kybflow.dsl.reading.folders import PROVENANCE, RESOLVED
from kybflow.recording.layout import HAS_POSITION, HAS_VELOCITY, dtype_spec
from kybflow.recording.run_folder import EVENTS, LOG, SUMMARY, RunFolderError
from kybflow.report.estimators import Estimated, read_estimators
from kybflow.report.log import Log, read_log
from kybflow.report.pictures import Picture, read_pictures
from kybflow.report.world import World, read_world

Array = NDArray[np.float64]

MOST = 6000
"""The most ticks of one vehicle that it shows; a long run is shown more coarsely."""

_TICK, _BATTERY = np.dtype(dtype_spec("Tick")), np.dtype(dtype_spec("Battery"))


@dataclass(frozen=True)
class Visit:
    """One visit to a state, from `start` to `end` seconds. ended: how, empty where the recording
    ends before it. aloft: it neither takes off nor lands. built_in: no mission wrote it."""

    name: str
    part: str
    start: float
    end: float
    ended: str
    aloft: bool
    built_in: bool


@dataclass(frozen=True)
class Track:
    """One vehicle over time, SI, not-a-number where there is no value.

    position: the true one in simulation, else the estimate. reference: the setpoint that the
    tracker followed. to_target: from the position to where the behavior's last setpoint is.
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
    visits: tuple[Visit, ...]


@dataclass(frozen=True)
class Run:
    """Everything that the report shows. `mission` is what the recording says of the mission;
    `summary` is empty for a run that was killed. estimators: one without a name is what its vehicle
    flew on."""

    mission: dict[str, Any]
    summary: dict[str, Any]
    provenance: dict[str, Any]
    events: list[dict[str, Any]]
    tracks: tuple[Track, ...]
    end: float
    world: World
    estimators: tuple[Estimated, ...] = ()
    pictures: tuple[Picture, ...] = ()


def read_run(folder: Path) -> Run:
    """The run in `folder`. Raises RunFolderError where its files can't be read."""
    try:
        log = read_log(folder / LOG)
        events = [json.loads(line) for line in _whole_lines(folder / EVENTS)]
        world = read_world(folder / RESOLVED)
        summary, provenance = _read_json(folder / SUMMARY), _read_json(folder / PROVENANCE)
        pictures = read_pictures(folder)
    except (OSError, ValueError, McapError) as error:
        raise RunFolderError(f"`{folder}` is no run that can be read: {error}") from error
    end = max([0, *log.last.values()]) / NS
    tracks = tuple(
        _track(name, facts, log, _visits(events, name, facts["states"], end))
        for name, facts in log.mission["vehicles"].items()
    )
    estimators = tuple(e for name in log.mission["vehicles"] for e in read_estimators(log, name))
    return Run(log.mission, summary, provenance, events, tracks, end, world, estimators, pictures)


def _whole_lines(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return text.split("\n")[:-1]


def _read_json(path: Path) -> dict[str, Any]:
    value = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return value if isinstance(value, dict) else {}


def _visits(
    events: list[dict[str, Any]], vehicle: str, states: dict[str, dict[str, bool]], end: float
) -> tuple[Visit, ...]:
    visits: list[Visit] = []
    for event in events:
        if event["vehicle"] != vehicle:
            continue
        fields, t = event["fields"], event["t_s"]
        if event["event"] == "behavior_started":
            name, part = fields["behavior"], fields["part"]
            visits.append(Visit(name, part, t, end, "", **states[name]))
        elif event["event"] == "behavior_ended" and visits:
            visits[-1] = replace(visits[-1], end=t, ended=fields["how"])
    return tuple(visits)


def _track(name: str, facts: dict[str, Any], log: Log, visits: tuple[Visit, ...]) -> Track:
    messages = log.messages.get(f"/{name}/tick", [])
    kept = messages[:: max(1, math.ceil(len(messages) / MOST))]
    ticks = np.frombuffer(b"".join(m.data for m in kept), _TICK)
    time = np.array([m.log_time for m in kept], np.float64) / NS
    reports = log.messages.get(f"/{name}/battery", [])
    battery = np.frombuffer(b"".join(m.data for m in reports), _BATTERY)
    position, velocity = _state(ticks, "position"), _state(ticks, "velocity")
    reference = _field(ticks["setpoint"], "position", HAS_POSITION)
    return Track(
        name=name,
        start=list(facts["start"]),
        time=time,
        position=position,
        reference=reference,
        position_error=_norm(position - reference),
        velocity_error=_norm(velocity - _field(ticks["setpoint"], "velocity", HAS_VELOCITY)),
        to_target=_to_target(
            time, position, _field(ticks["wanted"], "position", HAS_POSITION), visits
        ),
        battery_time=np.array([m.log_time for m in reports], np.float64) / NS,
        battery=battery["remaining"],
        visits=visits,
    )


def _state(ticks: NDArray[Any], name: str) -> Array:
    """The truth where it is known, else the estimate."""
    truth, estimate = ticks["truth"], ticks["estimate"]
    believed = np.where(estimate["present"][:, None], estimate[name], np.nan)
    known: Array = np.where(truth["present"][:, None], truth[name], believed)
    return known


def _field(setpoints: NDArray[Any], name: str, mark: int) -> Array:
    value: Array = np.where((setpoints["present"] & mark)[:, None] > 0, setpoints[name], np.nan)
    return value


def _norm(vectors: Array) -> Array:
    length: Array = np.sqrt((vectors * vectors).sum(axis=1))
    return length


def _to_target(time: Array, position: Array, wanted: Array, visits: tuple[Visit, ...]) -> Array:
    distances = np.full(len(time), np.nan)
    for visit in visits:
        inside = (time >= visit.start) & (time < visit.end)
        goals = wanted[inside]
        goals = goals[~np.isnan(goals[:, 0])]
        if len(goals):
            distances[inside] = _norm(position[inside] - goals[-1])
    return distances
