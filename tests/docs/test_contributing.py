"""CONTRIBUTING.md's "Add a behavior in five minutes", done as written, in a copy of the package."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
TEXT = PAGE.partition("## Add a behavior in five minutes\n")[2].partition("\n## ")[0]


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)
    assert found is not None
    return found[1]


@pytest.mark.thorough
def test_the_five_minutes_are_true(tmp_path: Path):
    [part] = re.findall(r"Write the file\*\* `(.*?)`", TEXT)
    [mission] = re.findall(r"Fly it\*\* in `(.*?)`", TEXT)
    for folder in ("docs", "kybflow", "missions", "schemas", "tests"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / part).write_text(block("python"), encoding="utf-8")
    (tmp_path / mission).write_text(block("yaml"), encoding="utf-8")
    commands = re.findall(r"kybflow (parts nod|run \S+|\w+ --write [\w/.]+)", TEXT)
    assert commands == [
        "parts nod",
        f"run {mission}",
        "schema --write schemas/mission.schema.json",
        "parts --write docs/parts.md",
    ]
    for command in commands:
        do(tmp_path, "kybflow", *command.split())
    tests = ["tests/parts/test_part_contract.py", "tests/dsl", "tests/flown/test_missions.py"]
    tests.append("tests/cli/printing/test_reference.py")
    do(tmp_path, "pytest", "-q", "-k", "nod or current", *tests)


def do(folder: Path, *command: str) -> None:
    """Run a module as the text says, in the copy."""
    done = subprocess.run(
        [sys.executable, "-m", *command],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
