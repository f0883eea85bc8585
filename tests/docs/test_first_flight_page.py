"""docs/first-flight.md is true: what it flies in simulated time is flown as written; of the blocks
that need a second terminal, the refusals and parameters that they show are those of the driver."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from test_tutorial import FENCE, commands, pattern, ran
from toolchain import ROOT

from kybflow.drivers.mavlink.firmware import profile_of

PAGE = ROOT / "docs" / "first-flight.md"
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.mark.thorough
def test_what_the_page_flies_flies(tmp_path: Path):
    wrong = []
    for language, terminal, text in FENCE.findall(TEXT):
        if language != "console" or terminal:
            continue
        for command, code, output in commands(text):
            done = ran(command, tmp_path)
            said = done.stdout + done.stderr
            if done.returncode != code or not pattern(output).fullmatch(said):
                wrong.append((command, done.returncode, said))
    assert wrong == []


def test_the_page_shows_parameters_as_they_are():
    """Each line of a table of `kybflow mavlink setup` ends with the reason that the driver has."""
    known = {setting.name: setting.why for setting in profile_of("px4").indoors}
    lines = re.findall(
        r"^([A-Z0-9]+_[A-Z0-9_]+) .*(?:WRONG|written|right)  (.*)$", TEXT, re.MULTILINE
    )
    assert len(lines) >= 3
    assert [name for name, why in lines if known.get(name) != why] == []


def test_the_page_shows_a_danger_as_it_is():
    [shown] = re.findall(r"^RED +nano +watchdog .*\n +(.*)$", TEXT, re.MULTILINE)
    [said] = profile_of("px4").dangers_in({"COM_OBL_RC_ACT": 0.0}, 245, indoors=True).values()
    assert shown == said
