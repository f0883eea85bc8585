"""A lab's own package: installed as its README says, found by its entry point, flown."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from toolchain import ROOT

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a Python that has `examples/lab-parts` installed beside what is here."""
    where = tmp_path_factory.mktemp("site")
    source = shutil.copytree(ROOT / "examples" / "lab-parts", where / "source")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
    install += ["--no-build-isolation", "--target", str(where / "lib"), str(source)]
    subprocess.run(install, check=True, capture_output=True, text=True)
    return {**os.environ, "PYTHONPATH": str(where / "lib")}


def kybflow(environment: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "kybflow", *words]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_the_part_is_listed_with_its_parameters(installed: dict[str, str]):
    shown = kybflow(installed, "parts", "bob")
    assert shown.returncode == 0
    assert "How far up it goes." in shown.stdout
    assert kybflow({**os.environ}, "parts", "bob").returncode == 2


def test_the_page_of_parts_is_without_it(installed: dict[str, str]):
    checked = kybflow(installed, "parts", "--check", str(ROOT / "docs" / "parts.md"))
    assert checked.returncode == 0, checked.stderr


def test_its_mission_flies(installed: dict[str, str], tmp_path: Path):
    mission = str(ROOT / "examples" / "lab-parts" / "bob.yaml")
    flown = kybflow(installed, "run", mission, "--out", str(tmp_path), "--no-report")
    assert flown.returncode == 0, flown.stdout + flown.stderr


def test_its_processor_retunes_the_tracker_in_flight(installed: dict[str, str], tmp_path: Path):
    mission = str(ROOT / "examples" / "lab-parts" / "scheduled.yaml")
    flown = kybflow(installed, "run", mission, "--out", str(tmp_path), "--no-report")
    assert flown.returncode == 0, flown.stdout + flown.stderr
    told = (tmp_path / "events.jsonl").read_text(encoding="utf-8").splitlines()
    changed = [e["fields"] for e in map(json.loads, told) if e["event"] == "option_changed"]
    assert {(e["option"], e["by"]) for e in changed} == {
        ("nano.tracker.derivative", "processor gains_by_speed")
    }
    values = [float(e["value"]) for e in changed]
    assert values == [7.5, 7.125, 6.75, 6.375, 6.0, 6.375, 6.75, 7.125, 7.5]


def test_its_parts_keep_the_contract_of_all_parts(installed: dict[str, str]):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    command += [
        str(ROOT / "tests" / "parts" / "test_part_contract.py"),
        "-k",
        "bob or tally or gains",
    ]
    judged = subprocess.run(command, env=installed, capture_output=True, text=True, check=False)
    assert judged.returncode == 0, judged.stdout
    assert "skipped" not in judged.stdout.splitlines()[-1]


def test_a_mistake_in_its_parameters_is_reported_like_any_other(
    installed: dict[str, str], tmp_path: Path
):
    text = (ROOT / "examples" / "lab-parts" / "bob.yaml").read_text(encoding="utf-8")
    bad = tmp_path / "bad.yaml"
    bad.write_text(text.replace("height: 40 cm", "height: 40 s"), encoding="utf-8")
    shown = kybflow(installed, "validate", str(bad))
    assert shown.returncode == 2
    assert "a duration, but a length is needed" in shown.stdout


def test_its_action_counts_and_emits(installed: dict[str, str], tmp_path: Path):
    mission = str(ROOT / "examples" / "lab-parts" / "bob.yaml")
    kybflow(installed, "run", mission, "--out", str(tmp_path), "--no-report")
    told = (tmp_path / "events.jsonl").read_text(encoding="utf-8").splitlines()
    names = [json.loads(line)["event"] for line in told]
    assert names.count("logged") == 3
    assert names.count("tally_reached") == 1
    assert "action_failed" not in names


def test_a_package_may_not_take_the_name_of_an_action_of_the_language(tmp_path: Path):
    home = tmp_path / "lab_words" / "actions"
    home.mkdir(parents=True)
    for file in (home.parent / "__init__.py", home / "__init__.py", home / "log.py"):
        file.touch()
    meta = tmp_path / "lab_words-1.dist-info"
    meta.mkdir()
    (meta / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-words\nVersion: 1\n")
    (meta / "entry_points.txt").write_text("[kybflow.parts]\nlab = lab_words\n")
    shown = kybflow({**os.environ, "PYTHONPATH": str(tmp_path)}, "parts")
    assert shown.returncode == 2
    assert "lab_words.actions.log: the language itself has the action `log`" in shown.stderr


def test_two_packages_with_one_name_are_refused_with_both_places(
    installed: dict[str, str], tmp_path: Path
):
    twin = tmp_path / "twin"
    (twin / "twin_parts" / "behaviors").mkdir(parents=True)
    (twin / "twin_parts" / "__init__.py").touch()
    (twin / "twin_parts" / "behaviors" / "__init__.py").touch()
    (twin / "twin_parts" / "behaviors" / "bob.py").touch()
    meta = twin / "twin_parts-1.dist-info"
    meta.mkdir()
    (meta / "METADATA").write_text("Metadata-Version: 2.1\nName: twin-parts\nVersion: 1\n")
    (meta / "entry_points.txt").write_text("[kybflow.parts]\ntwin = twin_parts\n")
    path = os.pathsep.join([installed["PYTHONPATH"], str(twin)])
    shown = kybflow({**installed, "PYTHONPATH": path}, "parts")
    assert shown.returncode == 2
    assert "two packages offer `bob`" in shown.stderr
    assert "Traceback" not in shown.stderr
