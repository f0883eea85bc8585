"""The shipped mission of three AR.Drones meets its expectations on emulated ones, which the driver
for real drones flies."""

from __future__ import annotations

from pathlib import Path

import pytest
from toolchain import MISSIONS, compiled, flight_of, with_library

from kybflow.api.flight import RunRequest, fly

MISSION = MISSIONS / "three_ardrones.yaml"


pytestmark = pytest.mark.thorough


@pytest.mark.parametrize("seed", [0, 1])
def test_it_meets_its_expectations_on_emulated_drones(seed: int, tmp_path: Path) -> None:
    plan = compiled(MISSION, target="emulated_ardrone")
    flown = fly(plan, RunRequest(seed=seed, out=tmp_path))
    assert [e for e in flown.summary["expectations"] if not e["held"]] == []
    assert flown.summary["outcome"] == "succeeded"


CUT = "\nfaults:\n  - {{at: 25 s, on: a, inject: link_cut, for: {lasts}}}\n"


@pytest.mark.parametrize(
    ("lasts", "last_of_a"), [("1 s", ["turn", "hover", "down", "landed"]), ("100 s", ["fault"])]
)
def test_who_loses_its_wifi_hovers_or_lands_and_the_others_finish(
    lasts: str, last_of_a: list[str], tmp_path: Path
) -> None:
    plan = compiled(
        with_library(tmp_path) / "cut.yaml",
        MISSION.read_text(encoding="utf-8") + CUT.format(lasts=lasts),
        target="emulated_ardrone",
        warns=True,
    )
    _, told = flight_of(plan, tmp_path / "run")
    ways: dict[str, list[object]] = {name: [] for name in "abc"}
    for event in told:
        if event.name == "behavior_started":
            ways[event.vehicle].append(event.fields["behavior"])
    assert ways["a"][-len(last_of_a) :] == last_of_a
    assert ways["b"] == ways["c"] == ["landed", "up", "hover", "turn", "hover", "down", "landed"]
