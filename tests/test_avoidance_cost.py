"""What avoiding others costs: in proportion to those that are near, and less than a tick again."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import pytest
from budget_flights import fleet, per_tick
from bytecodes import Bytecodes, needs_repeatable_counts

from kybflow.dsl.plan import PartPlan, Plan
from kybflow.runtime.processors.avoid_obstacles import AvoidObstacles, AvoidObstaclesParams

STAGES = (
    ("runtime/processors/", "avoiding"),
    ("flight/avoidance/", "avoiding"),
    ("runtime/", "the rest"),
)
PART = PartPlan("avoid_obstacles", AvoidObstacles, AvoidObstaclesParams(), "processors.avoiding")


def in_rows(spacing: float, *, avoiding: bool) -> Plan:
    """Sixteen that fly eights in four rows."""
    plan = fleet(16)
    vehicles = tuple(
        dataclasses.replace(
            vehicle,
            start=(spacing * (index % 4), spacing * (index // 4), 0.0),
            supervisors=tuple(s for s in vehicle.supervisors if s.name != "proximity"),
            processors=(*vehicle.processors, *((PART,) if avoiding else ())),
        )
        for index, vehicle in enumerate(plan.vehicles)
    )
    return dataclasses.replace(plan, vehicles=vehicles)


@needs_repeatable_counts
@pytest.mark.slow
def test_sixteen_cost_less_than_twice_a_tick_and_those_far_away_nearly_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    costs = {}
    for spacing, avoiding in ((1.1, False), (1.1, True), (3.0, True)):
        plan = in_rows(spacing, avoiding=avoiding)
        out = tmp_path / f"{spacing} {avoiding}"
        counts = per_tick(plan, Bytecodes(STAGES, "the rest"), 9.0, 0.1, out)
        costs[spacing, avoiding] = sum(counts.values())
    without = costs[1.1, False]
    assert costs[1.1, True] < 1.5 * without
    assert costs[3.0, True] < 1.12 * without
