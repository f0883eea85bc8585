"""What goes wrong with a drone in flight, or before, is told in words, and the flight ends on the
ground."""

from __future__ import annotations

import pytest
from ardrone_flights import drone_flight, mission


def named(told, name):
    return [event for event in told if event.name == name]


def test_a_drone_that_stops_its_rotors_is_told_with_the_cause(tmp_path):
    text = mission(["a"], 15.0)
    flight, told, session = drone_flight(text, tmp_path, breaks=[(9.0, {"cutout": True})])
    assert flight.summary["outcome"] == "failed"
    lost, _ = named(told, "control_lost")
    assert "a motor was stopped by force" in lost.fields["reason"]
    words = [event.fields["text"] for event in named(told, "vehicle_said")]
    assert "it is in emergency, its rotors stopped" in words
    assert session.links["a"].truth().position[2] < 0.1


def test_a_drone_with_an_empty_battery_lands_itself(tmp_path):
    text = mission(["a"], 15.0)
    flight, told, session = drone_flight(text, tmp_path, breaks=[(9.0, {"battery": 0.04})])
    assert flight.summary["outcome"] == "failed"
    assert any("battery" in event.name for event in told), [event.name for event in told]
    assert not session.links["a"].drone.flight.flies
    assert session.links["a"].truth().position[2] < 0.05


def test_a_drone_in_emergency_is_reset_before_take_off(tmp_path):
    text = mission(["a"], 3.0)
    breaks = [(0.0, {"cutout": True}), (0.5, {"cutout": False})]
    flight, told, _ = drone_flight(text, tmp_path, breaks=breaks)
    assert flight.summary["outcome"] == "succeeded", told
    assert named(told, "took_off")


@pytest.mark.parametrize(
    ("breaks", "check"),
    [([(0.0, {"cutout": True})], "emergency"), ([(0.0, {"battery": 0.1})], "own battery")],
)
def test_a_drone_that_is_not_well_does_not_take_off(breaks, check, tmp_path):
    flight, told, session = drone_flight(mission(["a"], 3.0), tmp_path, breaks=breaks)
    assert flight.summary["outcome"] != "succeeded"
    assert check in [event.fields["check"] for event in named(told, "preflight_failed")]
    assert not session.links["a"].drone.flight.flies


def test_how_it_stands_is_taken_for_level_once_where_that_is_asked_for(tmp_path):
    _, _, session = drone_flight(mission(["a"], 3.0), tmp_path, flat_trim=True, wifi_loss=0.0)
    assert session.links["a"].drone.accepted == {"FTRIM": 1}


def test_a_tilt_that_the_drone_is_not_given_fails_the_preflight(tmp_path):
    flight, told, _ = drone_flight(mission(["a"], 3.0), tmp_path, euler_angle_max=0.1)
    (failed,) = named(told, "preflight_failed")
    assert failed.fields["check"] == "tilt"
    assert flight.summary["outcome"] != "succeeded"
