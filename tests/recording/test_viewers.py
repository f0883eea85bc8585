"""What viewers draw of a recording: each message is decoded by the schema in the file."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from recorded_run import LEVEL, NO_ESTIMATORS, REST, make_plan
from toolchain import MISSIONS, compiled

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import (
    NS,
    Command,
    Estimate,
    Event,
    SeenObject,
    SeenObstacle,
    Setpoint,
    SetpointKind,
    Truth,
)
from kybflow.dsl.plan import Plan
from kybflow.recording.recorder import Recorder
from kybflow.recording.run_folder import LAYOUT, LOG
from kybflow.recording.viewers.channels import DrawnVehicle
from kybflow.world.objects import ObjectSurface, WorldObject
from kybflow.world.scanned import Columns, PointCloud
from kybflow.world.shapes import Box, Cylinder, MovingSphere, Plane, Sphere
from kybflow.world.tags import Tag, TagMap

RATE = 125
BELIEVED = Estimate(7, (1.0, 2.0, 3.0), REST, (0.5, 0.5, 0.5, -0.5), REST, "mocap", 0.01, 0.002)
TRUTH = Truth((1.5, 2.0, 3.0), REST, LEVEL, REST)
SETPOINT = Setpoint(SetpointKind.POSITION, (1.0, 2.0, 2.5), REST, REST, None, 0.0)
COMMAND = Command(LEVEL, 10.0, REST, 0.0)


def drawn(path: Path) -> list[tuple[str, int, Any]]:
    """The messages for viewers, as (topic, log time, content)."""
    protobuf = pytest.importorskip("google.protobuf")
    descriptors = pytest.importorskip("google.protobuf.descriptor_pb2")
    factory = pytest.importorskip("google.protobuf.message_factory")
    kinds, found = {}, []
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if schema is None or schema.encoding != "protobuf":
                continue
            if schema.name not in kinds:
                assert schema.name.startswith("foxglove.")
                files = descriptors.FileDescriptorSet.FromString(schema.data)
                pool = protobuf.descriptor_pool.DescriptorPool()
                for one in files.file:
                    pool.Add(one)
                kind = pool.FindMessageTypeByName(schema.name)
                kinds[schema.name] = factory.GetMessageClass(kind)
            assert message.log_time == message.publish_time
            content = kinds[schema.name].FromString(message.data)
            found.append((channel.topic, message.log_time, content))
    return found


def of_topic(path: Path, topic: str) -> list[Any]:
    return [content for name, _, content in drawn(path) if name == topic]


def flown(path: Path, plan: Plan, ticks: int = 1, **given: Any) -> Path:
    """A recording in which every vehicle does the same for some ticks."""
    told = {"estimate": BELIEVED, "setpoint": SETPOINT, "truth": TRUTH} | given
    recorder = Recorder(path, plan)
    for tick in range(ticks):
        for vehicle in plan.vehicles:
            recorder.vehicle(vehicle.name).tick(
                tick * NS // RATE, told["estimate"], told["setpoint"], told["setpoint"], COMMAND,
                told["truth"], NO_ESTIMATORS,
            )  # fmt: skip
    recorder.close()
    return path


def numbers(vector: Any) -> tuple[float, ...]:
    names = [name for name in "wxyz" if hasattr(vector, name)]
    return tuple(getattr(vector, name) for name in names)


def test_frames_and_setpoints_come_at_thirty_hertz_and_trails_at_one(tmp_path):
    path = flown(tmp_path / LOG, make_plan("a", "b", rate=RATE), 10 * RATE)
    counts = Counter(topic for topic, _, _ in drawn(path))
    assert counts == {
        "/scene": 1, "/tf": 313, "/a/setpoint_pose": 313, "/b/setpoint_pose": 313,
        "/a/position_error": 105, "/b/position_error": 105, "/a/trail": 11, "/b/trail": 11,
    }  # fmt: skip


def test_a_frame_is_where_the_vehicle_believes_to_be_and_a_true_one_where_it_is(tmp_path):
    path = flown(tmp_path / LOG, make_plan("a", "b", rate=RATE), 8)
    first, second = of_topic(path, "/tf")
    names = [one.child_frame_id for one in first.transforms]
    assert names == ["a", "a/true", "b", "b/true"]
    assert [one.child_frame_id for one in second.transforms] == ["a", "b"]
    believed, true = first.transforms[:2]
    assert {one.parent_frame_id for one in first.transforms} == {"world"}
    assert numbers(believed.translation) == BELIEVED.position
    assert numbers(believed.rotation) == BELIEVED.attitude
    assert numbers(true.translation) == TRUTH.position
    assert second.transforms[0].timestamp.nanos == 32_000_000


def test_what_nobody_knows_has_no_frame(tmp_path):
    nothing = {"estimate": None, "setpoint": None, "truth": None}
    path = flown(tmp_path / LOG, make_plan("a", rate=RATE), **nothing)
    (frames,), (trail,) = of_topic(path, "/tf"), of_topic(path, "/a/trail")
    assert len(frames.transforms) == 0
    assert len(trail.entities[0].lines[0].points) == 0
    assert of_topic(path, "/a/setpoint_pose") == []


@pytest.mark.parametrize(("truth", "x"), [(TRUTH, 0.5), (None, 0.0)])
def test_the_error_is_of_the_truth_or_else_of_the_estimate(tmp_path, truth, x):
    path = flown(tmp_path / LOG, make_plan("a", rate=RATE), truth=truth)
    (wanted,), (error,) = of_topic(path, "/a/setpoint_pose"), of_topic(path, "/a/position_error")
    assert wanted.frame_id == "world"
    assert numbers(wanted.pose.position) == SETPOINT.position
    assert numbers(error) == (x, 0.0, 0.5)


def test_a_setpoint_without_a_position_is_not_drawn(tmp_path):
    velocity = Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.0, 0.0))
    path = flown(tmp_path / LOG, make_plan("a", rate=RATE), setpoint=velocity)
    assert of_topic(path, "/a/setpoint_pose") == of_topic(path, "/a/position_error") == []


def test_a_trail_is_of_the_last_fifteen_seconds(tmp_path):
    path = flown(tmp_path / LOG, make_plan("a", rate=RATE), 40 * RATE)
    lengths = [len(trail.entities[0].lines[0].points) for trail in of_topic(path, "/a/trail")]
    assert lengths == [min(1 + 30 * second // 8, 56) for second in range(42)]


def test_the_world_is_drawn_once_and_what_moves_in_its_own_frame(tmp_path):
    plate = ObjectSurface("left", (0.0, 0.05, 0.0), (0.0, 1.0, 0.0), 0.2, 0.2)
    plan = replace(
        make_plan("a", rate=RATE),
        obstacles={
            "crate": Box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)),
            "pole": Cylinder((1.0, 1.0, 0.0), 0.1, 2.0),
            "ball": Sphere((2.0, 0.0, 1.0), 0.3),
            "wall": Plane((0.0, 3.0, 0.0), (0.0, -1.0, 0.0)),
            "rubble": PointCloud(((0.5, 0.5, 0.5), (1.0, 1.0, 1.0)), 0.1),
            "racks": Columns(((2.0, 2.0),), 0.1, 0.0, 1.5),
        },
        moving={"pendulum": MovingSphere(((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)), 0.2, 0.5)},
        objects={
            "cart": WorldObject("cart", (1.0, 0.0, 0.1), (0.4, 0.1, 0.2), 1.0, surfaces=(plate,)),
            "flag": WorldObject("flag", (0.0, 0.0, 0.5), (0.1, 0.1, 0.1), 0.1, on="cart"),
        },
        tags=TagMap([Tag("36h11", 7, 0.15, (1.0, 0.0, 0.0), LEVEL)]),
    )  # fmt: skip
    recorder = Recorder(tmp_path / LOG, plan)
    recorder.obstacles(NS, {"pendulum": SeenObstacle(NS, (0.5, 0.0, 1.0), REST, 0.2, 0.5)})
    seen = {"cart": SeenObject(NS, (1.5, 0.0, 0.1), LEVEL, REST, 0.0, 0.0)}
    recorder.shown_objects(NS, {}, seen, {}, {})
    recorder.close()

    (scene,) = of_topic(tmp_path / LOG, "/scene")
    entities = {one.id: one for one in scene.entities}
    frames = {one.id: one.frame_id for one in scene.entities}
    standing = ("world/fence", "crate", "pole", "ball", "wall", "world/tags")
    moving = ("pendulum", "cart", "flag", "a", "a/true")
    assert frames == dict.fromkeys(standing, "world") | {name: name for name in moving}
    assert all(one.frame_locked for one in scene.entities)
    assert len(entities["world/fence"].lines[0].points) == 24
    assert numbers(entities["crate"].cubes[0].pose.position) == (0.5, 1.0, 1.5)
    assert numbers(entities["pole"].cylinders[0].pose.position) == (1.0, 1.0, 1.0)
    assert numbers(entities["world/tags"].cubes[0].size)[:2] == (0.15, 0.15)
    assert len(entities["cart"].cubes) == 2
    assert len(entities["a"].cylinders) == 4
    (scan,) = of_topic(tmp_path / LOG, "/scans")
    assert len(scan.data) == 4 * scan.point_stride
    (balls,), (things,) = (of_topic(tmp_path / LOG, f"/tf/{k}") for k in ("obstacles", "objects"))
    assert [one.child_frame_id for one in balls.transforms] == ["pendulum"]
    where = {one.child_frame_id: numbers(one.translation) for one in things.transforms}
    assert where == {"cart": (1.5, 0.0, 0.1), "flag": (1.5, 0.0, 0.6)}


@pytest.mark.parametrize(
    ("event", "level", "text"),
    [
        (Event(NS, "took_off", "a", {}, "m.yaml:3"), 2, "took_off"),
        (Event(NS, "battery_low", "a", {"reaction": "warn", "bound": 0.3}, "m.yaml:3"), 3,
         "battery_low reaction: warn, bound: 0.3"),
        (Event(NS, "collided", "a", {"into": "wall"}, "m.yaml:3"), 4, "collided into: wall"),
    ],
)  # fmt: skip
def test_an_event_is_a_line_of_the_log_as_grave_as_it_is(tmp_path, event, level, text):
    recorder = Recorder(tmp_path / LOG, make_plan("a"))
    recorder.event(event)
    recorder.close()
    (line,) = of_topic(tmp_path / LOG, "/log")
    assert (line.level, line.message, line.name) == (level, text, "a")
    assert (line.file, line.line, line.timestamp.seconds) == ("m.yaml", 3, 1)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder of a mission."""
    plan = compiled(MISSIONS / "first_flight.yaml")
    return fly(plan, RunRequest(out=tmp_path_factory.mktemp("flight") / "run")).folder


def test_what_viewers_draw_makes_a_recording_an_eighth_larger_at_most(
    flight, tmp_path, monkeypatch
):
    monkeypatch.setattr(DrawnVehicle, "draw", lambda *_: None)
    compact = fly(compiled(MISSIONS / "first_flight.yaml"), RunRequest(out=tmp_path / "run")).folder
    share = (flight / LOG).stat().st_size / (compact / LOG).stat().st_size - 1.0
    assert 0.08 < share < 0.12


def test_the_layout_shows_topics_that_are_recorded(flight):
    with (flight / LOG).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {channel.topic for channel in summary.channels.values()}
    text = (flight / LAYOUT).read_text(encoding="utf-8")
    panels = re.findall(r'"panelType":"(\w+)"', text)
    assert panels == ["ThreeDee", "Plot", "Plot", "Log"]
    assert json.loads(text)["content"]
    shown = set(re.findall(r'"(/\w+(?:/\w+)*)', text))
    assert {"/scene", "/log"} < shown
    assert shown <= topics


@pytest.mark.peer
@pytest.mark.skipif(shutil.which("rerun") is None, reason="needs rerun-sdk")
def test_rerun_draws_a_frame_for_each_vehicle_and_a_pose_for_each_setpoint(flight, tmp_path):
    def rerun(*words: str) -> str:
        done = subprocess.run(["rerun", *words], capture_output=True, text=True, check=True)
        return done.stdout

    rerun("analytics", "disable")
    checked = rerun("mcap", "check", str(flight / LOG))
    assert "/tf" in checked
    assert set(re.findall(r"^(ok|\w+) +\d+ +\d+ ", checked, flags=re.MULTILINE)) == {"ok"}
    rerun("mcap", "convert", str(flight / LOG), "-o", str(tmp_path / "run.rrd"))
    chunks = rerun("rrd", "print", str(tmp_path / "run.rrd")).splitlines()

    def rows(topic: str, column: str) -> int:
        own = [line for line in chunks if f" {topic} " in line and column in line]
        return sum(int(re.search(r"with ([\d,]+) rows", line)[1].replace(",", "")) for line in own)

    frames = sum(len(frame.transforms) for frame in of_topic(flight / LOG, "/tf"))
    assert rows("/tf", "Transform3D:translation") == frames > 300
    setpoints = len(of_topic(flight / LOG, "/nano/setpoint_pose"))
    assert rows("/nano/setpoint_pose", "InstancePoses3D:translations") == setpoints > 300
    assert rows("/log", "TextLog:text") == len(of_topic(flight / LOG, "/log"))
