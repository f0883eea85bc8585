"""A part in a file of one's own flies when somebody names the file, and its mistakes are told."""

from __future__ import annotations

import json
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from toolchain import ROOT, invoke, with_library
from typer.testing import CliRunner

import kybflow
from kybflow.cli.app import app
from kybflow.dsl.reading.reader import RESOLVED

TRACKER = ROOT / "examples" / "my_tracker.py"
MISSION = """\
kybflow: 1
mission: mine
import: {std: library/airframes.yaml}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  a:
    like: std.nano_plus
    tracker: {use: my_tracker, stiffness: 12}
    behaviors:
      up: {do: take_off, height: 1 m, then: hold}
      hold: {do: hover, for_time: 2 s, then: down}
      down: {do: land}
expect: [finally a in landed, max(a.position_error in hold) < 10 cm]
"""


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = with_library(tmp_path) / "mine.yaml"
    path.write_text(MISSION)
    return path


def test_a_tracker_of_ones_own_flies_and_is_named_by_its_hash(mission: Path) -> None:
    run = kybflow.run(mission, parts=[TRACKER], out=mission.parent / "run")
    assert run.succeeded, run.reason
    [flown] = json.loads((run.folder / "provenance.json").read_text())["parts"]
    assert flown["path"] == str(TRACKER)
    assert flown["sha256"] == sha256(TRACKER.read_bytes()).hexdigest()


def test_a_mission_alone_makes_nobodys_code_run(mission: Path) -> None:
    marker = mission.parent / "ran"
    own = mission.parent / "my_tracker.py"
    touch = f"from pathlib import Path\nPath({str(marker)!r}).touch()\n"
    own.write_text(TRACKER.read_text() + touch)
    [finding] = kybflow.validate(mission)
    assert finding.message == "no tracker is called `my_tracker`"
    assert not marker.exists()
    assert kybflow.validate(mission, parts=[own]).valid
    assert marker.exists()


def test_its_parameters_are_judged_like_any_other(mission: Path) -> None:
    mission.write_text(MISSION.replace("stiffness: 12", "stiffness: -1"))
    [finding] = kybflow.validate(mission, parts=[TRACKER])
    assert "stiffness" in finding.message
    assert finding.span.line == 8


def test_a_part_that_raises_shows_its_line(mission: Path) -> None:
    own = mission.parent / "my_tracker.py"
    own.write_text(
        TRACKER.read_text().replace("k, d, now =", "nothing.at_all\n        k, d, now =")
    )
    run = kybflow.run(mission, parts=[own], out=mission.parent / "raised")
    assert not run.succeeded
    line = next(i for i, text in enumerate(own.read_text().splitlines(), 1) if "nothing" in text)
    failed = next(event for event in run.events if "traceback" in event.fields)
    assert failed.fields["reason"] == "NameError: name 'nothing' is not defined"
    assert f'my_tracker.py", line {line}' in str(failed.fields["traceback"])


def test_a_part_that_calls_exit_fails_its_vehicle_alone(mission: Path) -> None:
    own = mission.parent / "my_tracker.py"
    leaves = (
        "if tick.elapsed > 1.0 and tick.estimate.position[2] > 0.5:\n"
        "            raise SystemExit(3)\n"
        "        k, d, now ="
    )
    own.write_text(TRACKER.read_text().replace("k, d, now =", leaves))
    run = kybflow.run(mission, parts=[own], out=mission.parent / "left")
    assert run.outcome == "failed"
    assert run.summary["vehicles"]["a"]["final"] == "ground"
    [failed] = [event for event in run.events if event.name == "part_failed"]
    assert (failed.fields["part"], failed.fields["reason"]) == ("tracker", "SystemExit: 3")


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("bad", "import nothing_at_all\n", "bad.py:1 can't be imported: ModuleNotFoundError"),
        ("typo", "def f(:\n", "typo.py:1 can't be imported: SyntaxError"),
        ("plain", "x = 1\n", "plain.py` should define one part"),
        ("cascade", TRACKER.read_text(), "two packages offer `cascade`"),
        ("other", TRACKER.read_text(), "should define the class `Other(Tracker[...])`"),
    ],
)
def test_what_is_wrong_with_the_file_is_told(mission: Path, name, text, told: str) -> None:
    own = mission.parent / f"{name}.py"
    own.write_text(text)
    mission.write_text(MISSION.replace("my_tracker, stiffness: 12", name))
    said = CliRunner().invoke(app, ["validate", str(mission), "--parts", str(own)])
    assert said.exit_code == 2
    assert told in said.output
    assert "Traceback" not in said.output


def test_missions_are_tested_with_a_part_of_ones_own(mission: Path) -> None:
    words = ["--jobs", 1, "--out", mission.parent / "runs"]
    done = invoke("test", mission, "--parts", TRACKER, *words)
    assert done.exit_code == 0, done.output
    assert invoke("test", mission, *words).exit_code == 2
    told = invoke("test", mission, "--parts", mission, *words).stderr
    assert told == f"error: `{mission}` is not a Python file\n"


def test_a_run_is_repeated_only_with_its_parts(mission: Path) -> None:
    own = mission.parent / "my_tracker.py"
    own.write_text(TRACKER.read_text())
    run = kybflow.run(mission, parts=[own], out=mission.parent / "run").folder
    again = ("run", run / RESOLVED, "--again", run, "--no-report", "--out")
    missing = invoke(*again, mission.parent / "none")
    first = sha256(own.read_bytes()).hexdigest()
    assert missing.exit_code == 2
    assert f"--parts {own} (SHA-256 {first})" in missing.stderr
    repeated = invoke(*again, mission.parent / "same", "--parts", TRACKER)
    assert repeated.exit_code == 0
    assert "warning" not in repeated.stderr
    ways = [kybflow.Run.load(mission.parent / name).vehicle("a") for name in ("run", "same")]
    assert np.array_equal(ways[0]["truth.position"], ways[1]["truth.position"])
    own.write_text(f"{TRACKER.read_text()}# edited\n")
    warned = invoke(*again, mission.parent / "edited", "--parts", own)
    assert warned.exit_code == 0
    assert f"warning: `{own}` is not the file that the earlier run flew:" in warned.stderr
    assert f"and was {first}" in warned.stderr
