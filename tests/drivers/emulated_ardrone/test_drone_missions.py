"""Missions on an emulated drone: it performs what the mission or a person asks for, is steered by
hand, and what goes wrong is told in words and ends on the ground."""

from __future__ import annotations

from math import hypot

import pytest
from ardrone_flights import drone_flight, mission, succeeded
from short_flights import named

from kybflow.api.flight import RunRequest
from kybflow.core.geometry import heading_of
from kybflow.core.signals import NS
from kybflow.drivers.ardrone.acts import CALIBRATE
from kybflow.runtime.commanding.command_queue import RecordedCommand

ON = """on:
  - {event: a.took_off, do: [{perform: {a: leds_blink_green}}]}
"""


def asked(seconds, words):
    return RecordedCommand(round(seconds * NS), words, "alice", False)


def flight(folder, *commands, fly=succeeded, **params):
    request = RunRequest(out=folder / "run", again=commands)
    return fly(mission(["a"], 6.0) + ON, folder, request=request, wifi_loss=0.0, **params)


def answers(told):
    names = ("performed", "perform_refused")
    return [(e.fields["act"], e.fields.get("reason")) for e in told if e.name in names]


@pytest.mark.thorough
def test_leds_play_for_the_mission_and_for_a_person_and_nothing_else_does(tmp_path):
    commands = (asked(9.0, "perform a leds_fire"), asked(9.5, "perform a flip_left"),
                asked(9.6, "perform a somersault"))  # fmt: skip
    _, told, session = flight(tmp_path, *commands)
    assert answers(told) == [
        ("leds_blink_green", None),
        ("leds_fire", None),
        ("flip_left", "its driver performs it with `maneuvers: true` only"),
        ("somersault", "its driver performs no `somersault`"),
    ]
    values = session.links["a"].drone.configuration.values
    assert values["leds:leds_anim"] == "5,1073741824,3"
    assert values["control:flight_anim"] == "0,0"


@pytest.mark.thorough
def test_with_permission_it_flips_in_flight_alone_and_flies_on(tmp_path):
    commands = (asked(2.5, "perform a flip_left"), asked(9.0, "perform a flip_left"),
                asked(9.5, "perform a roll_dance"))  # fmt: skip
    _, told, session = flight(tmp_path, *commands, maneuvers=True)
    assert answers(told) == [
        ("flip_left", "it doesn't fly"),
        ("leds_blink_green", None),
        ("flip_left", None),
        ("roll_dance", "it still performs an act"),
    ]
    assert session.links["a"].drone.configuration.values["control:flight_anim"] == "18,15"
    assert "control_lost" not in [event.name for event in told]


@pytest.mark.thorough
def test_it_turns_once_to_calibrate_its_magnetometer_and_flies_on(tmp_path):
    room = "processors: [{use: position_error, limit: 1.5 m}]\n    behaviors:"
    text = mission(["a"], 6.0).replace("behaviors:", room)
    circle = "do: circle, center: [-1.5, 0.5, 1], radius: 50 cm, speed: 40 cm/s, laps: 1"
    text = text.replace(circle, "do: hover, for_time: 12 s")
    request = RunRequest(out=tmp_path / "run", again=(asked(9.0, f"perform a {CALIBRATE}"),))
    watch = []
    _, told, _ = succeeded(text, tmp_path, request=request, watch=watch, maneuvers=True)
    assert answers(told) == [(CALIBRATE, None)]
    headings = [heading_of(true.attitude) for seconds, true in watch if 9.0 < seconds < 16.0]
    assert {round(heading) for heading in headings} == {-3, -2, -1, 0, 1, 2, 3}
    assert abs(headings[-1]) < 0.3


@pytest.mark.thorough
def test_who_lands_it_has_it_but_its_leds(tmp_path):
    commands = (asked(9.0, "land a"), asked(9.5, "perform a flip_left"),
                asked(9.6, "perform a leds_red"))  # fmt: skip
    _, told, _ = flight(tmp_path, *commands, fly=drone_flight, maneuvers=True)
    refused, played = answers(told)[-2:]
    assert refused == ("flip_left", "a person landed it, and it stays on the ground")
    assert played == ("leds_red", None)


@pytest.mark.thorough
def test_by_the_compass_it_flies_as_by_its_own_axes(tmp_path):
    done, *_ = flight(tmp_path, compass=1.5707963)  # the world's x axis points east
    assert done.summary["vehicles"]["a"]["position_error_m"]["mean"] < 0.1


@pytest.mark.thorough
def test_a_flood_of_acts_is_answered_and_ten_a_second_are_passed_on(tmp_path):
    commands = (asked(9.0 + 1e-4 * i, "perform a leds_fire") for i in range(300))
    _, told, _ = flight(tmp_path, *commands, asked(10.5, "perform a leds_red"))
    _, *flood, last = answers(told)
    why = "it was already asked for 10 acts within a second"
    assert flood == [("leds_fire", None)] * 10 + [("leds_fire", why)] * 290
    assert last == ("leds_red", None)


def test_a_drone_that_stops_its_rotors_is_told_with_the_cause(tmp_path):
    text = mission(["a"], 15.0)
    flight, told, session = drone_flight(text, tmp_path, breaks=[(9.0, {"cutout": True})])
    assert flight.summary["outcome"] == "failed"
    lost, _ = named(told, "control_lost")
    assert "a motor was stopped by force" in lost.fields["reason"]
    words = [event.fields["text"] for event in named(told, "vehicle_said")]
    assert "it is in emergency, its rotors stopped" in words
    assert session.links["a"].truth().position[2] < 0.1


@pytest.mark.thorough
def test_a_drone_with_an_empty_battery_lands_itself(tmp_path):
    text = mission(["a"], 15.0)
    flight, told, session = drone_flight(text, tmp_path, breaks=[(9.0, {"battery": 0.04})])
    assert flight.summary["outcome"] == "failed"
    assert any("battery" in event.name for event in told), [event.name for event in told]
    assert not session.links["a"].drone.flight.flies
    assert session.links["a"].truth().position[2] < 0.05


@pytest.mark.thorough
def test_a_drone_in_emergency_is_reset_before_take_off(tmp_path):
    text = mission(["a"], 3.0)
    breaks = [(0.0, {"cutout": True}), (0.5, {"cutout": False})]
    _, told, _ = succeeded(text, tmp_path, breaks=breaks)
    assert named(told, "took_off")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("breaks", "check"),
    [([(0.0, {"cutout": True})], "emergency"), ([(0.0, {"battery": 0.1})], "own battery")],
)
def test_a_drone_that_is_not_well_does_not_take_off(breaks, check, tmp_path):
    flight, told, session = drone_flight(mission(["a"], 3.0), tmp_path, breaks=breaks)
    assert flight.summary["outcome"] != "succeeded"
    assert check in [event.fields["check"] for event in named(told, "preflight_failed")]
    assert not session.links["a"].drone.flight.flies


@pytest.mark.thorough
def test_how_it_stands_is_taken_for_level_once_where_that_is_asked_for(tmp_path):
    _, _, session = drone_flight(mission(["a"], 3.0), tmp_path, flat_trim=True, wifi_loss=0.0)
    assert session.links["a"].drone.accepted == {"FTRIM": 1}


def test_a_tilt_that_the_drone_is_not_given_fails_the_preflight(tmp_path):
    flight, told, _ = drone_flight(mission(["a"], 3.0), tmp_path, euler_angle_max=0.1)
    (failed,) = named(told, "preflight_failed")
    assert failed.fields["check"] == "tilt"
    assert flight.summary["outcome"] != "succeeded"


MISSION = """kybflow: 1
mission: steered
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
inputs:
  stick: {use: script, file: operator.csv, dead_man: trigger, silent_after: 300 ms}
vehicles:
  a:
    like: std.ardrone
    start: {at: [0, 0, 0], heading: 90 deg}
    behaviors:
      up:   {do: take_off, height: 1 m, then: turn, within: 20 s}
      turn:
        do: circle
        center: [0, 0, 1]
        radius: 60 cm
        speed: 40 cm/s
        within: 1 min
        failed: down
        next: [{event: stick.take, go: hand}, {event: stick.land, go: down}]
      hand:
        {do: steer, input: stick, by: signals, failed: down, next: [{event: stick.give, go: turn}]}
      down: {do: land}
"""
OPERATOR = """t, x, y, z, turn, buttons, lost
0, 0, 0, 0, 0, ,
15, 0, 0, 0, 0, take,
18, 0.6, 0, 0, 0, trigger,
20, 0, 0, 0, 0, trigger,
22, 0, 0, 0.5, 0.6, trigger,
24, 0, 0, 0, 0, trigger,
26, 0, 0, 0, 0, trigger give,
42, 0, 0, 0, 0, land,
"""


@pytest.mark.thorough
def test_an_operator_takes_a_drone_and_gives_it_back(tmp_path):
    (tmp_path / "operator.csv").write_text(OPERATOR, encoding="utf-8")
    seen = []
    flight, told, _ = succeeded(MISSION, tmp_path, watch=seen)
    way = [e.fields["behavior"] for e in told if e.name == "behavior_started"]
    assert way == ["up", "turn", "hand", "turn", "down", "landed"]
    at = {round(seconds): truth for seconds, truth in seen}
    north = at[21].position[1] - at[18].position[1]
    assert north > 0.4  # forward
    assert abs(at[21].position[0] - at[18].position[0]) < 0.15
    assert at[25].position[2] - at[21].position[2] > 0.2
    away = [hypot(*truth.position[:2]) - 0.6 for seconds, truth in seen if 36.0 < seconds < 42.0]
    assert max(map(abs, away)) < 0.15  # on the circle again
    assert flight.summary["vehicles"]["a"]["position_error_m"]["max"] < 0.35
