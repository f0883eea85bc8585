"""What docs/motion-capture.md says is true."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest
from command_lines import command
from pages import blocks, page
from toolchain import compiled, invoke, printed

from kybflow.sensors.vrpn import VrpnParams

PAGE = page("docs/motion-capture.md")


def written(folder: Path) -> Path:
    (text,) = blocks(PAGE)
    mission = folder / "in_the_lab.yaml"
    mission.write_text(text, encoding="utf-8")
    return mission


@pytest.mark.slow
def test_its_mission_flies_on_its_own_poses_from_the_network(tmp_path: Path) -> None:
    asked = ["mocap-server", str(written(tmp_path)), "--target", "network", "--out"]
    result = invoke(*asked, tmp_path / "run")
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["outcome"] == "succeeded"
    assert summary["vehicles"]["nano"]["position_error_m"]["max"] < 0.3


def test_its_mission_compiles_and_takes_poses_from_the_network(tmp_path: Path) -> None:
    plan = compiled(written(tmp_path), target="network")
    (sensor,) = plan.vehicles[0].sensors
    assert sensor.part.params == VrpnParams(host="127.0.0.1")
    assert sensor.estimators == ("mocap",)


def test_its_commands_exist() -> None:
    lines = re.findall(r"^    kybflow (mocap-server [^#\n]*)", PAGE, re.MULTILINE)
    assert len(lines) == 3
    for line in lines:
        name, *arguments = shlex.split(line)
        command(name).make_context(name, arguments, resilient_parsing=False)


def test_its_check_by_hand_shows_what_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(written(tmp_path).parent)
    (block,) = blocks(PAGE, "console")
    line, _, shown = block.partition("\n")
    code, said = printed(*line.removeprefix("$ kybflow ").split())

    def without_figures(text: str) -> str:
        return re.sub(r"\[.*\]|\d+|left|right", "...", text)

    assert (code, without_figures(said)) == (0, without_figures(shown))
