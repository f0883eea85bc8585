"""A lab's own package: installed as its README says, found by its entry point, flown."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from installed_package import installed
from toolchain import ROOT, program

pytestmark = pytest.mark.thorough
EXAMPLE = ROOT / "examples" / "lab-parts"


@pytest.fixture(scope="module")
def lib(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which `examples/lab-parts` is installed beside what is here."""
    where = tmp_path_factory.mktemp("site")
    source = shutil.copytree(EXAMPLE, where / "source")
    install = ("install", "--quiet", "--no-deps", "--no-build-isolation", "--target")
    done = program(*install, where / "lib", source, module="pip")
    assert done.returncode == 0, done.stderr
    return where / "lib"


def flown(lib: Path, mission: str, out: Path) -> list[dict[str, Any]]:
    """The events of one of the example's missions."""
    done = program("run", EXAMPLE / mission, "--out", out, "--no-report", path=[lib])
    assert done.returncode == 0, done.stdout + done.stderr
    lines = (out / "events.jsonl").read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines]


def test_the_part_is_listed_with_its_parameters(lib: Path):
    shown = program("parts", "bob", path=[lib])
    assert shown.returncode == 0
    assert "How far up it goes." in shown.stdout
    assert program("parts", "bob").returncode == 2


def test_the_page_of_parts_is_without_it(lib: Path):
    checked = program("parts", "--check", ROOT / "docs" / "parts.md", path=[lib])
    assert checked.returncode == 0, checked.stderr


def test_its_processor_retunes_the_tracker_in_flight(lib: Path, tmp_path: Path):
    told = flown(lib, "scheduled.yaml", tmp_path)
    changed = [e["fields"] for e in told if e["event"] == "option_changed"]
    assert {(e["option"], e["by"]) for e in changed} == {
        ("nano.tracker.derivative", "processor gains_by_speed")
    }
    values = [float(e["value"]) for e in changed]
    assert values == [7.5, 7.125, 6.75, 6.375, 6.0, 6.375, 6.75, 7.125, 7.5]


def test_its_parts_keep_the_contract_of_all_parts(lib: Path):
    contract = ROOT / "tests" / "parts" / "test_part_contract.py"
    words = ("-q", "-p", "no:cacheprovider", contract, "-k", "bob or tally or gains")
    judged = program(*words, module="pytest", path=[lib])
    assert judged.returncode == 0, judged.stdout
    assert "skipped" not in judged.stdout.splitlines()[-1]


def test_a_mistake_in_its_parameters_is_reported_like_any_other(lib: Path, tmp_path: Path):
    text = (EXAMPLE / "bob.yaml").read_text(encoding="utf-8")
    bad = tmp_path / "bad.yaml"
    bad.write_text(text.replace("height: 40 cm", "height: 40 s"), encoding="utf-8")
    shown = program("validate", bad, path=[lib])
    assert shown.returncode == 2
    assert "a duration, but a length is needed" in shown.stdout


def test_its_mission_flies_and_its_action_counts_and_emits(lib: Path, tmp_path: Path):
    names = [event["event"] for event in flown(lib, "bob.yaml", tmp_path)]
    assert names.count("logged") == 3
    assert names.count("tally_reached") == 1
    assert "action_failed" not in names


def test_a_package_may_not_take_the_name_of_an_action_of_the_language(tmp_path: Path):
    files = ("__init__.py", "actions/__init__.py", "actions/log.py")
    installed(tmp_path, "lab_words", "parts lab_words", {f"lab_words/{f}": "" for f in files})
    shown = program("parts", path=[tmp_path])
    assert shown.returncode == 2
    assert "lab_words.actions.log: the language itself has the action `log`" in shown.stderr


def test_two_packages_with_one_name_are_refused_with_both_places(lib: Path, tmp_path: Path):
    files = ("__init__.py", "behaviors/__init__.py", "behaviors/bob.py")
    installed(tmp_path, "twin", "parts twin", {f"twin/{f}": "" for f in files})
    shown = program("parts", path=[lib, tmp_path])
    assert shown.returncode == 2
    assert "two packages offer `bob`" in shown.stderr
    assert "Traceback" not in shown.stderr
