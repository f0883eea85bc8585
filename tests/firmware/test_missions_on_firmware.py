"""Shipped missions, unchanged, on a real autopilot in its own simulator. How well they track is
each mission's own expectation, written for kybflow's simulator: reported with `-rP`, not asked."""

from __future__ import annotations

from pathlib import Path

import pytest
from present import needed
from real_flights import HERE, full_flight, plan_of, shown
from short_flights import named, path
from toolchain import MISSIONS

from kybflow.api.flight import Flown
from kybflow.core.signals import Event
from kybflow.runtime.engine import Engine

pytestmark = pytest.mark.firmware
EIGHT = ["up", "steady", "eight", "down", "landed"]
WAYS = {"figure_eight": EIGHT, "sidestep": ["up", "steady", "aside", "stop", "down", "landed"]}


def report(flight: Flown) -> None:
    for line in flight.summary["expectations"]:
        shown(line["text"], line["value"], line["unit"])


def came_down(told: list[Event], engine: Engine, states: list[str]) -> None:
    """Every vehicle went that way and nothing came between; it stands, and is disarmed."""
    assert not named(told, "failsafe_started", "control_taken", "arming_refused")
    for vehicle in engine.vehicles:
        assert path(told, vehicle.name) == states
        assert vehicle.rests
        assert vehicle.link_out.armed is False


@pytest.mark.parametrize("name", list(WAYS))
def test_an_unchanged_mission_flies(name: str, two: str, tmp_path: Path):
    flight, told, engine = full_flight(plan_of(MISSIONS / f"{name}.yaml", two), tmp_path)
    report(flight)
    came_down(told, engine, WAYS[name])


def test_two_firmwares_fly_the_eight_together(tmp_path: Path):
    needed({1: "px4", 2: "ardupilot"})
    flight, told, engine = full_flight(plan_of(HERE / "two_firmwares.yaml", "both"), tmp_path)
    report(flight)
    came_down(told, engine, EIGHT)


def test_a_courier_that_knows_only_tags_brings_its_parcel(tmp_path: Path):
    """How it comes down is not asked: frames that come late, from a machine that is busy, may make
    a failsafe of it. The simulator's battery runs down from flight to flight until it is started
    anew."""
    needed({1: "ardupilot"})
    flight, told, engine = full_flight(plan_of(MISSIONS / "courier.yaml", "ardupilot"), tmp_path)
    report(flight)
    shown(*(f"{event.name} {event.fields}" for event in named(told, "failsafe_started")))
    assert path(told, "courier")[:5] == ["up", "out", "drop", "back", "down"]
    assert engine.vehicles[0].link_out.armed is False
    assert len(named(told, "payload_released")) == 1
    held = {line["text"]: line["held"] for line in flight.summary["expectations"]}
    assert held["finally courier.payload.releases == 1"]
    assert held["finally distance(courier.payload to world.points.mark) < 15 cm"]
    assert held["finally distance(courier to world.points.pad) < 10 cm"]
