"""The page on tag floors: its mission is valid, and its commands do what it says they do."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

cv2 = pytest.importorskip("cv2")

from kybflow.catalog import load_catalog  # noqa: E402
from kybflow.cli import app  # noqa: E402
from kybflow.dsl.compiler import compile_mission  # noqa: E402
from kybflow.geometry import LEVEL, ZERO, add  # noqa: E402
from kybflow.signals import Truth  # noqa: E402
from kybflow.vision.drawing import Room  # noqa: E402
from kybflow.vision.optics import Optics  # noqa: E402

PAGE = (Path(__file__).parents[2] / "docs" / "tag-floor.md").read_text(encoding="utf-8")
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
    """The page's mission in a folder of its own, in which commands are given."""
    found = re.search(r"^```yaml\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    assert found is not None
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "down.yaml").write_text(CALIBRATION)
    mission = tmp_path / "floor.yaml"
    mission.write_text(found[1], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return mission


def given(command: str) -> Any:
    assert command in COMMANDS
    return CliRunner().invoke(app, shlex.split(command))


def compiled(mission: Path, target: str = "sim") -> Any:
    result = compile_mission(mission, catalog=load_catalog(), target=target)
    assert [d.message for d in result.diagnostics] == []
    return result.plan


def recorded(mission: Path, east: float) -> None:
    """A video of the vehicle that stands so far east of its start."""
    plan = compiled(mission)
    (vehicle,) = plan.vehicles
    (camera,) = vehicle.cameras.values()
    room = Room(plan.tags, Optics(), 5)
    body = Truth(add(vehicle.start, (east, 0.0, 0.0)), ZERO, LEVEL, ZERO)
    size = (camera.lens.width, camera.lens.height)
    code = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(mission.with_name("standing.avi")), code, RATE, size)
    for _ in range(SECONDS * RATE):
        writer.write(cv2.cvtColor(room.draw(camera, body), cv2.COLOR_GRAY2BGR))
    writer.release()


@pytest.mark.parametrize("target", ["sim", "bench"])
def test_its_mission_is_valid(target: str, floor: Path) -> None:
    assert len(compiled(floor, target).tags) == 36 - 4 + 36


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
    recorded(floor, 0.03)
    result = given("preflight floor.yaml --target bench")
    assert "0.03 m from the declared start" in result.output
    assert result.exit_code == 0, result.output


def test_a_video_shows_that_floor_and_mission_differ(floor: Path) -> None:
    recorded(floor, 0.0)
    text = floor.read_text(encoding="utf-8")
    floor.write_text(text.replace("at: world.points.pad}", "at: [0.3, 0, 0]}"), encoding="utf-8")
    result = given("preflight floor.yaml --target bench")
    assert "0.30 m from the declared start" in result.output
    assert result.exit_code == 1, result.output


@pytest.mark.slow
def test_it_flies(floor: Path) -> None:
    result = given("run floor.yaml")
    assert result.exit_code == 0, result.output
