"""CONTRIBUTING.md's recipes for a behavior, a supervisor and a check, done as written,
each in a copy of the package."""

import re
import shutil
from pathlib import Path

import pytest
from pages import blocks, page, section
from toolchain import ROOT, program

PAGE = page("CONTRIBUTING.md")
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


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for folder in ("bench", "docs", "kybflow", "missions", "schemas", "tests"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def do(copy: Path, module: str, *words: str) -> None:
    """Run a module as the text says, in the copy."""
    done = program(*words, module=module, cwd=copy, path=[copy])
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_five_minutes_are_true(copy: Path):
    text = section(PAGE, "Add a behavior in five minutes")
    [part] = re.findall(r"Write the file\*\* `(.*?)`", text)
    [mission] = re.findall(r"Fly it\*\* in `(.*?)`", text)
    (copy / part).write_text(blocks(text, "python")[0], encoding="utf-8")
    (copy / mission).write_text(blocks(text, "yaml")[0], encoding="utf-8")
    commands = re.findall(r"kybflow (parts nod|run \S+|\w+ --write [\w/.]+)", text)
    assert commands == [
        "parts nod",
        f"run {mission}",
        "schema --write schemas/mission.schema.json",
        "parts --write docs/parts.md",
    ]
    for command in commands:
        do(copy, "kybflow", *command.split())
    tests = ["tests/parts/test_part_contract.py", "tests/dsl", "tests/flown/test_missions.py"]
    tests.append("tests/cli/printing/test_reference.py")
    do(copy, "pytest", "-q", "-k", "nod or current", *tests)


def test_a_supervisor_is_one_file(copy: Path):
    text = section(PAGE, "Add a supervisor")
    [part] = re.findall(r"`(kybflow/\S+\.py)`", text)
    (copy / part).write_text(blocks(text, "python")[0], encoding="utf-8")
    commands = re.findall(r"kybflow (\w+ --write [\w/.]+)", text)
    assert len(commands) == 2
    for command in commands:
        do(copy, "kybflow", *command.split())
    tests = ["tests/parts", "tests/dsl/test_schema.py", "tests/cli/printing/test_reference.py"]
    do(copy, "pytest", "-q", "-k", "ceiling or current", *tests)


def test_a_check_is_one_file_and_its_page(copy: Path):
    text = section(PAGE, "Add a check")
    [check] = re.findall(r"`(kybflow/\S+\.py)`", text)
    (copy / check).write_text(blocks(text, "python")[0], encoding="utf-8")
    names = copy / "tests" / "dsl" / "literate" / "names.md"
    names.write_text(LITERATE, encoding="utf-8")
    do(copy, "tests.dsl.test_literate", names.name)
    assert "warning[KYB119]: the vehicle `up` has the name" in names.read_text(encoding="utf-8")
    [command] = re.findall(r"kybflow (explain --write [\w/.]+)", text)
    do(copy, "kybflow", *command.split())
    tests = ["tests/dsl/test_literate.py", "tests/dsl/test_explain.py"]
    do(copy, "pytest", "-q", "-k", "KYB119 or codes or explain", *tests)
