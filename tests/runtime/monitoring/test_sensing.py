"""Sensors beside the link: whose measurements count, and what happens when one fails."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy
import pytest
from mcap.reader import make_reader
from plans import part, plan, vehicle, wrapped
from short_flights import down, named, up

from kybflow.api.opening import pace_of
from kybflow.core.errors import DriverError
from kybflow.core.geometry import LEVEL
from kybflow.core.signals import NS, Battery, Event, Frame, Imu, Measurement, Pose, Position, Time
from kybflow.dsl.plan import PartPlan, SensorPlan
from kybflow.parts import Link, Sensor, Stream
from kybflow.recording.layout import dtype_spec
from kybflow.runtime.events import Events
from kybflow.runtime.monitoring.sensing import MAX_LEAD_NS, OpenSensor, Sensing
from kybflow.world.cameras import Camera, Lens
from kybflow.world.vehicle_context import VehicleContext

REST = (0.0, 0.0, 0.0)
MS = NS // 1000


@dataclass(frozen=True)
class Script:
    """`at` gives the measurements at a time; it may raise. `trouble`: what it knows."""

    at: Callable[[Time], Sequence[Measurement]]
    closed: list[str]
    trouble: list[str | None]


class Scripted(Sensor[Script]):
    provides = frozenset({Pose})

    @classmethod
    def open(
        cls, params: Script, context: VehicleContext, link: Link, generator: random.Random
    ) -> Stream:
        return Played(params)


class Played(Stream):
    def __init__(self, script: Script) -> None:
        self.script = script

    def read(self, now: Time) -> Sequence[Measurement]:
        return self.script.at(now)

    def trouble(self) -> str | None:
        return self.script.trouble[-1]

    def close(self) -> None:
        self.script.closed.append("closed")


class Positions(Scripted):
    provides = frozenset({Position, Frame})


def sensor(at: Any, cls: type[Scripted] = Scripted, closed: list[str] | None = None) -> SensorPlan:
    script = Script(at, [] if closed is None else closed, [None])
    return SensorPlan(PartPlan("scripted", cls, script, "sensors.mocap", "m.yaml:7"), ("mocap",))


DOWN = Camera("down", Lens(4, 4, 4.0, 4.0, 2.0, 2.0), (0.0, 0.0, 0.0))


def sensing(at: Any, cls: type[Scripted] = Scripted) -> tuple[Sensing, list[Event]]:
    told: list[Event] = []
    source = sensor(at, cls)
    opened = OpenSensor(source, Played(source.part.params))
    driver = replace(part("drivers", "sim"), at="m.yaml:9")
    body = vehicle("a", [down()], cameras={"down": DOWN}, driver=driver)
    return Sensing(body, [opened], Events((told.append,))), told


def pose(time: Time, x: float = 0.0) -> Pose:
    return Pose(time, (x, 0.0, 0.0), LEVEL)


def imu(time: Time) -> Imu:
    return Imu(time, 0.004, (0.0, 0.0, 9.81), REST)


def joined(sense: Sensing, link: Sequence[Measurement], now: Time) -> Sequence[Measurement]:
    return sense.merged(sense.of_link(link, now), now, lambda found, now: None)


def test_its_kinds_replace_those_of_the_link() -> None:
    sense, _ = sensing(lambda now: [pose(now - 5, 1.0)])
    battery = Battery(1, 1.0, 12.0)
    link = [battery, pose(2, 9.0), imu(98)]
    assert joined(sense, link, 100) == [battery, pose(95, 1.0), imu(98)], "oldest first"


def test_it_replaces_them_even_while_it_has_none() -> None:
    sense, _ = sensing(lambda now: [])
    assert joined(sense, [pose(2), imu(3)], 100) == [imu(3)]


def test_one_that_fails_is_told_once_and_again_when_it_works() -> None:
    def at(now: Time) -> Sequence[Measurement]:
        if now in (2, 3, 6):
            raise DriverError("the server is gone")
        return [pose(now)] if now != 4 else []

    sense, told = sensing(at)
    found = [len(joined(sense, [imu(now)], now)) for now in range(1, 8)]
    assert found == [2, 1, 1, 1, 2, 1, 2]
    assert [event.name for event in told] == ["sensor_failed", "sensor_recovered"] * 2
    assert told[0].fields == {"sensor": "mocap", "reason": "the server is gone"}
    assert (told[0].vehicle, told[0].at) == ("a", "m.yaml:7")


GONE = "no VRPN server at here: Connection refused"


def test_one_that_knows_why_nothing_comes_has_failed() -> None:
    source = sensor(lambda now: [] if 3 <= now // MS < 8 else [pose(now)])
    said, told = source.part.params.trouble, []
    opened = [OpenSensor(source, Played(source.part.params))]
    sense = Sensing(vehicle("a", [down()]), opened, Events((told.append,)))
    for k in range(5):
        joined(sense, [], k * MS)
    assert told == [], "silence alone is none"
    said.append(GONE)
    for k in range(5, 8):
        joined(sense, [], k * MS)
    (failed,) = told
    assert (failed.name, failed.fields["reason"]) == ("sensor_failed", GONE)
    assert sense.trouble(Pose) == GONE
    said.append(None)
    assert sense.trouble(Pose) == GONE, "until it gives something"
    joined(sense, [], 8 * MS)
    assert [event.name for event in told] == ["sensor_failed", "sensor_recovered"]
    assert sense.trouble(Pose) is None


def test_one_that_is_still_connecting_has_a_second() -> None:
    source = sensor(lambda now: [])
    source.part.params.trouble.append("not connected yet")
    told: list[Event] = []
    body = vehicle("a", [down()])
    sense = Sensing(body, [OpenSensor(source, Played(source.part.params))], Events((told.append,)))
    for now in (7 * NS, 8 * NS - 1):
        joined(sense, [], now)
    assert told == []
    joined(sense, [], 8 * NS)
    assert [event.fields["reason"] for event in told] == ["not connected yet"]


def test_why_one_failed_is_known_to_who_asks() -> None:
    def broken(now: Time) -> Sequence[Measurement]:
        raise DriverError("the frames are too large")

    sense, _ = sensing(broken)
    assert sense.trouble(Pose) is None
    joined(sense, [], 1)
    assert sense.trouble(Pose) == "the frames are too large"
    assert sense.trouble(Imu) is None


def test_one_that_raises_anything_fails_alone() -> None:
    def broken(now: Time) -> Sequence[Measurement]:
        raise ZeroDivisionError("float division by zero")

    sense, told = sensing(broken)
    assert joined(sense, [imu(1)], 1) == [imu(1)]
    assert told[0].fields["reason"] == "ZeroDivisionError: float division by zero"


def test_what_can_not_be_noted_is_its_failure() -> None:
    def note(found: Sequence[Measurement], now: Time) -> None:
        raise ValueError("this is no pose")

    sense, told = sensing(lambda now: [pose(now)])
    assert sense.merged([imu(1)], 1, note) == [imu(1)]
    (failed,) = named(told, "sensor_failed")
    assert failed.fields["reason"] == "its measurement can't be used: ValueError: this is no pose"


def test_what_is_stamped_in_the_future_is_left_out_and_told_once() -> None:
    """The stamp is a second ahead in every pose but each third."""
    sense, told = sensing(lambda now: [pose(now + (NS if now // MS % 3 else MAX_LEAD_NS))])
    found = [joined(sense, [], now) for now in range(0, 30 * MS, MS)]
    assert [len(poses) for poses in found] == [1, 0, 0] * 10
    (refused,) = told
    assert refused.name == "measurement_refused"
    assert refused.fields == {
        "source": "mocap", "kind": "pose", "reason": "stamped 1 s in the future",
    }  # fmt: skip
    assert (refused.vehicle, refused.at) == ("a", "m.yaml:7")
    assert sense.refused(Pose) == 20
    assert sense.refused(Imu) == 0


def test_so_is_what_the_link_stamps_in_the_future_kind_by_kind() -> None:
    sense, told = sensing(lambda now: [])
    link = [Battery(3 * NS, 1.0, 12.0), imu(NS), imu(3 * NS), imu(NS + MAX_LEAD_NS + 1)]
    assert joined(sense, link, NS) == [imu(NS)]
    assert joined(sense, link, NS) == [imu(NS)]
    assert [(e.fields["source"], e.fields["kind"], e.at) for e in told] == [
        ("sim", "battery", "m.yaml:9"), ("sim", "imu", "m.yaml:9"),
    ]  # fmt: skip
    assert sense.refused(Imu) == 4


def test_frames_of_a_camera_that_the_vehicle_does_not_have_are_left_out() -> None:
    image = numpy.zeros((4, 4), numpy.uint8)
    sense, told = sensing(lambda now: [Frame(now, c, image) for c in ("up", "down")], Positions)
    found = [m for now in (1, 2) for m in joined(sense, [], now)]
    assert [m.camera for m in found if isinstance(m, Frame)] == ["down", "down"]
    (refused,) = told
    assert refused.fields["reason"] == "of the camera `up`; the vehicle has `down`"


@pytest.mark.parametrize(
    "image", [None, numpy.zeros((0, 0)), numpy.zeros(4), numpy.zeros((4, 4, 3))]
)
def test_so_are_frames_whose_image_is_none(image: Any) -> None:
    """Whoever compares or shows images would raise."""
    sense, told = sensing(lambda now: [Frame(now, "down", image)], Positions)
    assert [joined(sense, [], now) for now in (1, 2)] == [[], []]
    (refused,) = told
    assert refused.fields["reason"] == "with an image of `down` that is not a grey image"


def test_a_stamp_far_ahead_does_not_silence_a_body(run) -> None:
    """One pose of the flight is stamped an hour ahead; nothing comes of it but its event."""

    def late(_: str, link: Link) -> Link:
        read, done = link.read, []

        def ahead(now: Time) -> Sequence[Measurement]:
            found = list(read(now))
            for i, m in enumerate(found):
                if isinstance(m, Pose) and now > 2 * NS and not done:
                    found[i] = m._replace(time=m.time + 3600 * NS)
                    done.append(now)
            return found

        link.read = ahead  # type: ignore[method-assign]
        return link

    result, told = flight_with(run, driver=wrapped(late))
    (refused,) = named(told, "measurement_refused")
    assert str(refused.fields["reason"]).startswith("stamped 3.6e+03 s in the future")
    assert result.exit_code == 0
    assert not [e for e in told if e.name.startswith(("body_", "estimator_lost", "failsafe_"))]


def flight_with(run: Any, *sensors: SensorPlan, **more: Any) -> tuple[Any, list[Event]]:
    states = [up("down", 0.5), down()]
    result: tuple[Any, list[Event]] = run(vehicle("a", states, sensors=sensors, **more))
    return result


def test_a_flight_whose_sensor_is_lost_loses_the_estimate_and_not_the_link(run) -> None:
    closed: list[str] = []

    def lost(now: Time) -> Sequence[Measurement]:
        raise DriverError("the server is gone")

    _, told = flight_with(run, sensor(lost, closed=closed))
    (failed,) = named(told, "sensor_failed")
    assert failed.time == 0
    assert not named(told, "took_off"), "the driver's poses do not count"
    assert not named(told, "part_failed"), "nor is the driver blamed"
    assert closed == ["closed"]


def test_a_sensor_that_can_not_be_opened_ends_the_run_with_the_driver(run) -> None:
    class Missing(Scripted):
        @classmethod
        def open(
            cls, params: Script, context: VehicleContext, link: Link, generator: random.Random
        ) -> Stream:
            raise DriverError("there is no camera 3")

    closed: list[str] = []
    _, told = flight_with(run, sensor(None, closed=closed), sensor(None, Missing))
    reason = "`scripted` (m.yaml:7): there is no camera 3"
    assert named(told, "run_ended")[0].fields["reason"] == reason
    assert closed == ["closed"], "what was open is closed"


class Live(Scripted):
    """By the wall's clock."""

    @classmethod
    def real_time(cls, params: Script) -> bool:
        return True


def test_a_sensor_of_the_wall_clock_sets_the_pace_of_a_simulation() -> None:
    body = vehicle("a", [down()], sensors=(sensor(lambda now: [], Live),))
    assert pace_of(plan(body), None) == pace_of(plan(body), 1.0) == 1.0
    reason = (
        "`scripted` (m.yaml:7) works in real time, so the simulation must too: fly with "
        "`--speed 1` or without `--speed`"
    )
    with pytest.raises(DriverError, match=re.escape(reason)):
        pace_of(plan(body), 2.0)
    assert pace_of(plan(body, simulated=False), None) is None


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

    result, _ = flight_with(run, sensor(at, Positions), cameras={"down": DOWN})
    log: Path = result.folder / "log.mcap"
    return log


def messages(path: Path, topic: str) -> list[Any]:
    with path.open("rb") as file:
        return [m for _, _, m in make_reader(file).iter_messages(topics=[topic])]


def test_positions_are_recorded_and_of_frames_the_time(recorded: Path) -> None:
    positions = messages(recorded, "/a/position")
    first = numpy.frombuffer(positions[1].data, numpy.dtype(dtype_spec(Position)))[0]
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
        int(numpy.frombuffer(m.data, numpy.dtype(dtype_spec(Frame)))[0]["time"]) for m in frames
    ]
    assert times[:3] == [0, NS // 5, 2 * NS // 5]
    assert len(positions) == pytest.approx(2 * len(frames), abs=1)


def test_who_has_none_of_them_has_no_channel_for_them(run) -> None:
    result, _ = flight_with(run)
    with (result.folder / "log.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    ours = [c for c in summary.channels.values() if c.message_encoding != "protobuf"]
    assert {channel.topic for channel in ours} == {
        "/events", "/a/tick", "/a/wanted", "/a/estimator/mocap", "/a/pose", "/a/imu", "/a/battery",
        "/a/link",
    }  # fmt: skip
