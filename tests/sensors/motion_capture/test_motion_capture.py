"""The sensor `motion_capture`, with the library's own mock and a system that never answers."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import threading
import time
from typing import Any

import pytest
from part_bench import SITE
from waiting import until

from kybflow.core.geometry import LEVEL
from kybflow.core.signals import NS, Measurement, Pose
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.moving_obstacles import moving_obstacles
from kybflow.sensors._stream import PoseStream, TrackerPose
from kybflow.sensors.motion_capture import MotionCaptureSensor, MotionCaptureSensorParams, feed
from kybflow.sensors.motion_capture.feed import subscribe
from kybflow.world.shapes import MovingSphere

pytest.importorskip("motioncapture", "1.1")

MOCK = {"frequency": "200", "rigid_bodies": "a(1,2,3,1,0,0,0);nano(4,5,6,0.6,0,0,0.8)"}


def test_bodies_of_the_mock_arrive_by_one_program() -> None:
    readers = [subscribe("mock", MOCK, name) for name in ("a", "nano", "other")]
    came: dict[str, list[TrackerPose]] = {}

    def enough() -> bool:
        for reader in readers:
            came.setdefault(reader.body, []).extend(reader.take())
        return len(came["a"]) > 20 and len(came["nano"]) > 20

    until(enough, "frames of the mock")
    assert len([t for t in threading.enumerate() if t.name == "mocap mock"]) == 1
    assert [reader.trouble() for reader in readers] == [
        None, None, "mock sends no `other`, but `a`, `nano`",
    ]  # fmt: skip
    for reader in readers:
        reader.close()
    assert {pose.position for pose in came["a"]} == {(1.0, 2.0, 3.0)}
    assert came["nano"][0].attitude == pytest.approx((0.6, 0.0, 0.0, 0.8))
    assert came["other"] == []
    arrivals = [pose.time for pose in came["a"]]
    assert arrivals == sorted(set(arrivals))
    until(lambda: "mocap mock" not in {t.name for t in threading.enumerate()}, "its end")


def test_a_system_that_never_answers_stops_nobody() -> None:
    """The library's `connect` to Vicon waits for ever and lets no other thread run."""
    params = MotionCaptureSensorParams(system="vicon", host="127.0.0.1")
    stream = MotionCaptureSensor.open(params, SITE, None, random.Random(0))  # type: ignore[arg-type]
    assert [stream.read(tick * NS // 250) for tick in range(50)] == [[]] * 50
    assert stream.trouble() == "vicon: no frame has arrived yet"
    stream.close()


def test_a_refusal_is_passed_on() -> None:
    params = MotionCaptureSensorParams(system="qualisys", host="127.0.0.1")
    stream = MotionCaptureSensor.open(params, SITE, None, random.Random(0))  # type: ignore[arg-type]
    until(lambda: "Error connecting QTM" in (stream.trouble() or ""), "the refusal")
    stream.close()


def test_poses_are_in_the_world_on_the_clock_of_the_run() -> None:
    class Script:
        def take(self) -> list[TrackerPose]:
            return [
                TrackerPose(7 * NS, 7 * NS, (1.0, 2.0, 3.0), LEVEL),
                TrackerPose(7 * NS, 7 * NS, (0.0,) * 3, (0.0,) * 4),
            ]  # type: ignore[arg-type]

    stream = PoseStream(Script(), "m", "y_up", 0.02, lambda: 7 * NS)  # type: ignore[arg-type]
    expected: list[Measurement] = [Pose(3 * NS - NS // 50, (1.0, -3.0, 2.0), LEVEL)]
    assert stream.read(3 * NS) == expected
    assert MotionCaptureSensor.provides == {Pose}


def test_a_program_that_can_not_be_begun_or_talks_nonsense_is_begun_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first can't be begun, the next ones say what is no JSON, no frame, no pose; the last is
    the mock."""
    real, begun = subprocess.Popen, []
    said = ["no JSON", "[1]", '[1, {"a": [0.0]}]']

    def popen(program: list[str], **more: Any) -> Any:
        begun.append(system.trouble("a"))
        if len(begun) == 1:
            raise OSError(12, "Cannot allocate memory")
        if len(begun) - 2 < len(said):
            program = [sys.executable, "-c", f"print({said[len(begun) - 2]!r})"]
        return real(program, **more)

    monkeypatch.setattr(feed, "FIRST_PAUSE", 0.001)
    monkeypatch.setattr(feed, "LONGEST_PAUSE", 0.002)
    monkeypatch.setattr(feed.subprocess, "Popen", popen)
    system = feed.Feed(("mock", json.dumps(MOCK)))
    reader = system.add("a")
    system.start()
    until(lambda: bool(reader.take()), "poses of the mock")
    assert reader.trouble() is None
    assert system.drop(reader)
    system.end()
    reasons = [str(reason).removeprefix("mock: ").partition(":")[0] for reason in begun]
    assert reasons == [
        "no frame has arrived yet", "OSError", "JSONDecodeError", "ValueError", "ValueError",
    ]  # fmt: skip


def test_the_system_of_a_vehicle_sees_a_moving_obstacle(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the library's mock, from its program to what vehicles keep away from."""
    settings = {**MOCK, "rigid_bodies": "nano(4,5,6,1,0,0,0);ball_7(1,2,3,1,0,0,0)"}
    monkeypatch.setattr(feed, "subscribe", lambda _, __, body: subscribe("mock", settings, body))
    params = MotionCaptureSensorParams(system="vicon", host="127.0.0.1", body="nano")
    params = MotionCaptureSensor.tracking(params, "ball_7")
    stream = MotionCaptureSensor.open(params, SITE, None, random.Random(0))  # type: ignore[arg-type]
    ball = MovingSphere(((0.0, 0.0, 1.0),), 0.1, 0.5)
    moving = moving_obstacles({"ball": ball}, Events(), {"ball": stream})
    began = time.monotonic_ns()

    def is_seen() -> bool:
        moving.step(time.monotonic_ns() - began)
        return "ball" in moving.seen

    try:
        until(is_seen, "a pose of the ball")
    finally:
        stream.close()
    assert moving.seen["ball"].position == (1.0, 2.0, 3.0)
