"""Judges a recorded flight by the simulator's truth, never by what the vehicle believed.

A finding is one thing that went wrong with one vehicle, once a flight: see `KINDS`. Heights are of
the lowest corner of the vehicle's body over the floor. A flight that nothing could save is one in
which, while a vehicle flew, the faults at work left it less than 1.1 times its weight or no
authority in roll or pitch (`lift_of`); of such a flight only the verdict must be true.
"""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from itertools import zip_longest
from math import sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kybflow.core.geometry import GRAVITY
from kybflow.core.signals import NS
from kybflow.dsl.plan import Plan, VehiclePlan
from kybflow.parts import ActiveFaults
from kybflow.recording.layout import HAS_POSITION
from kybflow.recording.messages import TICK, read_recording
from kybflow.recording.run_folder import EVENTS, LOG
from kybflow.world.shapes import Box
from kybflow.world.vehicle_context import LEGS

KINDS = {
    "ended_in_air": "the recording ends and it does not rest",
    "landed_in_air": "it was told to be down, or its rotors were stopped, in the air",
    "climbed": "above the highest setpoint so far for a second",
    "hard": "touched down too fast; its vertical speed, m/s",
    "outside": "outside the fence; how far, m",
    "endless": "the run went on until its time limit",
    "untrue": "the summary says `ground` of a vehicle in the air",
    "traceback": "an exception came out of the run",
    "succeeded": "the run succeeded although something above was found",
}
IN_AIR = 0.12
"""Metres over the floor above which a vehicle does not stand: a parcel is 10 cm high."""
TOO_HIGH, TOO_LONG = 0.5, 1.0
OWN_CLIMB = 0.7
"""Metres that an AR.Drone takes off to by itself, before it follows a setpoint."""
TOO_FAST, TOO_FAR = 1.5, 0.5
ENOUGH_LIFT, ENOUGH_AUTHORITY = 1.1, 0.1
_TOUCHES, _BEFORE, _RESTS, _STILL = 0.01, 0.03, 1.0, 0.05
"""Metres over the floor that are a touch; seconds before it in which the speed is taken; seconds
without rotors, and the speed (m/s), after which a vehicle that stands on something rests."""

Array = NDArray[np.float64]


class Finding(NamedTuple):
    """time: seconds of the run. value: a height, speed or distance in SI."""

    kind: str
    vehicle: str
    time: float
    value: float

    def __str__(self) -> str:
        return f"{self.kind} {self.vehicle} {self.value:.2f} at {self.time:.2f} s"


class Judgement(NamedTuple):
    """lift: the least that the faults at work left of the thrust over the weight while it flew, of
    the worst vehicle; 0 where no roll or pitch authority was left."""

    findings: tuple[Finding, ...]
    lift: float

    @property
    def doomed(self) -> bool:
        """Whether nothing could have saved it."""
        return self.lift < ENOUGH_LIFT


def judge(plan: Plan, folder: Path, summary: dict[str, Any]) -> Judgement:
    """Judge the run that `plan` has left in `folder`."""
    events = [json.loads(line) for line in (folder / EVENTS).read_text().splitlines()]
    tracks = _tracks(folder / LOG, plan)
    findings: list[Finding] = []
    lift = np.inf
    for vehicle in plan.vehicles:
        track = tracks.get(vehicle.name)
        if track is not None:
            own = [event for event in events if event["vehicle"] == vehicle.name]
            final = summary["vehicles"][vehicle.name]["final"]
            findings += found(plan.fence, vehicle, track, own, final)
            lift = min(lift, _least_lift(plan, vehicle, track, events))
    if summary["sim_time_s"] >= plan.time_limit:
        findings.append(Finding("endless", "", summary["sim_time_s"], plan.time_limit))
    if findings and summary["outcome"] == "succeeded":
        findings.append(Finding("succeeded", "", summary["sim_time_s"], 0.0))
    return Judgement(tuple(findings), float(lift))


class Track:
    """What one vehicle truly did, tick by tick. height: of its lowest corner over the floor. top:
    the highest setpoint so far. armed: what the last command said of its rotors."""

    def __init__(
        self, vehicle: VehiclePlan, stamps: NDArray[np.int64], ticks: NDArray[Any]
    ) -> None:
        truth, setpoint = ticks["truth"], ticks["setpoint"]
        self.time: Array = stamps / NS
        self.position, self.velocity = truth["position"], truth["velocity"]
        self.height = _height(vehicle, truth["position"][:, 2], truth["attitude"])
        there = (setpoint["present"] & HAS_POSITION) > 0
        wanted = np.where(there, setpoint["position"][:, 2], vehicle.start[2])
        climbs = OWN_CLIMB if "ardrone" in vehicle.driver.name else 0.0
        self.top = np.maximum.accumulate(np.maximum(wanted, vehicle.start[2] + climbs))
        self.armed = ticks["command"]["armed"]

    def at(self, seconds: float) -> int:
        """The index of the tick at a time."""
        return min(int(np.searchsorted(self.time, seconds - 1e-6)), len(self.time) - 1)

    def rests(self, index: int) -> bool:
        """Whether it is down: near the floor, or still without rotors for a while."""
        if self.height[index] < IN_AIR:
            return True
        first = self.at(self.time[index] - _RESTS)
        speed = np.linalg.norm(self.velocity[first : index + 1], axis=1)
        lasts = self.time[index] - self.time[first] >= 0.9 * _RESTS
        return bool(lasts and not self.armed[first : index + 1].any() and speed.max() < _STILL)


def _height(vehicle: VehiclePlan, z: Array, attitude: NDArray[Any]) -> Array:
    """The lowest corner of the box that MuJoCo has for a vehicle, over the floor at -LEGS."""
    w, x, y, q = (attitude[:, i] for i in range(4))
    half = vehicle.airframe.arm / sqrt(2.0)
    along_x, along_y = 2.0 * (x * q - w * y), 2.0 * (y * q + w * x)
    up = 1.0 - 2.0 * (x * x + y * y)
    aside = half * (np.abs(along_x) + np.abs(along_y))
    lowest: Array = z - aside - LEGS * np.maximum(up, 0.0) + LEGS
    return lowest


def _tracks(path: Path, plan: Plan) -> dict[str, Track]:
    log = read_recording(path)
    flown = [(vehicle, log[f"/{vehicle.name}/tick"].decoded(TICK)) for vehicle in plan.vehicles]
    return {vehicle.name: Track(vehicle, *ticks) for vehicle, ticks in flown if len(ticks.times)}


def found(
    fence: Box | None, vehicle: VehiclePlan, track: Track, events: list[Any], final: str
) -> Iterator[Finding]:
    """What went wrong with one vehicle, which the summary calls on the ground or in the air."""
    name, last = vehicle.name, len(track.time) - 1
    in_air = not track.rests(last)
    if in_air:
        yield Finding("ended_in_air", name, track.time[last], track.height[last])
    if in_air and final == "ground":
        yield Finding("untrue", name, track.time[last], track.height[last])
    yield from _landed_in_air(name, track, events)
    yield from _climbed(name, track)
    yield from _hard(name, track)
    if fence is not None:
        low, high = np.array(fence.low), np.array(fence.high)
        low[2] = -np.inf
        beyond = np.maximum(low - track.position, track.position - high).max(axis=1)
        if beyond.max() > TOO_FAR:
            yield Finding("outside", name, track.time[beyond.argmax()], beyond.max())


def _landed_in_air(name: str, track: Track, events: list[Any]) -> Iterator[Finding]:
    stopped = np.flatnonzero(track.armed[:-1] & ~track.armed[1:]) + 1
    told = [track.at(event["t_s"]) for event in events if event["event"] == "landed"]
    for index in sorted([*stopped.tolist(), *told]):
        if not track.rests(index):
            yield Finding("landed_in_air", name, track.time[index], track.height[index])
            return


def _climbed(name: str, track: Track) -> Iterator[Finding]:
    high = track.position[:, 2] > track.top + TOO_HIGH
    edges = np.flatnonzero(np.diff(np.concatenate(([False], high, [False])).astype(int)))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        if track.time[end - 1] - track.time[first] >= TOO_LONG:
            above = (track.position[:, 2] - track.top)[first:end].max()
            yield Finding("climbed", name, track.time[first], above)
            return


def _hard(name: str, track: Track) -> Iterator[Finding]:
    touches = track.height < _TOUCHES
    contacts = np.flatnonzero(~touches[:-1] & touches[1:]) + 1
    speeds = [
        (-track.velocity[track.at(track.time[i] - _BEFORE) : i, 2].min(initial=0.0), i)
        for i in contacts
    ]
    speed, index = max(speeds, default=(0.0, 0))
    if speed > TOO_FAST:
        yield Finding("hard", name, track.time[index], speed)


def _least_lift(plan: Plan, vehicle: VehiclePlan, track: Track, events: list[Any]) -> float:
    """The least that the faults at work left a vehicle in the air; infinite if none was. Events
    name a fault by its line. Raises ValueError where one line has several."""
    rig, parts, lift = (
        ActiveFaults(vehicle.name),
        {fault.at: fault for fault in plan.faults},
        np.inf,
    )
    if len(parts) < len(plan.faults):
        raise ValueError("several faults are on one line")
    working: dict[str, Any] = {}
    told = [e for e in events if e["event"] in ("fault_injected", "fault_ended", "fault_failed")]
    for event, until in zip_longest(told, told[1:]):
        fault = parts[event["at"]]
        if event["event"] == "fault_injected":
            made = fault.part.cls(fault.part.params, random.Random(0))
            effect = made.effects(fault.vehicle).get(vehicle.name)
            if effect is not None:
                working[event["at"]] = effect
                rig.begin(effect, 0)
        elif event["at"] in working:
            rig.end(working.pop(event["at"]))
        end = len(track.time) if until is None else track.at(until["t_s"])
        if (track.height[track.at(event["t_s"]) : end] > IN_AIR).any():
            lift = min(lift, lift_of(vehicle, rig, event["t_s"]))
    return lift


def lift_of(vehicle: VehiclePlan, rig: ActiveFaults, seconds: float) -> float:
    """What the rotors can give over the weight while the vehicle stays level, which it does when
    those across from each other give the same; 0 where one is so weak that it can't be tilted back.

    The battery's voltage as in `kybflow.world.vehicle_context`, of the airframe as its maker says.
    """
    frame = vehicle.airframe
    carried = vehicle.payload.mass if vehicle.payload is not None else 0.0
    weight = (frame.mass * rig.mass + rig.payload + carried) * GRAVITY
    charge = max(0.0, 1.0 - seconds / frame.endurance - rig.sag)
    level = 1.0 - frame.voltage_spread * (1.0 - charge + 0.1 * ENOUGH_LIFT**1.5)
    a, b, c, d = (level**2 * frame.thrust * left for left in rig.rotors)
    if min(a, b, c, d) < ENOUGH_AUTHORITY * weight / 4.0:
        return 0.0
    return float(2.0 * (min(a, c) + min(b, d)) / weight)
