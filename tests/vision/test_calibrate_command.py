"""`kybflow calibrate`: what it prints and writes, and what it says of each mistake."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy
import pytest

pytest.importorskip("cv2")

import cv2
from tag_floors import room, still
from toolchain import MISSIONS, compiled, invoke
from walks import CAMERA, TURN, bodies, pose_at, scene

from kybflow.core.errors import FileError
from kybflow.core.files import File
from kybflow.core.geometry import from_euler, multiply
from kybflow.vision.calibration.track import read_poses
from kybflow.vision.tags import read_tags, write_tags

MISSION = """kybflow: 1
mission: floor
import: {std: kybflow/airframes}
world:
  fence: {from: [-2, -2, 0], to: [2, 2, 2]}
  tags: {floor: {TAGS}}
airframes:
  mine:
    like: std.courier_quad
    cameras: {down: {at: [11 cm, 0 m, 15 cm], row_time: 0 s}CAMERAS}
vehicles:
  mine:
    airframe: mine
    start: {at: [0.4, 0.4, 0]}
    estimators: [tag_camera]
    behaviors: {up: {do: take_off, height: 1 m, then: down}, down: {do: land}}
"""
TABLE = "file: tags.csv"
GRID = "grid: {family: 36h11, count: [3, 3], size: 19.5 cm, spacing: 1.27 cm}"


def written(folder: Path, tags: str = GRID, cameras: str = "") -> Path:
    mission = folder / "floor.yaml"
    mission.write_text(MISSION.replace("TAGS", tags).replace("CAMERAS", cameras), encoding="utf-8")
    return mission


def given(mission: Path, *arguments: str | Path):
    return invoke("calibrate", mission, *arguments)


def walked(folder: Path, side: int, count: int) -> Path:
    """A mission with a wrong map and camera, a folder of images and a table of poses beside it."""
    made = scene(9, side)
    (folder / "tags.csv").write_text(write_tags(made.survey), encoding="utf-8")
    mission = written(folder, TABLE)
    (camera,) = compiled(mission).vehicles[0].cameras.values()
    true = camera._replace(
        attitude=multiply(from_euler(*TURN), camera.attitude),
        lens=camera.lens._replace(fx=camera.lens.fx * 1.01, fy=camera.lens.fy * 1.01),
    )
    lit = room(made.tags, row_time=0.0)
    (folder / "walk").mkdir()
    rows = ["time, x, y, z, roll [deg], pitch [deg], heading [deg]"]
    for i, body in enumerate(bodies(count)):
        cv2.imwrite(str(folder / "walk" / f"{0.5 * i:08.3f}.png"), lit.draw(true, body))
    for t in numpy.arange(-1.0, 0.5 * count + 1.0, 0.01).tolist():
        (x, y, z), _ = pose_at(t)
        turn = numpy.rad2deg((0.3 * numpy.sin(2.1 * t), 0.3 * numpy.cos(1.7 * t), 0.8 * t))
        rows.append(", ".join(f"{value:.6f}" for value in (t + 5.0, x, y, z, *turn)))
    (folder / "poses.csv").write_text("\n".join(rows), encoding="utf-8")
    return mission


@pytest.mark.thorough
def test_a_walk_corrects_a_mission(tmp_path: Path) -> None:
    mission = walked(tmp_path, 3, 8)
    made = scene(9, 3)
    lab = tmp_path / "lab"
    frames, poses = tmp_path / "walk", tmp_path / "poses.csv"
    result = given(mission, "--frames", frames, "--poses", poses, "--write", lab)
    assert result.exit_code == 0, result.output
    assert "frames: 8 of 8 show tags, out of 8" in result.output
    assert "clock: the poses are +5.000 s ahead of the frames" in result.output
    (roll,) = re.findall(r"^  roll +(\S+) deg", result.output, re.MULTILINE)
    assert float(roll) == pytest.approx(0.6, abs=0.05)
    text = (lab / "tags.csv").read_text(encoding="utf-8")
    tags = {row.tag.key: row.tag for row in read_tags(File("tags.csv", "", text))}
    for tag in made.tags:
        assert tags[tag.key].position == pytest.approx(tag.position, abs=0.002)
    changes = (lab / "changes.yaml").read_text(encoding="utf-8")
    camera = changes.partition("cameras:\n    ")[2].strip()
    old = mission.read_text(encoding="utf-8")
    assert "{down: {at: [11 cm, 0 m, 15 cm], row_time: 0 s}}" in old
    new = old.replace("{down: {at: [11 cm, 0 m, 15 cm], row_time: 0 s}}", f"{{{camera}}}")
    mission.write_text(new.replace(TABLE, "file: lab/tags.csv"), encoding="utf-8")
    (corrected,) = compiled(mission).vehicles[0].cameras.values()
    assert corrected.lens.fx == pytest.approx(1.01 * 457.007, abs=0.5)
    assert corrected.position == pytest.approx(CAMERA.position, abs=0.002)
    true = multiply(from_euler(*TURN), CAMERA.attitude)
    assert corrected.attitude == pytest.approx(true, abs=0.001)


@pytest.mark.thorough
def test_frames_alone_say_what_they_do_not_tell(tmp_path: Path) -> None:
    made = scene(9, 3)
    (tmp_path / "tags.csv").write_text(write_tags(made.survey), encoding="utf-8")
    mission = written(tmp_path, TABLE)
    camera = CAMERA._replace(lens=compiled(mission).vehicles[0].cameras["down"].lens)
    lit = room(made.tags, row_time=0.0)
    video = cv2.VideoWriter(
        str(tmp_path / "walk.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 10, (640, 480)
    )
    for x in (0.2, 0.22, 0.24, 0.26, 0.28, 0.3):
        drawn = lit.draw(camera, still((x, 0.2, 0.6)))
        video.write(cv2.cvtColor(drawn, cv2.COLOR_GRAY2BGR))
    video.release()
    result = given(mission, "--frames", tmp_path / "walk.avi")
    assert result.exit_code == 0, result.output
    assert "mount of `down`: not observable from frames alone" in result.output
    assert "not observable: focal; tilt the camera by 20 to 30 degrees" in result.output


SAID = {
    "no frames": ([], {}, "Missing option '--frames'"),
    "nothing there": (["--frames", "none.avi"], {}, "doesn't exist; give a video or a folder"),
    "another camera": (["--frames", ".", "--camera", "dwon"], {}, "did you mean `down`?"),
    "another vehicle": (["--frames", ".", "--vehicle", "yours"], {}, "there is no vehicle with"),
    "two references": (
        ["--frames", ".", "--poses", "a", "--standing"],
        {},
        "--standing, not both",
    ),
    "a run": (["--frames", "frames"], {"events.jsonl": ""}, "scaled and drawn on"),
    "no table": (["--frames", ".", "--poses", "p.csv"], {}, "`p.csv` can't be read"),
    "a bad table": (
        ["--frames", ".", "--poses", "p.csv"],
        {"p.csv": "time, x, y, z, qw, qx, qy, qz\n0, 0, 0, 0, 1, 0, 0, 1\n"},
        "p.csv:2: the quaternion's length is 1.41, not 1",
    ),
    "a pipe of frames": (["--frames", "pipe"], {}, "is neither a file nor a folder"),
    "a device of frames": (["--frames", "/dev/zero"], {}, "is neither a file nor a folder"),
    "a pipe of poses": (["--frames", ".", "--poses", "pipe"], {}, "not a regular file"),
    "no end of poses": (["--frames", ".", "--poses", "/dev/zero"], {}, "not a regular file"),
    "no recording": (["--frames", ".", "--poses", "walk"], {}, "is not a recording of a run"),
}


@pytest.mark.parametrize("case", SAID)
def test_a_wrong_command_line_is_told(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments, files, said = SAID[case]
    monkeypatch.chdir(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    for name in ("frames", "walk"):
        (tmp_path / name).mkdir()
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    result = given(written(tmp_path), *arguments)
    assert said in " ".join(result.output.split())
    assert result.exit_code == 2


def test_frames_that_tell_nothing_are_told(tmp_path: Path) -> None:
    mission = written(tmp_path)
    walk = tmp_path / "walk"
    walk.mkdir()
    result = given(mission, "--frames", walk)
    assert (result.exit_code, result.output) == (1, f"error: `{walk}` has no frames\n")
    cv2.imwrite(str(walk / "0.png"), numpy.zeros((240, 320), numpy.uint8))
    result = given(mission, "--frames", walk)
    assert "error: the frames are 320 x 240, but the lens of `down` is" in result.output
    assert result.exit_code == 1
    (walk / "0.png").write_text("none")
    assert "0.png` is not an image" in given(mission, "--frames", walk).output
    (tmp_path / "walk.avi").write_text("none")
    assert "walk.avi` is not a video" in given(mission, "--frames", tmp_path / "walk.avi").output


def test_a_mission_without_a_camera_or_tags_is_told(tmp_path: Path) -> None:
    bare = MISSIONS / "first_flight.yaml"
    result = given(bare, "--frames", tmp_path)
    assert "no vehicle of `first_flight` has a camera" in result.output
    text = written(tmp_path).read_text(encoding="utf-8")
    lost = text.replace(f"  tags: {{floor: {{{GRID}}}}}\n", "").replace("[tag_camera]", "[mocap]")
    (tmp_path / "floor.yaml").write_text(lost, encoding="utf-8")
    result = given(tmp_path / "floor.yaml", "--frames", tmp_path)
    assert "has no tags; add them in `world: {tags: ...}`" in " ".join(result.output.split())
    assert result.exit_code == 2


def test_several_cameras_must_be_told_apart(tmp_path: Path) -> None:
    mission = written(tmp_path, GRID, ", front: {at: [0, 0, 0], facing: forward, width: 64, "
                      "height: 48, field_of_view: 60 deg}")  # fmt: skip
    result = given(mission, "--frames", tmp_path)
    assert "name one of `down`, `front`" in result.output
    assert result.exit_code == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time, x, y, z\n", "the column `qw` is missing"),
        ("time, x, y, z, roll [deg]\n", "the column `pitch` is missing"),
        ("time, x, y, z, qw, qx, qy, qz\n0, 0, 0, 0, 1, 0, 0, 0\n", "it has 1 poses"),
        (
            "time, x, y, z, qw, qx, qy, qz\n1, 0, 0, 0, 1, 0, 0, 0\n1, 0, 0, 0, 1, 0, 0, 0\n",
            "the times don't grow",
        ),
    ],
)
def test_a_table_of_poses_is_checked(text: str, said: str) -> None:
    with pytest.raises(FileError, match=said):
        read_poses(text)


def test_a_table_of_tags_reads_back() -> None:
    tags = scene(1, 3).survey
    tags[0] = tags[0]._replace(attitude=from_euler(1.5, 0.1, -2.0))
    rows = read_tags(File("tags.csv", "", write_tags(tags)))
    for row, tag in zip(rows, tags, strict=True):
        assert row.tag.key == tag.key
        assert row.tag.position == pytest.approx(tag.position, abs=1e-5)
        assert row.tag.attitude == pytest.approx(tag.attitude, abs=1e-4)
