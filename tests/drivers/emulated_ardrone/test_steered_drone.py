"""Manual flight: an operator takes a drone with the four signals of an AR.Drone, flies, turns and
climbs, and gives it back."""

from __future__ import annotations

from ardrone_flights import flown

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
      up:   {do: take_off, height: 1 m, then: wait, within: 20 s}
      wait:
        do: hover
        next:
          [{event: stick.take, go: hand}, {event: stick.land, go: down}, {after: 1 min, go: down}]
      hand:
        {do: steer, input: stick, by: signals, failed: down, next: [{event: stick.give, go: wait}]}
      down: {do: land}
"""
OPERATOR = """t, x, y, z, turn, buttons, lost
0, 0, 0, 0, 0, ,
10, 0, 0, 0, 0, take,
10.5, 0.6, 0, 0, 0, trigger,
12.5, 0, 0, 0, 0, trigger,
15, 0, 0, 0.5, 0.6, trigger,
17, 0, 0, 0, 0, trigger,
19, 0, 0, 0, 0, trigger give,
22, 0, 0, 0, 0, land,
"""


def test_an_operator_takes_a_drone_and_gives_it_back(tmp_path):
    (tmp_path / "operator.csv").write_text(OPERATOR, encoding="utf-8")
    seen = []
    flight, told, _ = flown(MISSION, tmp_path, watch=seen)
    assert flight.summary["outcome"] == "succeeded", told
    way = [e.fields["behavior"] for e in told if e.name == "behavior_started"]
    assert way == ["up", "wait", "hand", "wait", "down", "landed"]
    at = {round(seconds): truth for seconds, truth in seen}
    assert at[14].position[1] - at[10].position[1] > 0.4  # forward is north
    assert abs(at[14].position[0]) < 0.15
    assert at[18].position[2] - at[14].position[2] > 0.2
    assert flight.summary["vehicles"]["a"]["position_error_m"]["max"] < 0.35
