"""CONTRIBUTING.md's recipes for a behavior, a supervisor and a check, done as written,
each in a copy of the package."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from toolchain import ROOT

PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
pytestmark = pytest.mark.thorough
LITERATE = """# Names

## KYB119: a vehicle like its behavior

```yaml
kybflow: 1
mission: bad
import: {std: kybflow/airframes}
vehicles:
  up: {like: std.nano_plus, behaviors: {up: {do: take_off, height: 1 m}}}
```

```report
```

```diff
-  up: {like: std.nano_plus, behaviors: {up: {do: take_off, height: 1 m}}}
+  a: {like: std.nano_plus, behaviors: {up: {do: take_off, height: 1 m}}}
```
"""


def section(heading: str) -> str:
    return PAGE.partition(f"## {heading}\n")[2].partition("\n## ")[0]


TEXT = section("Add a behavior in five minutes")


def block(language: str, text: str = TEXT) -> str:
    found = re.search(rf"```{language}\n(.*?)```", text, re.DOTALL)
    assert found is not None
    return found[1]


def copied(home: Path) -> None:
    for folder in ("bench", "docs", "kybflow", "missions", "schemas", "tests"):
        shutil.copytree(ROOT / folder, home / folder)
    shutil.copy(ROOT / "pyproject.toml", home)


def test_the_five_minutes_are_true(tmp_path: Path):
    [part] = re.findall(r"Write the file\*\* `(.*?)`", TEXT)
    [mission] = re.findall(r"Fly it\*\* in `(.*?)`", TEXT)
    copied(tmp_path)
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


def test_a_supervisor_is_one_file(tmp_path: Path):
    text = section("Add a supervisor")
    [part] = re.findall(r"`(kybflow/\S+\.py)`", text)
    copied(tmp_path)
    (tmp_path / part).write_text(block("python", text), encoding="utf-8")
    commands = re.findall(r"kybflow (\w+ --write [\w/.]+)", text)
    assert len(commands) == 2
    for command in commands:
        do(tmp_path, "kybflow", *command.split())
    tests = ["tests/parts", "tests/dsl/test_schema.py", "tests/cli/printing/test_reference.py"]
    do(tmp_path, "pytest", "-q", "-k", "ceiling or current", *tests)


def test_a_check_is_one_file_and_its_page(tmp_path: Path):
    text = section("Add a check")
    [check] = re.findall(r"`(kybflow/\S+\.py)`", text)
    copied(tmp_path)
    (tmp_path / check).write_text(block("python", text), encoding="utf-8")
    page = tmp_path / "tests" / "dsl" / "literate" / "names.md"
    page.write_text(LITERATE, encoding="utf-8")
    python(tmp_path, "tests/dsl/test_literate.py", page.name)
    assert "warning[KYB119]: the vehicle `up` has the name" in page.read_text(encoding="utf-8")
    [command] = re.findall(r"kybflow (explain --write [\w/.]+)", text)
    do(tmp_path, "kybflow", *command.split())
    tests = ["tests/dsl/test_literate.py", "tests/dsl/test_codes.py", "tests/dsl/test_explain.py"]
    do(tmp_path, "pytest", "-q", "-k", "KYB119 or codes or explain", *tests)


def do(folder: Path, *command: str) -> None:
    """Run a module as the text says, in the copy."""
    python(folder, "-m", *command)


def python(folder: Path, *words: str) -> None:
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
