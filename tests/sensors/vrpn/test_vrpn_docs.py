"""What docs/motion-capture.md says is true."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import typer

from kybflow.catalog import load_catalog
from kybflow.cli import app
from kybflow.dsl.compiler import compile_mission
from kybflow.sensors.vrpn import VrpnParams

REPO = Path(__file__).parents[3]
PAGE = (REPO / "docs" / "motion-capture.md").read_text(encoding="utf-8")


def test_its_mission_compiles_and_takes_poses_from_the_network(tmp_path: Path) -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    shutil.copytree(REPO / "missions" / "library", tmp_path / "library")
    mission = tmp_path / "in_the_lab.yaml"
    mission.write_text(text, encoding="utf-8")
    result = compile_mission(mission, catalog=load_catalog(), target="network")
    assert result.plan is not None
    (sensor,) = result.plan.vehicles[0].sensors
    assert sensor.part.params == VrpnParams(host="127.0.0.1")
    assert sensor.estimators == ("mocap",)


def test_its_commands_exist() -> None:
    command = typer.main.get_command(app)
    lines = re.findall(r"^    kybflow (mocap-server [^#\n]*)", PAGE, re.MULTILINE)
    assert len(lines) == 2
    for line in lines:
        name, *arguments = shlex.split(line)
        server = command.commands[name]  # type: ignore[attr-defined]
        server.make_context(name, arguments, resilient_parsing=False)
