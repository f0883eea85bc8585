"""The part in one file, of the page about parts of one's own, flies by its commands and script."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pages import page
from toolchain import ROOT, with_library

PAGE = page("docs/your-own-parts.md").partition("## In your own package")[0]
MISSION = """\
kybflow: 1
mission: mine
import: {std: library/airframes.yaml}
parameters: {tracker: {type: text, default: my_tracker, help: The tracker.}}
world: {fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}}
vehicles:
  a:
    like: std.nano_plus
    tracker: $tracker
    behaviors:
      up: {do: take_off, height: 1 m, then: hold}
      hold: {do: hover, for_time: 2 s, then: down}
      down: {do: land}
"""


@pytest.mark.thorough
def test_the_commands_and_the_comparison_run(tmp_path: Path) -> None:
    (with_library(tmp_path) / "mine.yaml").write_text(MISSION)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    commands = re.findall(r"^    kybflow (.*?)$", PAGE, re.MULTILINE)
    assert len(commands) == 2
    for line in commands:
        words = [sys.executable, "-m", "kybflow", *line.split()]
        subprocess.run(words, check=True, cwd=tmp_path, capture_output=True)
    [script] = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    said = subprocess.check_output([sys.executable, "-c", script], cwd=tmp_path, text=True)
    mine, ours = (line.split() for line in said.splitlines())
    assert (mine[0], ours[0]) == ("my_tracker", "geometric")
    assert 0.0 < float(ours[1]) < float(mine[1]) < 0.1
