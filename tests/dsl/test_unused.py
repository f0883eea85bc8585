"""What counts as a use of a name that a mission gives: whatever may be one."""

from __future__ import annotations

from pathlib import Path

import pytest
from toolchain import compiled, result_of

MISSION = """kybflow: 1
mission: m
summary: The pair tight wait pad.
import: {lab: lab.yaml}
parameters:
  way: {type: text, default: calm}
  goal: {type: position, default: [0, 0, 1]}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
  points: {pad: [0, 0, 1]}
groups: {pair: [a]}
stacks:
  calm: {processors: [limit_speed]}
  tight: {processors: [limit_speed]}
vehicles:
  a:
    like: lab.quad
    start: {at: [0, 0, 0]}
    processors: [{stack: $way}, fence]
    behaviors:
      up:   {do: take_off, height: 1 m, then: go}
      go:   {do: fly_to, position: $goal, then: down}
      down: {do: land}
"""
LIBRARY = """library: lab
import: {std: kybflow/airframes}
vehicles:
  quad: {like: std.nano_plus}
stacks:
  loose: {processors: [fence]}
"""


def unused(folder: Path, mission: str = MISSION, *sets: str, library: str = LIBRARY) -> list[str]:
    (folder / "lab.yaml").write_text(library)
    found = result_of(folder / "mission.yaml", mission, sets=sets).diagnostics
    assert {d.code for d in found} <= {"KYB112"}, [d.message for d in found]
    return [d.message.removeprefix("nothing uses the ") for d in found]


def test_a_mention_in_the_summary_is_no_use(tmp_path: Path) -> None:
    assert unused(tmp_path) == ["point `pad`", "group `pair`", "stack `tight`"]


@pytest.mark.parametrize(
    ("setting", "left"),
    [
        ("goal=world.points.pad", ["group `pair`", "stack `tight`"]),
        ("way=tight", ["point `pad`", "group `pair`"]),
    ],
)
def test_what_the_command_line_names_is_used(tmp_path: Path, setting: str, left: list[str]) -> None:
    assert unused(tmp_path, MISSION, setting) == left


def test_what_a_library_names_of_the_mission_is_used(tmp_path: Path) -> None:
    library = LIBRARY.replace("nano_plus}", "nano_plus, home: world.points.pad}")
    assert unused(tmp_path, library=library) == ["group `pair`", "stack `tight`"]


def test_the_resolved_mission_has_no_more_of_them(tmp_path: Path) -> None:
    unused(tmp_path, MISSION)
    path = tmp_path / "mission.yaml"
    plan = compiled(path, sets=("goal=world.points.pad",), warns=True)
    (finding,) = result_of(path, plan.resolved).diagnostics
    assert finding.message == "nothing uses the group `pair`"
