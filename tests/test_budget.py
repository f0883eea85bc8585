"""What a tick may cost, in bytecodes a vehicle, stage by stage.

A change that adds more than 3 % to a stage raises the budget below in the same commit and says why;
one that saves lowers it, so that the next can't spend what was saved.
"""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import pytest
from bytecodes import Bytecodes, needs_repeatable_counts, off_budget

from kybflow.api.flight import RunRequest, fly
from kybflow.dsl.compiler import compile_mission
from kybflow.dsl.plan import Plan
from kybflow.parts.catalog import load_catalog
from kybflow.runtime.engine import Engine

MISSION = Path(__file__).parent.parent / "missions" / "figure_eight.yaml"
FROM, FOR = 9.0, 0.4
"""Seconds: in the middle of the eight, with 48 measurements of motion capture."""
STAGES = (
    ("drivers/", "simulator"),
    ("recording/", "recorder"),
    ("runtime/estimators/", "estimator"),
    ("runtime/behaviors/", "behavior"),
    ("runtime/processors/", "processors"),
    ("runtime/trackers/", "tracker"),
    ("runtime/supervisors/", "supervisors"),
    ("runtime/", "engine and vehicle"),
)
BUDGET = {
    1: {
        "simulator": 3248,
        "engine and vehicle": 1502,
        "tracker": 979,
        "estimator": 724,
        "processors": 326,
        "behavior": 372,
        "recorder": 225,
        "supervisors": 81,
    },
    8: {
        "simulator": 2890,
        "engine and vehicle": 1333,
        "tracker": 979,
        "estimator": 724,
        "processors": 326,
        "behavior": 372,
        "recorder": 224,
        "supervisors": 103,
    },
}
"""Bytecodes a vehicle and tick, by the number of vehicles, in a plain install. The simulator's are
a third rotors and IMU, which MuJoCo no longer computes."""


def fleet(count: int) -> Plan:
    """`count` of the figure eight's first vehicle, three metres apart."""
    plan = compile_mission(MISSION, catalog=load_catalog(), sets=("lap=10s",)).plan
    assert plan is not None
    first = plan.vehicles[0]
    vehicles = tuple(
        dataclasses.replace(first, name=f"v{index}", start=(3.0 * index, 0.0, 0.0))
        for index in range(count)
    )
    return dataclasses.replace(
        plan, vehicles=vehicles, fence=None, expectations=(), time_limit=FROM + FOR + 0.1
    )


class Counted:
    """An observer that counts from `FROM` on, for `FOR` seconds."""

    def __init__(self) -> None:
        self.bytecodes = Bytecodes(STAGES, "engine and vehicle")
        self._began: float | None = None
        self.ticks = 0

    def __call__(self, engine: Engine) -> None:
        now = engine.seconds()
        if self._began is None and now >= FROM:
            self._began = now
            self.bytecodes.start()
        elif self._began is not None and not self.ticks and now >= self._began + FOR - 1e-6:
            self.bytecodes.stop()
            self.ticks = round((now - self._began) * engine.plan.control_rate)


@needs_repeatable_counts
@pytest.mark.parametrize("count", BUDGET)
def test_a_tick_stays_within_its_budget(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "kybflow.drivers.sim.compiled", None)
    counted = Counted()
    fly(fleet(count), RunRequest(out=tmp_path / "run"), observers=(counted,))
    found = {
        stage: number / counted.ticks / count for stage, number in counted.bytecodes.counts.items()
    }

    lines = off_budget(found, BUDGET[count])
    assert not lines, "\n".join(["", *lines])
