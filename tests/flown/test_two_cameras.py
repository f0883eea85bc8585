"""Two cameras for one estimator, each with a recorded video of its own, from a mission to a run."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy
import pytest
from short_flights import named
from toolchain import compiled, flight_of

from kybflow.api.opening import open_devices
from kybflow.cli.printing.mission import show_mission
from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Frame
from kybflow.dsl.plan import Plan

cv2 = pytest.importorskip("cv2")

MISSION = """\
kybflow: 1
mission: two
import: {std: kybflow/airframes}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
  tags: {floor: {grid: {family: 36h11, count: [4, 4], size: 20 cm, spacing: 2 cm}}}
vehicles:
  a:
    like: std.courier_quad
    airframe:
      like: std.courier_quad
      cameras:
        down: {width: 64, height: 48}
        back: {at: [-10 cm, 0 m, 15 cm], width: 64, height: 48, field_of_view: 70 deg}
    estimators: [{use: fusion, source: tags}]
    behaviors: {up: {do: take_off, height: 1 m, then: down}, down: {do: land}}
targets:
  replay:
    a:
      driver: sim
      sensors:
        fusion:
          - {use: camera, camera: down, video: films/down.avi}
          - {use: camera, camera: back, video: films/back.avi}
"""
SECOND = MISSION.splitlines().index(
    "          - {use: camera, camera: back, video: films/back.avi}"
)
RATE, FRAMES = 20.0, {"down": 10, "back": 5}


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    """The mission, and its films beside it: one of a dark floor, a shorter one of a bright one."""
    (tmp_path / "films").mkdir()
    for name, level in (("down", 20), ("back", 200)):
        file, code = tmp_path / "films" / f"{name}.avi", cv2.VideoWriter.fourcc(*"MJPG")
        writer = cv2.VideoWriter(str(file), code, RATE, (64, 48))
        for _ in range(FRAMES[name]):
            writer.write(numpy.full((48, 64, 3), level, numpy.uint8))
        writer.release()
    path = tmp_path / "two.yaml"
    path.write_text(MISSION)
    return path


@pytest.fixture
def plan(mission: Path) -> Plan:
    return compiled(mission, target="replay", warns=True)


def test_each_camera_has_the_frames_of_its_own_video(plan: Plan) -> None:
    devices = open_devices(plan, 0)
    try:
        came = [sensor.stream.read(NS // 10) for sensor in devices.sensors["a"]]
    finally:
        devices.close()
    frames = [[m for m in measured if isinstance(m, Frame)] for measured in came]
    assert [{frame.camera for frame in of} for of in frames] == [{"down"}, {"back"}]
    dark, bright = (float(of[0].image.mean()) for of in frames)
    assert (dark, bright) == pytest.approx((20.0, 200.0), abs=5.0)


def test_the_one_that_is_over_is_told_by_its_name(plan: Plan, tmp_path: Path) -> None:
    _, told = flight_of(plan, tmp_path / "run", seed=0)
    assert [event.fields for event in named(told, "sensor_failed")] == [
        {"sensor": "fusion.1", "reason": "the video has ended"},
        {"sensor": "fusion", "reason": "the video has ended"},
    ]


def test_they_are_shown_by_their_names(plan: Plan) -> None:
    assert "senses by  camera (fusion), camera (fusion.1)\n" in show_mission(plan, {})


def test_what_can_not_be_opened_is_told_with_its_line(mission: Path, tmp_path: Path) -> None:
    (tmp_path / "films" / "back.avi").write_text("no film")
    plan = compiled(mission, target="replay", warns=True)
    with pytest.raises(DriverError, match=rf"^`camera` \(.*two\.yaml:{SECOND + 1}\): the video"):
        open_devices(plan, 0)


def test_without_opencv_the_line_is_told(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(DriverError, match=rf"two\.yaml:{SECOND}\): a camera needs OpenCV"):
        open_devices(plan, 0)
