"""Flows that start from another, of a library or of the mission: what they leave in the plan, what
is shown of them, that one flies."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from toolchain import compiled, invoke, result_of

from kybflow.api.flight import RunRequest, fly
from kybflow.dsl.plan import FlowPlan, Plan, Request
from kybflow.dsl.resolving.resolve import MAX_AFTER_LIKE

HERE = Path(__file__).parent
SHARED = HERE / "good" / "shared_flow.yaml"
PAGE = (HERE.parents[1] / "docs" / "mission-language.md").read_text(encoding="utf-8")
LAB = """
library: lab
import: {basis: basis.yaml}
parameters: {limit: {type: duration, default: 20 s}, place: {type: text, default: hover}}
flows:
  hop:
    phases:
      launch: {run: {swarm: up}, next: [{when: all swarm in $place, go: near}],
               within: $limit, otherwise: land}
      near:   {next: [{when: distance(a to world.points.dock) < 3 m, go: land}],
               within: 5 s, otherwise: land}
      land:   {run: {swarm: down}, arrive: in_turns}
  ends: {like: basis.ends, phases: {over: {next: [{after: 2 s, go: end}]}}}
"""
BASIS = """
library: basis
flows: {ends: {phases: {over: {run: {c: up}, next: [{after: 1 s, go: end}]}}}}
"""
MISSION = """
kybflow: 1
mission: m
import: {std: kybflow/airframes, lab: LAB}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}, points: {dock: [1, 0, 1]}}
groups: {swarm: [a, b]}
vehicles:
  a:
    like: std.nano_plus
    behaviors: {up: {do: take_off, height: 1 m, then: hover}, down: {do: land}}
  b: {like: a, start: {at: [1, 1, 0]}}
  c: {like: a, start: {at: [1, -1, 0]}}
flows:
"""


def plan_of(folder: Path, flows: str, lab: str = "lab.yaml") -> Plan:
    (folder / "lab.yaml").write_text(LAB)
    (folder / "basis.yaml").write_text(BASIS)
    return compiled(folder / "mission.yaml", MISSION.replace("LAB", lab) + flows)


def arrows(flow: FlowPlan, phase: str) -> list[tuple[str, str, float | None]]:
    return [(t.cause, t.target, t.after) for t in flow.phases[phase].transitions]


def test_a_flow_of_a_library_is_about_the_vehicles_of_the_mission(tmp_path: Path) -> None:
    (team,) = plan_of(tmp_path, "  team: {like: lab.hop}\n").flows
    assert (team.name, team.begin, team.vehicles) == ("team", "launch", ("a", "b"))
    assert team.phases["launch"].run == {"a": Request("up"), "b": Request("up")}
    assert arrows(team, "launch") == [("next", "near", None), ("within", "land", 20.0)]


def test_mappings_merge_lists_are_replaced_null_removes(tmp_path: Path) -> None:
    flows = """
  team:
    like: lab.hop
    begin: first
    phases:
      first:  {run: {a: up}, next: [{after: 4 s, go: launch}]}
      launch: {run: {swarm: null, b: up}, next: [{when: b in hover, go: land}]}
      near:   null
"""
    (team,) = plan_of(tmp_path, flows).flows
    assert (team.begin, list(team.phases)) == ("first", ["launch", "land", "first"])
    assert team.phases["launch"].run == {"b": Request("up")}
    assert arrows(team, "launch") == [("next", "land", None), ("within", "land", 20.0)]


def test_a_flow_may_be_like_one_of_the_mission_or_of_an_import_of_the_library(
    tmp_path: Path,
) -> None:
    flows = """
  team:  {phases: {up: {run: {a: up}, next: [{after: 5 s, go: down}]}, down: {run: {a: down}}}}
  other: {like: team, phases: {up: {run: {a: null, b: up}}, down: {run: {a: null, b: down}}}}
  solo:  {like: lab.ends}
"""
    team, other, solo = plan_of(tmp_path, flows).flows
    assert (team.vehicles, other.vehicles, solo.vehicles) == (("a",), ("b",), ("c",))
    assert arrows(other, "up") == [("next", "down", 5.0)]
    assert arrows(solo, "over") == [("next", "end", 2.0)]


def test_an_import_gives_values_for_the_parameters_of_the_library(tmp_path: Path) -> None:
    lab = "{from: lab.yaml, with: {limit: 7 s, place: up}}"
    (team,) = plan_of(tmp_path, "  team: {like: lab.hop}\n", lab).flows
    assert arrows(team, "launch")[-1] == ("within", "land", 7.0)
    assert "state='up'" in str(team.phases["launch"].transitions[0].when)


def test_a_flow_of_a_library_may_give_to_one_of_the_mission(tmp_path: Path) -> None:
    flows = """
  team:
    like: lab.hop
    phases:
      near: {give: {a: solo}, next: [{event: solo.finished, go: land}],
             within: null, otherwise: null}
  solo: {phases: {over: {run: {a: hover}, next: [{after: 1 s, go: end}]}}}
"""
    team, solo = plan_of(tmp_path, flows).flows
    assert team.phases["near"].give == {"a": "solo"}
    assert solo.waits


def test_too_much_through_like_is_refused(tmp_path: Path) -> None:
    phases = "".join(f"      p{i}: {{run: {{a: up}}}}\n" for i in range(1000))
    count = MAX_AFTER_LIKE // 3000 + 1
    like = "".join(f"  f{i}: {{like: f}}\n" for i in range(count))
    text = MISSION.replace(", lab: LAB", "").replace(", points: {dock: [1, 0, 1]}", "")
    text = f"{text}  f:\n    phases:\n{phases}{like}"
    (finding,) = result_of(tmp_path / "mission.yaml", text).diagnostics
    assert finding.code == "KYB126"


def test_show_resolved_says_where_each_phase_came_from() -> None:
    result = invoke("show", SHARED, "--resolved")
    line = r"^ +(\w+): \{(?:run|give|set|next).*# .*?(\w+\.yaml):\d+(, within from \S+)?$"
    found = re.findall(line, result.output, re.M)
    lines = {phase: file for phase, file, _ in found}
    own, library = "shared_flow.yaml", "flows.yaml"
    assert lines == {"launch": library, "gather": own, "hold": library, "land": library}
    assert "within: 15 s" in result.output


def test_what_is_shown_reads_back_as_the_same_flows(tmp_path: Path) -> None:
    plan = compiled(SHARED)
    again = compiled(tmp_path / "mission.yaml", plan.resolved)
    assert [summary(f) for f in again.flows] == [summary(f) for f in plan.flows]


def summary(flow: FlowPlan) -> object:
    phases = {name: (phase.run, arrows(flow, name)) for name, phase in flow.phases.items()}
    return flow.name, flow.begin, flow.vehicles, phases


def test_kybflow_library_lists_and_shows_flows() -> None:
    assert re.search(r"^  flows +hold_formation$", invoke("library").output, re.M)
    text = invoke("library", "hold_formation").output
    assert text.startswith("# flow of kybflow/flows\nhold_formation:")
    assert text.rstrip().endswith("land:   {run: {swarm: down}}")


def test_the_example_of_the_page_is_valid(tmp_path: Path) -> None:
    (text,) = (t for t in re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.S | re.M) if "shared." in t)
    room = "world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}\n"
    compiled(tmp_path / "mission.yaml", f"kybflow: 1\nmission: example\n{room}{text}")


@pytest.mark.parametrize(
    ("late", "phases"),
    [("12 s", ["launch", "gather", "hold", "land"]), ("1 s", ["launch", "gather", "land"])],
)
def test_the_flow_of_the_library_flies(late: str, phases: list[str], tmp_path: Path) -> None:
    plan = compiled(SHARED, sets=[f"meet={late}"])
    summary = fly(plan, RunRequest(out=tmp_path / "run")).summary
    assert summary["outcome"] == "succeeded"
    assert [visit["name"] for visit in summary["flows"]["team"]["phases"]] == phases


@pytest.mark.parametrize(
    ("written", "means"),
    [("{}", "in_turns"), ("{arrive: null}", None), ("{arrive: $how}", "in_turns")],
)
def test_how_vehicles_arrive_is_merged_and_removed_as_every_key_is(
    tmp_path: Path, written: str, means: str | None
) -> None:
    how = "parameters: {how: {type: text, default: in_turns}}\n" if "$" in written else ""
    plan = plan_of(tmp_path, f"  team: {{like: lab.hop, phases: {{land: {written}}}}}\n{how}")
    assert plan.flows[0].phases["land"].arrive == means
