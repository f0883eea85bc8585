"""Manual flight: an operator takes a drone out of a circle with the four signals of an AR.Drone,
flies, turns and climbs, gives it back to the circle, and lands it."""

from __future__ import annotations

from math import hypot

from ardrone_flights import drone_flight

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


def test_an_operator_takes_a_drone_and_gives_it_back(tmp_path):
    (tmp_path / "operator.csv").write_text(OPERATOR, encoding="utf-8")
    seen = []
    flight, told, _ = drone_flight(MISSION, tmp_path, watch=seen)
    assert flight.summary["outcome"] == "succeeded", told
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
