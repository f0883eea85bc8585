"""A new autopilot firmware is one file. The steps are those of CONTRIBUTING, taken in a copy of the
package: write the profile, and the driver, its targets, the command line, the schema and the
preflight know it; a second file emulates it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import kybflow

pytest.importorskip("pymavlink")

PACKAGE = Path(kybflow.__file__).parent
ROOT = Path(__file__).parents[3]
MISSION = "missions/first_flight.yaml"
PROFILE = '''"""Acme Copter, a made-up firmware that is much like PX4."""

from dataclasses import replace

from kybflow.drivers.mavlink.firmware import Danger, Needed, px4

NAMES = {1: "STEERED", 2: "COMPUTER", 3: "DOWN", 4: "STILL"}
PROFILE = replace(
    px4.PROFILE,
    mav_autopilot=99,
    names=NAMES,
    modes={"offboard": 2, "land": 3, "hold": 4} | {name: n for n, name in NAMES.items()},
    manual_modes=frozenset({"STEERED"}),
    indoors=(Needed("ACME_VISION", 1, "takes poses from kybflow"),
             Needed("ACME_LOST", 4, "it lands when setpoints stop")),
    dangers=(Danger("ACME_LOST", {0: "without setpoints it would fly on"}, "4 (land)"),),
    hover_parameter="ACME_HOVER",
    reaction="ACME_LOST",
    feeds=("ACME_VISION",),
    ready=lambda status: None if status.ready else "it is not ready",
)
'''
EMULATED = '''"""Acme Copter, emulated as PX4 is."""

from kybflow.drivers.emulated_autopilot.firmware.px4 import EMULATED

__all__ = ["EMULATED"]
'''


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package and its missions, with the profile in it."""
    shutil.copytree(PACKAGE, tmp_path / "kybflow", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "missions", tmp_path / "missions")
    profile = tmp_path / "kybflow" / "drivers" / "mavlink" / "firmware" / "acme.py"
    profile.write_text(PROFILE, encoding="utf-8")
    return tmp_path


def python(copy: Path, *arguments: str) -> tuple[int, str]:
    """The exit code and the output of a Python that has the copy."""
    paths = os.pathsep.join((str(copy), str(ROOT / "tests" / "support")))
    environment = {**os.environ, "PYTHONPATH": paths, "COLUMNS": "100"}
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, cwd=copy, text=True, timeout=120,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


def kybflow_says(copy: Path, *arguments: str) -> tuple[int, str]:
    return python(copy, "-m", "kybflow", *arguments)


@pytest.mark.thorough
def test_one_file_gives_the_target_the_choice_and_the_reference(copy: Path) -> None:
    assert kybflow_says(copy, "validate", MISSION, "--target", "acme")[0] == 0
    assert "<px4|ardupilot|acme>" in kybflow_says(copy, "mavlink", "setup", "--help")[1]
    assert "acme" in kybflow_says(copy, "parts", "mavlink")[1]
    code, _ = kybflow_says(copy, "schema", "--write", "mission.schema.json")
    schema = (copy / "mission.schema.json").read_text(encoding="utf-8")
    assert (code, '"acme"' in schema) == (0, True)


def test_its_parameters_are_asked_for_by_the_preflight(copy: Path) -> None:
    script = """
from scripted_autopilot import Bench
bench = Bench("acme")
bench.run(3.0)
bench.link.prepare_preflight(bench.now)
for check in bench.link.checks(bench.now):
    print(check.name, check.green, check.reason)
"""
    code, said = python(copy, "-c", script)
    assert code == 0, said
    assert "heartbeat True acme in STILL" in said
    assert "watchdog False dangerous: ACME_LOST" in said
    assert "ACME_LOST is 0: without setpoints it would fly on" in said
    assert "ACME_VISION is 0,  should be 1:  takes poses from kybflow" in said


@pytest.mark.thorough
def test_a_second_file_emulates_it(copy: Path) -> None:
    target = ("validate", MISSION, "--target", "emulated_acme")
    code, said = kybflow_says(copy, *target)
    assert (code, "KYB150" in said) == (2, True)
    folder = copy / "kybflow" / "drivers" / "emulated_autopilot" / "firmware"
    (folder / "acme.py").write_text(EMULATED, encoding="utf-8")
    assert kybflow_says(copy, *target)[0] == 0
    assert "acme" in kybflow_says(copy, "emulate", "autopilot", "--help")[1]
