"""What a real autopilot in its own simulator refuses, and that it is told in its own words."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from real_flights import Room, full_flight, plan_of, shown
from short_flights import named
from toolchain import MISSIONS

from kybflow.cli.commands.mavlink.meeting import ticks
from kybflow.drivers.mavlink.discovery import Discovery
from kybflow.drivers.mavlink.firmware import profile_of
from kybflow.drivers.mavlink.link import AutopilotLink
from kybflow.drivers.mavlink.transport.sockets import open_wire
from kybflow.dsl.plan import Plan

pytestmark = pytest.mark.firmware
SIDESTEP = MISSIONS / "sidestep.yaml"
UNPREPARED = {
    "px4": {"EKF2_EVP_NOISE": 0.1, "COM_OBL_RC_ACT": 0.0},
    "ardupilot": {"GUID_TIMEOUT": 2.0, "FS_GCS_ENABLE": 0.0},
}


@contextmanager
def parameters_of(autopilot: str, system: int, values: dict[str, float]) -> Iterator[None]:
    """Other parameters in one autopilot, put back afterwards."""
    before = _written(autopilot, system, values)
    try:
        yield
    finally:
        _written(autopilot, system, before)


def _written(autopilot: str, system: int, values: dict[str, float]) -> dict[str, float]:
    """What they were before."""
    profile, steps = profile_of(autopilot), ticks()
    with closing(open_wire(profile.default_address(system))) as wire:
        discovery = Discovery(wire, system, 245)
        discovery.find(steps)
        before = dict(discovery.settle(system, profile, steps, values).values)
        discovery.settle(system, profile, steps, values, values)
    return before


def by_position(plan: Plan) -> Plan:
    """The plan with the autopilot's own position controller."""
    vehicles = []
    for v in plan.vehicles:
        params = dataclasses.replace(v.tracker.params, by="position")
        vehicles.append(
            dataclasses.replace(v, tracker=dataclasses.replace(v.tracker, params=params))
        )
    return dataclasses.replace(plan, vehicles=tuple(vehicles))


def failures(told) -> dict[tuple[str, str], str]:
    """The reasons of the preflight, by vehicle and check."""
    found = {}
    for event in named(told, "preflight_failed"):
        found[event.vehicle, str(event.fields["check"])] = str(event.fields["reason"])
        shown(event.vehicle, event.fields)
    return found


def test_without_a_position_it_does_not_fly_and_says_why(two: str, tmp_path: Path, monkeypatch):
    monkeypatch.setattr(AutopilotLink, "tell_position", lambda link, estimate, now: None)
    flight, told, _ = full_flight(plan_of(SIDESTEP, two), tmp_path)
    found = failures(told)
    assert flight.summary["outcome"] == "failed"
    for vehicle in ("mk", "nano"):
        assert found[vehicle, "position"] == "there is no estimate to send"
        assert (vehicle, "autopilot") in found


def test_without_motion_capture_it_does_not_fly(two: str, tmp_path: Path):
    room = Room()
    room.silent.update(("mk", "nano"))
    flight, told, _ = full_flight(room.into(plan_of(SIDESTEP, two)), tmp_path)
    found = failures(told)
    assert flight.summary["outcome"] == "failed"
    assert {("mk", "estimate"), ("nano", "estimate"), ("mk", "position")} <= set(found)


def test_parameters_that_are_not_prepared_are_named_with_what_mends_them(two: str, tmp_path: Path):
    values = UNPREPARED[two]
    (harmless, dangerous) = values
    with parameters_of(two, 2, values):
        flight, told, _ = full_flight(plan_of(SIDESTEP, two), tmp_path)
    found = failures(told)
    assert flight.summary["outcome"] == "failed"
    assert f"{harmless} is {values[harmless]:g}" in found["nano", "parameters"]
    mends = f"`kybflow mavlink setup --vehicle {two} --system 2 --simulator --write`"
    assert mends in found["nano", "parameters"]
    assert f"{dangerous} is 0" in found["nano", "watchdog"]
    assert ("mk", "parameters") not in found


def test_what_it_says_to_arming_is_what_the_run_says(two: str, tmp_path: Path, monkeypatch):
    """No vision, and a preflight that does not look: it must refuse by itself where it is to keep
    the position. (By acceleration PX4 needs none, and flies the whole mission.)"""
    monkeypatch.setattr(AutopilotLink, "tell_position", lambda link, estimate, now: None)
    monkeypatch.setattr(AutopilotLink, "checks", lambda link, now: ())
    flight, told, engine = full_flight(by_position(plan_of(SIDESTEP, two)), tmp_path)
    refused = named(told, "arming_refused")
    for event in refused:
        shown(event.vehicle, event.at, event.fields)
    assert {event.vehicle for event in refused} == {"mk", "nano"}
    assert all(event.at.endswith(("sidestep.yaml:23", "sidestep.yaml:33")) for event in refused)
    assert flight.summary["outcome"] == "failed"
    assert all(vehicle.link_out.armed is False for vehicle in engine.vehicles)
