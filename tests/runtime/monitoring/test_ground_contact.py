"""What a vehicle does on the ground, in a take-off or a landing, is no error."""

import json
from pathlib import Path

from plans import part, plan, state, then, vehicle

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import Setpoint, SetpointKind
from kybflow.dsl.plan import Plan
from kybflow.parts import AIR, GROUND, MOVING
from kybflow.runtime.monitoring.tracking_errors import GroundContact


def sinking(height: float) -> Setpoint:
    """A setpoint of a landing, at 0.2 m/s."""
    return Setpoint(SetpointKind.POSITION, (0.0, 0.0, height), (0.0, 0.0, -0.2))


def test_a_take_off_has_left_the_ground_once_it_is_higher_than_it_stood():
    contact = GroundContact(GROUND >> AIR, 0.8)
    climbing = Setpoint(SetpointKind.POSITION, (0.0, 0.0, 0.9), (0.0, 0.0, 0.3))
    assert [contact.carries(climbing, height, 0.1) for height in (0.8, 0.81, 0.83)] == [
        True, True, False,
    ]  # fmt: skip


def test_one_that_follows_its_landing_flies():
    contact = GroundContact(AIR >> GROUND, 1.0)
    assert not contact.carries(sinking(0.95), 0.99, -0.15)
    assert not contact.carries(sinking(0.5), 0.52, -0.2)


def test_one_that_stays_behind_a_sinking_setpoint_has_met_the_ground():
    contact = GroundContact(AIR >> GROUND, 1.0)
    assert contact.carries(sinking(-0.04), 0.0, 0.0)
    assert contact.carries(sinking(-0.1), 0.0, -0.04)


def test_what_gives_way_was_no_ground():
    contact = GroundContact(AIR >> GROUND, 1.0)
    assert contact.carries(sinking(0.46), 0.5, 0.0)
    assert not contact.carries(sinking(0.46), 0.47, -0.2)


def test_a_take_off_after_a_landing_that_was_broken_off_flies():
    assert not GroundContact(MOVING >> AIR, 0.5).carries(sinking(0.6), 0.5, 0.0)


def short_flight() -> Plan:
    states = [
        state("up", part("behaviors", "take_off", height=1.0), then("hold")),
        state("hold", part("behaviors", "hover", for_time=1.0), then("down")),
        state("down", part("behaviors", "land"), then("landed")),
    ]
    return plan(vehicle("a", states, driver=part("drivers", "sim", calm=True)))


def test_a_landing_that_flies_well_has_a_small_error(tmp_path: Path):
    """The setpoint of the landing ends 17 cm below the ground."""
    flown = fly(short_flight(), RunRequest(out=tmp_path))
    score = flown.summary["vehicles"]["a"]
    down = score["behaviors"][2]
    assert down["position_error_m"]["max"] < 0.035
    assert score["position_error_m"]["max"] == score["behaviors"][0]["position_error_m"]["max"]


def test_the_intervals_in_the_air_are_told(tmp_path: Path):
    flown = fly(short_flight(), RunRequest(out=tmp_path))
    ((start, end),) = flown.summary["vehicles"]["a"]["airborne_s"]
    events = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    (landed,) = [event["t_s"] for event in events if event["event"] == "landed"]
    assert 0.5 < start < 2.0
    assert landed - 1.0 < end < landed
