"""The pages about rehearsals and formations: no check finds their missions wrong, and rehearsing
them says what is shown."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

from pages import blocks, page
from toolchain import invoke

from kybflow.api.codes import codes

PAGE = page("docs/rehearsal.md")
[MISSION] = blocks(PAGE)
[REPORT] = re.findall(r"```text\n\$ kybflow rehearse swap.yaml\n(.*?)```", PAGE, re.DOTALL)
[LINE] = [text for text in blocks(page("docs/formations.md")) if text.startswith("kybflow: 1\n")]


def test_its_mission_gets_its_report(tmp_path: Path) -> None:
    (tmp_path / "swap.yaml").write_text(MISSION)
    with contextlib.chdir(tmp_path):
        valid = invoke("validate", "swap.yaml")
        done = invoke("rehearse", "swap.yaml")

    assert valid.output.startswith("swap.yaml: ok (")
    assert (done.exit_code, done.output) == (1, REPORT)


def test_the_formation_is_rehearsed_without_a_finding(tmp_path: Path) -> None:
    (tmp_path / "line.yaml").write_text(LINE)
    with contextlib.chdir(tmp_path):
        done = invoke("rehearse", "line.yaml")

    assert done.exit_code == 0, done.output
    assert re.fullmatch(r"line rehearsed: [^\n]*%\n", done.output)


def test_it_names_every_finding() -> None:
    of_rehearsals = {code for code, one in codes().items() if one.family == "Rehearsals"}

    assert set(re.findall(r"KYB\d{3}", PAGE)) == of_rehearsals
