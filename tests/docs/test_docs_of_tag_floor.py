"""The page on tag floors: followed in its order, in an empty folder, its mission is valid and its
commands do what it says they do."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cv2")

import cv2
from pages import blocks, page
from toolchain import compiled, invoke

from kybflow.core.geometry import LEVEL, ZERO, add
from kybflow.core.signals import Truth
from kybflow.vision.rendering.drawing import Room
from kybflow.world.cameras import Optics

PAGE = page("docs/tag-floor.md")
MISSION, CAMERA, TARGETS = blocks(PAGE)
COMMANDS = re.findall(r"^    kybflow (.+)$", PAGE, re.MULTILINE)
CALIBRATION = """image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [452, 0, 322.0, 0, 453, 236.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.02, 0, 0, 0]}
"""
SECONDS, RATE = 4, 15


@pytest.fixture
def floor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The page's mission after step 2, in a folder of its own in which commands are given."""
    mission = tmp_path / "floor.yaml"
    mission.write_text(MISSION, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return mission


def calibrated(mission: Path) -> None:
    """Step 5."""
    folder = mission.with_name("lab")
    folder.mkdir()
    (folder / "down.yaml").write_text(CALIBRATION)
    text = mission.read_text(encoding="utf-8")
    changed, count = re.subn(r"(?m)^      down: \{at: .*\n", CAMERA, text)
    assert count == 1
    mission.write_text(changed, encoding="utf-8")


def given(command: str) -> Any:
    assert command in COMMANDS
    return invoke(*shlex.split(command))


def recorded(mission: Path, east: float) -> None:
    """A video of the vehicle that stands so far east of its start: a second, over and over."""
    plan = compiled(mission)
    (vehicle,) = plan.vehicles
    (camera,) = vehicle.cameras.values()
    room = Room(plan.tags, Optics(), 5)
    body = Truth(add(vehicle.start, (east, 0.0, 0.0)), ZERO, LEVEL, ZERO)
    size = (camera.lens.width, camera.lens.height)
    code = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(mission.with_name("standing.avi")), code, RATE, size)
    second = [cv2.cvtColor(room.draw(camera, body), cv2.COLOR_GRAY2BGR) for _ in range(RATE)]
    for frame in second * SECONDS:
        writer.write(frame)
    writer.release()


def filmed(mission: Path, east: float) -> None:
    """Steps 5 and 6, with the vehicle so far east of its start."""
    calibrated(mission)
    recorded(mission, east)
    with mission.open("a", encoding="utf-8") as text:
        text.write(f"\n{TARGETS}")


def test_its_mission_is_valid_after_every_step(floor: Path) -> None:
    (camera,) = compiled(floor).vehicles[0].cameras.values()
    assert (camera.lens.distortion[0], camera.rate) == (0.0, 15.0)
    calibrated(floor)
    (camera,) = compiled(floor).vehicles[0].cameras.values()
    assert (camera.lens.distortion[0], camera.rate) == (-0.1, 15.0)
    assert len(compiled(floor).tags) == 36 - 4 + 36


def test_every_tag_of_the_mission_is_printed(floor: Path) -> None:
    result = given("tags floor.yaml --paper a3 --out floor.pdf")
    assert result.exit_code == 0, result.output
    printed = re.findall(rb"\(36h11  id (\d+)  (\d+) mm", floor.with_name("floor.pdf").read_bytes())
    large = {number for number in range(36) if number not in (7, 8, 13, 14)}
    assert {(int(number), int(side)) for number, side in printed} == {
        *((number, 195) for number in large),
        *((number, 50) for number in range(100, 136)),
    }


def test_a_video_shows_where_the_vehicle_stands(floor: Path) -> None:
    filmed(floor, 0.03)
    assert len(compiled(floor, target="bench").tags) == 36 - 4 + 36
    result = given("preflight floor.yaml --target bench")
    assert "0.03 m from the declared start" in result.output
    assert result.exit_code == 0, result.output


def test_a_video_shows_that_floor_and_mission_differ(floor: Path) -> None:
    filmed(floor, 0.0)
    text = floor.read_text(encoding="utf-8")
    floor.write_text(text.replace("at: world.points.pad}", "at: [0.3, 0, 0]}"), encoding="utf-8")
    result = given("preflight floor.yaml --target bench")
    assert re.search(r"0\.3[01] m from the declared start", result.output), result.output
    assert result.exit_code == 1, result.output


@pytest.mark.slow
def test_it_flies(floor: Path) -> None:
    filmed(floor, 0.0)
    result = given("run floor.yaml")
    assert result.exit_code == 0, result.output
