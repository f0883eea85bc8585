"""CONTRIBUTING.md's "Add a behavior in five minutes", done as written, in a copy of the package."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)
    assert found is not None
    return found[1]


def test_the_five_minutes_are_true(tmp_path: Path):
    [part] = re.findall(r"Write the file\*\* `(.*?)`", TEXT)
    [mission] = re.findall(r"Fly it\*\* in `(.*?)`", TEXT)
    for folder in ("kybflow", "missions"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    (tmp_path / part).write_text(block("python"), encoding="utf-8")
    (tmp_path / mission).write_text(block("yaml"), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    commands = re.findall(r"kybflow (parts nod|run \S+)", TEXT)
    assert commands == ["parts nod", f"run {mission}"]
    for command in commands:
        done = subprocess.run(
            [sys.executable, "-m", "kybflow", *command.split()],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
