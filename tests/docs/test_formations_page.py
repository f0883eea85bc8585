"""The page about formations: its mission flies as it says, and nothing goes wrong in it."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

from toolchain import ROOT, invoke

PAGE = (ROOT / "docs" / "formations.md").read_text(encoding="utf-8")
[MISSION] = re.findall(r"```yaml\n(kybflow: 1\n.*?)```", PAGE, re.DOTALL)


def test_its_mission_is_rehearsed_without_a_finding(tmp_path: Path) -> None:
    (tmp_path / "line.yaml").write_text(MISSION)
    with contextlib.chdir(tmp_path):
        done = invoke("rehearse", "line.yaml")

    assert done.exit_code == 0, done.output
    assert re.fullmatch(r"line rehearsed: [^\n]*%\n", done.output)
