"""The page about rehearsals: no check finds its mission wrong, and its report is as shown."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

from toolchain import ROOT, invoke

from kybflow.api.codes import codes

PAGE = (ROOT / "docs" / "rehearsal.md").read_text(encoding="utf-8")
[MISSION] = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
[REPORT] = re.findall(r"```text\n\$ kybflow rehearse swap.yaml\n(.*?)```", PAGE, re.DOTALL)


def test_its_mission_gets_its_report(tmp_path: Path) -> None:
    (tmp_path / "swap.yaml").write_text(MISSION)
    with contextlib.chdir(tmp_path):
        valid = invoke("validate", "swap.yaml")
        done = invoke("rehearse", "swap.yaml")

    assert valid.output.startswith("swap.yaml: ok (")
    assert (done.exit_code, done.output) == (1, REPORT)


def test_it_names_every_finding() -> None:
    of_rehearsals = {code for code, one in codes().items() if one.family == "Rehearsals"}

    assert set(re.findall(r"KYB\d{3}", PAGE)) == of_rehearsals
