"""A vehicle that knows where it is from an IMU and five positions a second."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from plans import part, vehicle
from short_flights import down, hold, named, path, up
from toolchain import ROOT, compiled, flight_of

from kybflow.dsl.plan import EstimatorPlan


def test_it_hovers_within_what_the_positions_are_good_for(run):
    source = part("estimators", "fusion", source="position")
    driver = part("drivers", "sim", position_noise=0.05, position_noise_up=0.08)
    flier = vehicle(
        "a",
        [up("hold", 1.0), hold(4.0, "down"), down()],
        estimators=(EstimatorPlan(source, recover_after=1.0),),
        driver=driver,
    )
    flown, told = run(flier)
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    [stream] = [
        e for e in named(told, "preflight_passed") if e.fields["check"] == "position stream"
    ]
    assert stream.fields["found"] == "5 Hz"
    off = flown.summary["vehicles"]["a"]["behaviors"][1]["position_error_m"]
    assert off["max"] < 0.25
    assert off["mean"] == pytest.approx(0.07, abs=0.06)


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
    page = (ROOT / "docs" / "estimators.md").read_text(encoding="utf-8")
    [text] = [t for t in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL) if "mission:" in t]
    shutil.copytree(ROOT / "missions" / "library", tmp_path / "library")
    plan = compiled(tmp_path / "outdoors.yaml", text)
    flown, told = flight_of(plan, tmp_path / "run", seed=seed)
    assert flown.summary["outcome"] == "succeeded", flown.summary["reason"]
    assert path(told, "nano") == ["up", "away", "hold", "down", "landed"]
    assert not named(told, "failsafe_started")
    [start] = [e for e in named(told, "preflight_passed") if e.fields["check"] == "start pose"]
    assert "m allowed, 3 times its spread)" in str(start.fields["found"])
    off = [b["position_error_m"] for b in flown.summary["vehicles"]["nano"]["behaviors"][:4]]
    assert max(error["max"] for error in off) < 1.5
    assert 0.2 < sum(error["mean"] for error in off) / 4 < 1.0
