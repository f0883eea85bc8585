"""What flying in formation, with avoidance, costs a tick: less than the tick again, and for each
member no more in a larger formation."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from budget_flights import per_tick
from bytecodes import Bytecodes, needs_repeatable_counts
from toolchain import compiled

from kybflow.dsl.plan import Plan

MISSION = """
kybflow: 1
mission: square
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-9, -9, 0], to: [9, 9, 3]}}}}
hover_limit: 60 s
time_limit: 60 s
groups: {{swarm: [{names}]}}
vehicles:
  v0:
    like: std.nano_plus
    start: {{at: [{edge}, {edge}, 0]}}
    processors: {processors}
    behaviors:
      up:   {{do: take_off, height: 1 m, then: fly}}
      fly:  {{do: {do}, then: down}}
      down: {{do: land}}
"""
HOVER = "hover, for_time: 30 s"
FORMATION = (
    "formation, members: swarm, shape: square, side: 1.1 m, path: [[3, 0, 1.2]], delay: 20 ms"
)
USUAL = "[limit_speed, limit_acceleration, fence, position_error]"
AVOIDING = "[limit_speed, limit_acceleration, avoid_obstacles, fence, position_error]"
SIDE = 1.1
STAGES = (("runtime/behaviors/", "behavior"), ("runtime/", "the rest"))
FROM, FOR, RATE = 8.0, 0.1, 100
"""Seconds: all are in their places, and on their way; Hz."""


def square(rows: int, do: str, processors: str, folder: Path) -> Plan:
    """rows^2 vehicles that start in a square."""
    names, edge = [f"v{i}" for i in range(rows * rows)], -0.5 * SIDE * (rows - 1)
    text = MISSION.format(names=", ".join(names), edge=edge, do=do, processors=processors)
    for i, name in enumerate(names[1:], start=1):
        x, y = edge + SIDE * (i % rows), edge + SIDE * (i // rows)
        text += f"  {name}: {{like: v0, start: {{at: [{x:.2f}, {y:.2f}, 0]}}}}\n"
    plan = compiled(folder / "square.yaml", text, warns=True)
    return dataclasses.replace(plan, control_rate=RATE)


def cost(rows: int, do: str, processors: str, folder: Path) -> Mapping[str, float]:
    counting = Bytecodes(STAGES, "the rest")
    return per_tick(square(rows, do, processors, folder), counting, FROM, FOR, folder / "run")


@needs_repeatable_counts
@pytest.mark.slow
def test_sixteen_cost_less_than_twice_a_tick_and_more_of_them_no_more_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    flights = {"alone": (4, HOVER, USUAL), "few": (4, FORMATION, AVOIDING)}
    flights["many"] = (6, FORMATION, AVOIDING)
    costs = {}
    for name, (rows, do, processors) in flights.items():
        folder = tmp_path / name
        folder.mkdir()
        costs[name] = cost(rows, do, processors, folder)
    alone, few, many = (sum(costs[name].values()) for name in flights)
    assert few < 1.7 * alone
    assert many < 1.1 * few
    assert costs["many"]["behavior"] < 1.03 * costs["few"]["behavior"]
