"""What happened in a run, from its recording alone: read by the public `mcap` and by the message
definitions in the file, without any module of kybflow. `bench/verdicts.py` compares it with what
`summary.json` and the report say.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader

NS = 1_000_000_000
_PLAIN = {"bool": "?", "uint8": "u1", "int64": "<i8", "float32": "<f4", "float64": "<f8"}
_VECTORS = {
    "Vector": ("<f8", 3), "Vector32": ("<f4", 3),
    "Quaternion": ("<f8", 4), "Quaternion32": ("<f4", 4),
}  # fmt: skip
_FIELD = re.compile(r"(\w+)(?:\[(\d+)\])? (\w+)")


def layout_of(definition: str) -> np.dtype[Any]:
    """The layout of a message, from its ROS 1 definition; vectors as arrays."""
    first, *others = re.split(r"=+\nMSG: \w+/", definition)
    texts = dict(other.split("\n", 1) for other in others)

    def layout(text: str) -> np.dtype[Any]:
        fields: list[Any] = []
        for line in filter(None, (line.partition("#")[0].strip() for line in text.split("\n"))):
            match = _FIELD.match(line)
            assert match is not None, line
            kind, count, name = match.groups()
            if kind in _VECTORS:
                fields.append((name, *_VECTORS[kind]))
            else:
                own = _PLAIN[kind] if kind in _PLAIN else layout(texts[kind])
                fields.append((name, own, int(count)) if count else (name, own))
        return np.dtype(fields)

    return layout(first)


class Rows(NamedTuple):
    """The messages of a topic: their times, s, and their values, structures or JSON."""

    times: Any
    values: Any


def read(path: Path) -> dict[str, Rows]:
    """The topics of a recording, as far as it can be read."""
    times: dict[str, list[int]] = {}
    parts: dict[str, list[bytes]] = {}
    schemas: dict[str, Any] = {}
    with path.open("rb") as file:
        try:
            for schema, channel, message in NonSeekingReader(file).iter_messages(
                log_time_order=False
            ):
                if schema.encoding == "protobuf":
                    continue  # for viewers; it repeats what the other topics have
                schemas[channel.topic] = schema
                times.setdefault(channel.topic, []).append(message.log_time)
                parts.setdefault(channel.topic, []).append(message.data)
        except (McapError, struct.error):  # the end of a run that was killed
            pass
    return {topic: _rows(schemas[topic], times[topic], parts[topic]) for topic in schemas}


def _rows(schema: Any, times: list[int], parts: list[bytes]) -> Rows:
    stamps = np.array(times, np.int64) / NS
    if schema.encoding == "jsonschema":
        return Rows(stamps, [json.loads(part) for part in parts])
    return Rows(stamps, np.frombuffer(b"".join(parts), layout_of(schema.data.decode())))


class Vehicle:
    """One vehicle in every tick. time: s. position, velocity: the true ones. error,
    velocity_error: the distances from the behavior's setpoint while it is in the air, not-a-number
    elsewhere."""

    def __init__(self, name: str, topics: Mapping[str, Rows], airborne: list[Any]) -> None:
        empty = Rows(np.zeros(0), None)
        self.time, ticks = topics[f"/{name}/tick"]
        truth = ticks["truth"]
        assert truth["present"].all(), f"{name} has no truth"
        self.armed = ticks["command"]["armed"]
        self.position, self.velocity = truth["position"], truth["velocity"]
        self.speed = _norm(self.velocity)
        wanted = ticks["setpoint"].copy()
        times, other = topics.get(f"/{name}/wanted", empty)
        if other is not None:
            wanted[np.searchsorted(self.time, times)] = other
        self.flies = np.zeros(len(self.time), bool)
        for start, end in airborne:
            self.flies |= (self.time > start - 1e-6) & (
                self.time < (np.inf if end is None else end - 1e-6)
            )
        self.error = self._apart(wanted, "position", 1)
        self.velocity_error = self._apart(wanted, "velocity", 2)
        charged = topics.get(f"/{name}/battery", empty).values
        self.battery = None if charged is None else charged["remaining"]

    def _apart(self, wanted: Any, name: str, mark: int) -> Any:
        known = self.flies & (wanted["present"] & mark > 0)
        off = _norm(getattr(self, name) - wanted[name].astype(float))
        return np.where(known, off, np.nan)

    def values(self, name: str) -> Any:
        return {
            "position_error": self.error,
            "velocity_error": self.velocity_error,
            "state.altitude": self.position[:, 2],
            "state.speed": self.speed,
        }[name]

    def during(self, start: float, end: float | None) -> Any:
        """Which ticks are in an interval."""
        return (self.time > start - 1e-6) & (self.time < (np.inf if end is None else end - 1e-6))


def _norm(vectors: Any) -> Any:
    return np.sqrt((vectors * vectors).sum(axis=1))


class Visit(NamedTuple):
    name: str
    part: str
    start: float
    end: float
    ended: str


def visits_of(events: list[dict[str, Any]], vehicle: str) -> list[Visit]:
    """The stays in states, by the events; the last one ends with the run."""
    found: list[Visit] = []
    over = events[-1]["t_s"]
    for event in events:
        fields = event["fields"]
        if event["vehicle"] == vehicle and event["event"] == "behavior_started":
            start = event["t_s"]
            found.append(Visit(fields["behavior"], fields["part"], start, over, "run_ended"))
        elif event["vehicle"] == vehicle and event["event"] == "behavior_ended":
            found[-1] = found[-1]._replace(end=event["t_s"], ended=fields["how"])
    return found


UNITS = {"m": 1.0, "cm": 0.01, "m/s": 1.0, "cm/s": 0.01, "s": 1.0}
_NUMBER = r"(-?[\d.]+) (m/s|cm/s|cm|m|s)"
_OF = r"(\w+)\.(position_error|velocity_error|state\.altitude|state\.speed)"
STATISTIC = re.compile(rf"(max|min|mean|rms)\({_OF}(?: in (\w+))?\) ([<>]) {_NUMBER}")
ALWAYS = re.compile(rf"always {_OF} ([<>]) {_NUMBER}")
APART = re.compile(rf"always separation\((\w+) and (\w+)\) > {_NUMBER}")
EVENTUALLY = re.compile(rf"eventually {_OF} ([<>]) {_NUMBER}(?: within ([\d.]+) s)?")
REACHED = re.compile(r"eventually (\w+) in (\w+)(?: within ([\d.]+) s)?")
FINALLY = re.compile(rf"finally {_OF} ([<>]) {_NUMBER}")
ENDS_IN = re.compile(r"finally (\w+) in (\w+)")
FINISHED = re.compile(r"finished within ([\d.]+) s")


class Judged(NamedTuple):
    """What an expectation should say; None where the summary has null."""

    held: bool
    value: float | None
    margin: float | None


class Truth:
    """A run. begun: when the mission began, after the preflight, s. finished: when it was
    completed; None if it was not."""

    def __init__(
        self, topics: Mapping[str, Rows], events: list[dict[str, Any]], summary: Mapping[str, Any]
    ) -> None:
        self.events = events
        self.vehicles = {
            name: Vehicle(name, topics, own["airborne_s"])
            for name, own in summary["vehicles"].items()
        }
        self.visits = {name: visits_of(events, name) for name in self.vehicles}
        self.begun = min((v[0].start for v in self.visits.values() if v), default=0.0)
        over = next(event for event in events if event["event"] == "run_ended")
        self.end = over["t_s"]
        self.finished = self.end - self.begun if over["fields"]["reason"] is None else None

    def named(self, name: str) -> list[dict[str, Any]]:
        return [event for event in self.events if event["event"] == name]

    def judge(self, text: str) -> Judged:  # noqa: C901, PLR0911, PLR0912 - one form after another
        """The verdict on an expectation, of the forms that the study writes."""
        if match := STATISTIC.fullmatch(text):
            function, vehicle, value, state, sign, number, unit = match.groups()
            own = self.vehicles[vehicle]
            found = own.values(value)[self._inside(vehicle, state)]
            found = found[~np.isnan(found)]
            if not len(found):
                return Judged(False, None, None)
            result = {
                "max": np.max, "min": np.min, "mean": np.mean,
                "rms": lambda v: np.sqrt(np.mean(v * v)),
            }[function](found)  # fmt: skip
            return _against(float(result), sign, number, unit)
        if match := ALWAYS.fullmatch(text):
            vehicle, value, sign, number, unit = match.groups()
            found = self.vehicles[vehicle].values(value)[self._inside(vehicle, None)]
            return self._worst(found, sign, number, unit)
        if match := APART.fullmatch(text):
            first, second, number, unit = match.groups()
            apart = self.apart(first, second)
            return self._worst(apart, ">", number, unit)
        if match := EVENTUALLY.fullmatch(text):
            vehicle, value, sign, number, unit, within = match.groups()
            own, inside = self.vehicles[vehicle], self._inside(vehicle, None)
            found, times = own.values(value)[inside], own.time[inside]
            bound = float(number) * UNITS[unit]
            holds = found < bound if sign == "<" else found > bound
            known = ~np.isnan(found)
            if (holds & known).any():
                return _in_time(float(times[holds & known][0]) - self.begun, within)
            if not known.any():
                return Judged(False, None, None)
            near = found[known].min() if sign == "<" else found[known].max()
            return _against(float(near), sign, number, unit)
        if match := REACHED.fullmatch(text):
            vehicle, state, within = match.groups()
            starts = [visit.start for visit in self.visits[vehicle] if visit.name == state]
            if not starts:
                return Judged(False, None, None)
            return _in_time(starts[0] - self.begun, within)
        if match := FINALLY.fullmatch(text):
            vehicle, value, sign, number, unit = match.groups()
            last = float(self.vehicles[vehicle].values(value)[-1])
            return _against(last, sign, number, unit)
        if match := ENDS_IN.fullmatch(text):
            vehicle, state = match.groups()
            return Judged(self.visits[vehicle][-1].name == state, None, None)
        if match := FINISHED.fullmatch(text):
            within = float(match[1])
            if self.finished is None:
                return Judged(False, None, None)
            return Judged(self.finished <= within, self.finished, within - self.finished)
        raise ValueError(text)

    def apart(self, first: str, second: str) -> Any:
        """The distance between two vehicles in each tick of the mission."""
        a, b = self.vehicles[first], self.vehicles[second]
        _, one, two = np.intersect1d(a.time, b.time, return_indices=True)
        distance = _norm(a.position[one] - b.position[two])
        return distance[a.time[one] > self.begun - 1e-6]

    def _inside(self, vehicle: str, state: str | None) -> Any:
        own = self.vehicles[vehicle]
        if state is None:
            return own.time > self.begun - 1e-6
        inside = np.zeros(len(own.time), bool)
        for visit in self.visits[vehicle]:
            if visit.name == state:
                inside |= own.during(visit.start, visit.end)
        return inside

    def _worst(self, found: Any, sign: str, number: str, unit: str) -> Judged:
        found = found[~np.isnan(found)]
        if not len(found):
            return Judged(False, None, None)
        worst = found.max() if sign == "<" else found.min()
        return _against(float(worst), sign, number, unit)

    def beyond(self, vehicle: str, fence: Any) -> Iterator[tuple[float, float]]:
        """The time, and how far outside the fence the vehicle is, in each tick that it flies."""
        own, (low, high) = self.vehicles[vehicle], np.array(fence)
        out = np.maximum(low - own.position, own.position - high).max(axis=1)
        flies = own.flies & own.armed
        return zip(own.time[flies].tolist(), out[flies].tolist(), strict=True)


def _against(value: float, sign: str, number: str, unit: str) -> Judged:
    bound = float(number) * UNITS[unit]
    margin = bound - value if sign == "<" else value - bound
    return Judged(margin > 0.0, value, margin)


def _in_time(at: float, within: str | None) -> Judged:
    if within is None:
        return Judged(True, at, None)
    return Judged(at <= float(within), at, float(within) - at)
