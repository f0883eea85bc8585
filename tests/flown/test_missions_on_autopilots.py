"""Shipped missions, unchanged, on emulated autopilots: every behavior is reached in order, the
vehicles land and are disarmed. How well they track is each mission's own expectation, written for
kybflow's simulator, and not asked of another's controller; where the parcel falls is."""

from __future__ import annotations

from pathlib import Path

import pytest
from toolchain import MISSIONS, compiled, flight_of

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
    ("joystick", "emulated_px4"): [pytest.mark.thorough],
    ("teleoperation", "emulated_ardupilot"): [pytest.mark.thorough],
}
"""The tier of each flight; those that aren't named are slow."""


def mission_flight(name: str, target: str, out: Path):
    plan = compiled(MISSIONS / f"{name}.yaml", target=target, warns=True)
    return flight_of(plan, out)


def flights():
    for name in WAYS:
        for target in TARGETS:
            marks = MARKS.get((name, target), [pytest.mark.slow])
            yield pytest.param(name, target, marks=marks, id=f"{name}-{target}")


@pytest.mark.parametrize(("name", "target"), list(flights()))
def test_an_unchanged_mission_flies_on_an_autopilot(name: str, target: str, tmp_path: Path):
    flight, told = mission_flight(name, target, tmp_path)
    for vehicle, record in flight.summary["vehicles"].items():
        way = [
            event.fields["behavior"]
            for event in told
            if event.name == "behavior_started" and event.vehicle == vehicle
        ]
        assert way == WAYS[name]
        assert record["final"] == "ground"
    assert not [event for event in told if event.name in {"failsafe_started", "control_taken"}]
    if name == "courier":
        assert [e for e in flight.summary["expectations"] if not e["held"]] == []
        assert flight.summary["outcome"] == "succeeded"
