"""Vehicles that one entry with `count` makes."""

from __future__ import annotations

from pathlib import Path

import pytest
from toolchain import compiled

from kybflow.dsl.plan import Plan

MISSION = """
kybflow: 1
mission: several
import: {std: kybflow/airframes}
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
  points: {dock: [-1, 0, 0]}
groups: {every: [lead, bees], pair: [bees2, lead]}
vehicles:
  lead: {like: bees, start: {at: [0, 2, 0]}}
  bees:
    like: std.nano_plus
    COUNT
    start: {heading: 90 deg}
    behaviors: {up: {do: take_off, height: 1 m, next: [{when: bees1.state.altitude > 80 cm, go: brake}]}}
expect: [always distance(lead to world.points.dock) > 1 cm, always separation(every) > 20 cm, always separation(pair) > 20 cm]
"""  # noqa: E501


def made(tmp_path: Path, keys: str) -> Plan:
    path = tmp_path / "mission.yaml"
    path.write_text(MISSION.replace("COUNT", keys), encoding="utf-8")
    return compiled(path)


@pytest.mark.parametrize(
    ("keys", "starts"),
    [
        (
            "count: 3\n    starts: {line: {from: world.points.dock, to: [1, 1, 0]}}",
            [(-1.0, 0.0, 0.0), (0.0, 0.5, 0.0), (1.0, 1.0, 0.0)],
        ),
        (
            "count: 3\n    starts: {grid: {at: [-1, -1, 0], columns: 2, spacing: 80 cm}}",
            [(-1.0, -1.0, 0.0), (-0.2, -1.0, 0.0), (-1.0, -0.2, 0.0)],
        ),
        (
            "count: 4\n    starts: {circle: {at: [0, 0, 0], radius: 1 m}}",
            [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, -1.0, 0.0)],
        ),
        (
            "starts: {points: [[1, 0, 0], world.points.dock]}",
            [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)],
        ),
    ],
)
def test_starts(tmp_path: Path, keys: str, starts: list[tuple[float, float, float]]) -> None:
    plan = made(tmp_path, keys)
    names = tuple(f"bees{number}" for number in range(1, len(starts) + 1))
    assert ["lead", *names] == [vehicle.name for vehicle in plan.vehicles]
    assert starts == [plan.fleet[name].start for name in names]
    assert len({vehicle.heading for vehicle in plan.vehicles}) == 1
    assert plan.members("bees") == names
    assert plan.members("every") == ("lead", *names)
    assert plan.members("pair") == ("bees2", "lead")


def test_the_resolved_mission_has_them_one_by_one(tmp_path: Path) -> None:
    plan = made(tmp_path, "count: 3\n    starts: {line: {from: [-1, 0, 0], to: [1, 0.1, 0]}}")
    resolved = tmp_path / "resolved.yaml"
    resolved.write_text(plan.resolved, encoding="utf-8")
    again = compiled(resolved, warns=True)  # of the group, which nothing uses here
    assert [v.start for v in again.vehicles] == [v.start for v in plan.vehicles]
    assert again.groups == plan.groups
