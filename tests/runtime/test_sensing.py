"""Sensors beside the link: whose measurements count, and what happens when one fails."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy
import pytest
from flights import down, named, up
from mcap.reader import make_reader
from plans import vehicle

from kybflow.dsl.plan import PartPlan, SensorPlan
from kybflow.errors import DriverError
from kybflow.geometry import LEVEL
from kybflow.parts import Link, Sensor, Stream
from kybflow.runtime.events import Events
from kybflow.runtime.record_layout import dtype_spec
from kybflow.runtime.sensing import Opened, Sensing
from kybflow.signals import (
    NS,
    Battery,
    Event,
    Frame,
    Imu,
    Measurement,
    MeasurementKind,
    Pose,
    Position,
    Time,
)
from kybflow.site import Site

REST = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Script:
    """`at` gives the measurements at a time; it may raise."""

    at: Callable[[Time], Sequence[Measurement]]
    closed: list[str]


class Scripted(Sensor[Script]):
    provides = frozenset({MeasurementKind.POSE})

    @classmethod
    def open(cls, params: Script, site: Site, link: Link, generator: random.Random) -> Stream:
        return Played(params)


class Played(Stream):
    def __init__(self, script: Script) -> None:
        self.script = script

    def read(self, now: Time) -> Sequence[Measurement]:
        return self.script.at(now)

    def close(self) -> None:
        self.script.closed.append("closed")


class Positions(Scripted):
    provides = frozenset({MeasurementKind.POSITION, MeasurementKind.FRAME})


def sensor(at: Any, cls: type[Scripted] = Scripted, closed: list[str] | None = None) -> SensorPlan:
    script = Script(at, [] if closed is None else closed)
    return SensorPlan(PartPlan("scripted", cls, script, "sensors.mocap", "m.yaml:7"), ("mocap",))


def sensing(at: Any) -> tuple[Sensing, list[Event], list[Measurement]]:
    told: list[Event] = []
    plan = sensor(at)
    opened = Opened(plan, Played(plan.part.params))
    return Sensing("a", [opened], Events((told.append,))), told, []


def pose(time: Time, x: float = 0.0) -> Pose:
    return Pose(time, (x, 0.0, 0.0), LEVEL)


def imu(time: Time) -> Imu:
    return Imu(time, 0.004, (0.0, 0.0, 9.81), REST)


def joined(sense: Sensing, link: Sequence[Measurement], now: Time) -> Sequence[Measurement]:
    return sense.joined(sense.left_of(link), now, lambda found, now: None)


def test_its_kinds_replace_those_of_the_link() -> None:
    sense, _, _ = sensing(lambda now: [pose(now - 5, 1.0)])
    battery = Battery(1, 1.0, 12.0)
    link = [battery, pose(2, 9.0), imu(98)]
    assert joined(sense, link, 100) == [battery, pose(95, 1.0), imu(98)], "oldest first"


def test_it_replaces_them_even_while_it_has_none() -> None:
    sense, _, _ = sensing(lambda now: [])
    assert joined(sense, [pose(2), imu(3)], 100) == [imu(3)]


def test_one_that_fails_is_told_once_and_again_when_it_works() -> None:
    def at(now: Time) -> Sequence[Measurement]:
        if now in (2, 3, 6):
            raise DriverError("the server is gone")
        return [pose(now)] if now != 4 else []

    sense, told, _ = sensing(at)
    found = [len(joined(sense, [imu(now)], now)) for now in range(1, 8)]
    assert found == [2, 1, 1, 1, 2, 1, 2]
    assert [event.name for event in told] == ["sensor_failed", "sensor_recovered"] * 2
    assert told[0].fields == {"sensor": "mocap", "reason": "the server is gone"}
    assert (told[0].vehicle, told[0].at) == ("a", "m.yaml:7")


def test_one_that_raises_anything_fails_alone() -> None:
    def broken(now: Time) -> Sequence[Measurement]:
        raise ZeroDivisionError("float division by zero")

    sense, told, _ = sensing(broken)
    assert joined(sense, [imu(1)], 1) == [imu(1)]
    assert told[0].fields["reason"] == "ZeroDivisionError: float division by zero"


def test_what_can_not_be_noted_is_its_failure() -> None:
    def note(found: Sequence[Measurement], now: Time) -> None:
        raise ValueError("this is no pose")

    sense, told, _ = sensing(lambda now: [pose(now)])
    assert sense.joined([imu(1)], 1, note) == [imu(1)]
    assert named(told, "sensor_failed")


def flown(run: Any, *sensors: SensorPlan, **more: Any) -> tuple[Any, list[Event]]:
    states = [up("down", 0.5), down()]
    result: tuple[Any, list[Event]] = run(vehicle("a", states, sensors=sensors, **more))
    return result


def test_a_flight_whose_sensor_is_lost_loses_the_estimate_and_not_the_link(run) -> None:
    closed: list[str] = []

    def lost(now: Time) -> Sequence[Measurement]:
        raise DriverError("the server is gone")

    _, told = flown(run, sensor(lost, closed=closed))
    (failed,) = named(told, "sensor_failed")
    assert failed.time == 0
    assert not named(told, "took_off"), "the driver's poses do not count"
    assert not named(told, "part_failed"), "nor is the driver blamed"
    assert closed == ["closed"]


def test_a_sensor_that_can_not_be_opened_ends_the_run_with_the_driver(run) -> None:
    class Missing(Scripted):
        @classmethod
        def open(cls, params: Script, site: Site, link: Link, generator: random.Random) -> Stream:
            raise DriverError("there is no camera 3")

    closed: list[str] = []
    _, told = flown(run, sensor(None, closed=closed), sensor(None, Missing))
    assert named(told, "run_ended")[0].fields["reason"] == "there is no camera 3"
    assert closed == ["closed"], "what was open is closed"


@pytest.fixture
def recorded(run) -> Path:
    """The recording of a flight with positions at 10 Hz and frames at 5 Hz beside its poses."""
    image = numpy.zeros((4, 4), numpy.uint8)

    def at(now: Time) -> Sequence[Measurement]:
        found: list[Measurement] = []
        if now % (NS // 10) == 0:
            found.append(Position(now, (1.0, 2.0, 3.0), (0.1, 0.1, 0.2)))
        if now % (NS // 5) == 0:
            found.append(Frame(now, "down", image))
        return found

    result, _ = flown(run, sensor(at, Positions))
    log: Path = result.folder / "log.mcap"
    return log


def messages(path: Path, topic: str) -> list[Any]:
    with path.open("rb") as file:
        return [m for _, _, m in make_reader(file).iter_messages(topics=[topic])]


def test_positions_are_recorded_and_of_frames_the_time(recorded: Path) -> None:
    positions = messages(recorded, "/a/position")
    first = numpy.frombuffer(positions[1].data, numpy.dtype(dtype_spec("Position")))[0]
    assert (first["time"], *first["position"], *first["spread"]) == (
        NS // 10,
        1,
        2,
        3,
        0.1,
        0.1,
        0.2,
    )
    frames = messages(recorded, "/a/frame/down")
    times = [
        int(numpy.frombuffer(m.data, numpy.dtype(dtype_spec("Frame")))[0]["time"]) for m in frames
    ]
    assert times[:3] == [0, NS // 5, 2 * NS // 5]
    assert len(positions) == pytest.approx(2 * len(frames), abs=1)


def test_who_has_none_of_them_has_no_channel_for_them(run) -> None:
    result, _ = flown(run)
    with (result.folder / "log.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {channel.topic for channel in summary.channels.values()}
    assert topics == {"/events", "/a/tick", "/a/estimator/mocap", "/a/pose", "/a/battery"}
