"""How many bytes a recording takes, a vehicle and second."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from toolchain import compiled

from kybflow.api.flight import RunRequest, fly

MISSIONS = Path(__file__).parent.parent.parent / "missions"
SECONDS = 8.0
"""Then every vehicle lands, which is recorded too. The courier's estimates, which depend on images,
are recorded in every tick, so that it can be replayed: 7 kB a second."""


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("mission", "budget"),
    [("figure_eight", 71_000), ("courier", 89_000)],
)
def test_a_recording_takes_no_more_than_its_budget(
    mission: str, budget: float, tmp_path: Path
) -> None:
    plan = compiled(MISSIONS / f"{mission}.yaml")
    plan = dataclasses.replace(plan, time_limit=SECONDS, expectations=())
    flown = fly(plan, RunRequest(out=tmp_path / "run"))
    seconds = flown.summary["sim_time_s"]
    size = (flown.folder / "log.mcap").stat().st_size
    assert seconds >= SECONDS
    assert size / (seconds * len(plan.vehicles)) <= budget
