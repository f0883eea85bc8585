"""A vehicle that knows where it is from an IMU and five positions a second."""

from __future__ import annotations

from pathlib import Path

import pytest
from pages import blocks, page
from plans import part
from short_flights import hovers, named, path
from toolchain import compiled, succeeds, with_library

from kybflow.dsl.plan import EstimatorPlan


@pytest.mark.thorough
def test_it_hovers_within_what_the_positions_are_good_for(run):
    source = part("estimators", "fusion", source="position")
    driver = part("drivers", "sim", position_noise=0.05, position_noise_up=0.08)
    estimators = (EstimatorPlan(source, recover_after=1.0),)
    flown, told = run(hovers(height=1.0, estimators=estimators, driver=driver))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    [stream] = [
        e for e in named(told, "preflight_passed") if e.fields["check"] == "position stream"
    ]
    assert stream.fields["found"] == "5 Hz"
    off = flown.summary["vehicles"]["a"]["behaviors"][1]["position_error_m"]
    assert off["max"] < 0.25
    assert off["mean"] == pytest.approx(0.07, abs=0.06)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "seed",
    [
        18,
        pytest.param(2, marks=pytest.mark.thorough),
        *(pytest.param(s, marks=pytest.mark.slow) for s in range(20) if s not in (2, 18)),
    ],
)
def test_the_mission_of_the_page_flies_as_well_as_it_says(seed: int, tmp_path: Path) -> None:
    """docs/estimators.md, with the simulator's own noise: 30 cm, 50 cm in height."""
    [text] = [text for text in blocks(page("docs/estimators.md")) if "mission:" in text]
    plan = compiled(with_library(tmp_path) / "outdoors.yaml", text)
    flown, told = succeeds(plan, tmp_path / "run", seed=seed)
    assert path(told, "nano") == ["up", "away", "hold", "down", "landed"]
    assert not named(told, "failsafe_started")
    [start] = [e for e in named(told, "preflight_passed") if e.fields["check"] == "start pose"]
    assert "m allowed, 3 times its spread)" in str(start.fields["found"])
    off = [b["position_error_m"] for b in flown.summary["vehicles"]["nano"]["behaviors"][:4]]
    assert max(error["max"] for error in off) < 1.5
    assert 0.2 < sum(error["mean"] for error in off) / 4 < 1.0
