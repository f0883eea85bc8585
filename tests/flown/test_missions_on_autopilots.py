"""Shipped missions on emulated autopilots and drones.

On autopilots they fly unchanged: every behavior is reached in order, the vehicles land and are
disarmed. How well they track is each mission's own expectation, written for kybflow's simulator,
and not asked of another's controller; where the parcel falls is. The mission of three AR.Drones
meets its expectations on emulated ones, which the driver for real drones flies.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from short_flights import named, path
from toolchain import MISSIONS, compiled, flight_of, succeeds, with_library

TARGETS = ("emulated_px4", "emulated_ardupilot")
WAYS = {
    "figure_eight": ["up", "steady", "eight", "down", "landed"],
    "sidestep": ["up", "steady", "aside", "stop", "down", "landed"],
    "joystick": ["up", "wait", "hand", "circle", "hand", "down", "landed"],
    "teleoperation": ["up", "wait", "hand", "home", "down", "landed"],
    "courier": ["up", "out", "drop", "back", "down", "landed"],
}
MARKS = {
    ("figure_eight", "emulated_ardupilot"): [pytest.mark.thorough],
    ("courier", "emulated_px4"): [pytest.mark.thorough],
}
"""The tier of each flight; those that aren't named are slow."""


def flights():
    for name in WAYS:
        for target in TARGETS:
            marks = MARKS.get((name, target), [pytest.mark.slow])
            yield pytest.param(name, target, marks=marks, id=f"{name}-{target}")


@pytest.mark.parametrize(("name", "target"), list(flights()))
def test_an_unchanged_mission_flies_on_an_autopilot(name: str, target: str, tmp_path: Path):
    plan = compiled(MISSIONS / f"{name}.yaml", target=target, warns=True)
    flight, told = flight_of(plan, tmp_path)
    for vehicle, record in flight.summary["vehicles"].items():
        assert path(told, vehicle) == WAYS[name]
        assert record["final"] == "ground"
    assert not named(told, "failsafe_started", "control_taken")
    if name == "courier":
        assert [e for e in flight.summary["expectations"] if not e["held"]] == []
        assert flight.summary["outcome"] == "succeeded"


ARDRONES = MISSIONS / "three_ardrones.yaml"


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_three_ardrones_meet_their_expectations(seed: int, tmp_path: Path) -> None:
    succeeds(compiled(ARDRONES, target="emulated_ardrone"), tmp_path, seed=seed)


CUT = "\nfaults:\n  - {{at: 25 s, on: a, inject: link_cut, for: {lasts}}}\n"


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("lasts", "last_of_a"),
    [
        ("1 s", ["turn", "hover", "down", "landed"]),
        pytest.param("100 s", ["fault"], marks=pytest.mark.slow),
    ],
)
def test_who_loses_its_wifi_hovers_or_lands_and_the_others_finish(
    lasts: str, last_of_a: list[str], tmp_path: Path
) -> None:
    mission = with_library(tmp_path) / "cut.yaml"
    text = ARDRONES.read_text(encoding="utf-8") + CUT.format(lasts=lasts)
    plan = compiled(mission, text, target="emulated_ardrone", warns=True)
    _, told = flight_of(plan, tmp_path / "run")
    assert path(told, "a")[-len(last_of_a) :] == last_of_a
    others = ["landed", "up", "hover", "turn", "hover", "down", "landed"]
    assert path(told, "b") == path(told, "c") == others
