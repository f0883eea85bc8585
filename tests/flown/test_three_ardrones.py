"""The shipped mission of three AR.Drones meets its expectations on emulated ones, which the driver
for real drones flies."""

from __future__ import annotations

from pathlib import Path

import pytest

from kybflow.api.flight import RunRequest, fly
from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog

MISSION = Path(__file__).parents[2] / "missions" / "three_ardrones.yaml"


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, 1])
def test_it_meets_its_expectations_on_emulated_drones(seed: int, tmp_path: Path) -> None:
    result = compile_mission(MISSION, catalog=load_catalog(), target="emulated_ardrone", sets=())
    assert result.diagnostics == ()
    assert result.plan is not None
    flown = fly(result.plan, RunRequest(seed=seed, out=tmp_path))
    assert [e for e in flown.summary["expectations"] if not e["held"]] == []
    assert flown.summary["outcome"] == "succeeded"
