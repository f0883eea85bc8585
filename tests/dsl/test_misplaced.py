"""Values of another kind than the place where they stand: a point that a parameter or the world
brings where a name is needed, `null` for what is needed, a number for a text."""

from __future__ import annotations

from pathlib import Path

import pytest
from toolchain import result_of

from kybflow.dsl.compiler import Result
from kybflow.world.shapes import Sphere

MISSION = """\
kybflow: 1
mission: m
import: {std: kybflow/airframes}
parameters: {goal: {type: position, default: [0, 1, 1]}}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
  points: {pad: [1, 0, 1]}
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up:   {do: take_off, height: 1 m, then: out}
      out:  {do: fly_to, position: world.points.pad, then: back}
      back: {do: fly_to, position: $goal, then: down}
      down: {do: land}
"""
FLOW = "flows: {team: {phases: {one: {run: {a: up}, next: [{after: 9 s, go: two}]}, two: {}}}}\n"


def checked(folder: Path, text: str) -> Result:
    return result_of(folder / "m.yaml", text)


def found(folder: Path, text: str) -> list[tuple[str, str]]:
    """(code, message) of each error."""
    return [(d.code, d.message) for d in checked(folder, text).diagnostics]


def test_without_them_nothing_is_found(tmp_path: Path) -> None:
    assert found(tmp_path, MISSION + FLOW) == []


POINTS = {
    "behavior": "on: [{event: a.behavior_ended, behavior: POINT, do: [{log: it}]}]\n",
    "emit": "on: [{event: a.landed, do: [{emit: POINT}]}]\n",
    "a": "on: [{event: a.landed, do: [{perform: {a: POINT}}]}]\n",
    "begin": FLOW.replace("{phases", "{begin: POINT, phases"),
    "otherwise": FLOW.replace("next: [{after: 9 s, go: two}]", "within: 9 s, otherwise: POINT"),
    "event": FLOW.replace("after: 9 s", "event: POINT"),
}


@pytest.mark.parametrize("point", ["$goal", "world.points.pad"])
@pytest.mark.parametrize("key", POINTS)
def test_a_point_is_no_name(key: str, point: str, tmp_path: Path) -> None:
    message = f"`{key}` must be a name, but this is a point"
    assert found(tmp_path, MISSION + POINTS[key].replace("POINT", point)) == [("KYB103", message)]


@pytest.mark.parametrize("key", ["begin", "airframe"])
def test_a_point_is_no_name_in_a_vehicle(key: str, tmp_path: Path) -> None:
    message = f"`{key}` must be a name, but this is a point"
    text = MISSION.replace("    behaviors:", f"    {key}: $goal\n    behaviors:")
    assert found(tmp_path, text) == [("KYB103", message)]


def test_a_transition_after_null_says_nothing_of_when(tmp_path: Path) -> None:
    text = MISSION.replace("then: down", "next: [{after: null, go: down}]")
    assert found(tmp_path, text) == [("KYB143", "the transition to `down` has no condition")]


@pytest.mark.parametrize(
    ("world", "finding"),
    [
        ("obstacles: {pole: {box: null}}", ("KYB155", "the obstacle `pole` is nothing solid")),
        ("tags: {floor: {grid: null}}", ("KYB380", "the tags `floor` are nothing")),
        ("tags: {floor: {file: null}}", ("KYB380", "the tags `floor` are nothing")),
    ],
)
def test_what_is_null_is_not_there(world: str, finding: tuple[str, str], tmp_path: Path) -> None:
    assert found(tmp_path, MISSION.replace("  points:", f"  {world}\n  points:")) == [finding]


GRID = "tags: {floor: {grid: {family: 36h11, count: [2, 2], size: 9 cm, spacing: null}}}"
BALL = (
    "obstacles: {b: {moving_sphere: {along: [[0, 0, 1], [1, 0, 1]], speed: 1 m/s, radius: null}}}"
)


@pytest.mark.parametrize("world", [GRID, BALL])
def test_a_needed_length_that_is_null_is_told_where_it_stands(world: str, tmp_path: Path) -> None:
    findings = found(tmp_path, MISSION.replace("  points:", f"  {world}\n  points:"))
    assert ("KYB104", "`null` is not a length") in findings
    assert "KYB108" not in {code for code, _ in findings}


def test_a_point_that_is_null_is_unknown(tmp_path: Path) -> None:
    text = MISSION.replace("pad: [1, 0, 1]", "pad: null, dock: [1, 0, 1]")
    codes = [code for code, _ in found(tmp_path, text)]
    assert codes == ["KYB154"]


def test_a_solid_that_is_null_makes_room_for_another_one(tmp_path: Path) -> None:
    pole = "{box: null, sphere: {at: [2, 2, 1], radius: 10 cm}}"
    text = MISSION.replace("  points:", f"  obstacles: {{pole: {pole}}}\n  points:")
    plan = checked(tmp_path, text).plan
    assert plan is not None
    assert plan.obstacles == {"pole": Sphere((2.0, 2.0, 1.0), 0.1)}


def test_a_flow_begins_in_the_first_phase_that_is_there(tmp_path: Path) -> None:
    plan = checked(tmp_path, MISSION + FLOW.replace("{one:", "{none: null, one:")).plan
    assert plan is not None
    assert (plan.flows[0].begin, [*plan.flows[0].phases]) == ("one", ["one", "two"])


def test_a_number_is_no_text_of_a_part(tmp_path: Path) -> None:
    text = MISSION.replace("{do: land}", "{do: land}\n      join: {do: follow, vehicle: 3}")
    message = "`vehicle` must be text, but this is the number `3`"
    assert ("KYB103", message) in found(tmp_path, text)


def test_what_is_wrong_with_the_parts_of_an_unknown_vehicle_is_not_told(tmp_path: Path) -> None:
    targets = "targets: {lab: {b: {driver: automobile}}}\n"
    assert found(tmp_path, MISSION + targets) == [("KYB151", "no vehicle is called `b`")]
