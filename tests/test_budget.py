"""What a tick may cost, in bytecodes a vehicle, stage by stage.

A change that adds more than 3 % to a stage raises the budget below in the same commit and says why;
one that saves lowers it, so that the next can't spend what was saved.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from budget_flights import fleet, per_tick
from bytecodes import Bytecodes, needs_repeatable_counts, off_budget

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
        "simulator": 8508,
        "engine and vehicle": 2336,
        "tracker": 1871,
        "estimator": 1866,
        "processors": 384,
        "behavior": 348,
        "recorder": 432,
        "supervisors": 542,
    },
    8: {
        "simulator": 8065,
        "engine and vehicle": 2130,
        "tracker": 1871,
        "estimator": 1859,
        "processors": 384,
        "behavior": 348,
        "recorder": 414,
        "supervisors": 603,
    },
}
"""Bytecodes a vehicle and tick, by the number of vehicles, in a plain install, at 125 ticks and 500
physics steps a second. The simulator's are a third rotors and IMU, which MuJoCo does not compute,
and a quarter the lab: what its air does, filters, delays and vibration. The tracker has a
disturbance observer, for which the IMU is read and recorded, and by which the estimator levels and
times its poses. The engine tells the frame check whether the autopilot lands. In every fourth tick
the recorder writes what viewers draw.
"""


@needs_repeatable_counts
@pytest.mark.parametrize("count", [1, pytest.param(8, marks=pytest.mark.thorough)])
def test_a_tick_stays_within_its_budget(
    count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    bytecodes = Bytecodes(STAGES, "engine and vehicle")
    found = per_tick(fleet(count), bytecodes, FROM, FOR, tmp_path / "run")
    lines = off_budget(found, BUDGET[count])
    assert not lines, "\n".join(["", *lines])
