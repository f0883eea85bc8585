"""Every vehicle stops before what stands in its way, unless it is there to be touched."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest
from short_flights import named
from toolchain import compiled, flight_of, succeeds

from kybflow.core.signals import NS
from kybflow.dsl.plan import Plan
from kybflow.runtime.commanding.command_queue import RecordedCommand
from kybflow.runtime.engine import Engine

MISSION = """
kybflow: 1
mission: guarded
import: {{std: kybflow/airframes}}
world:
  fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}
  obstacles:
    pillar: {{cylinder: {{at: [1, 0, 0], radius: 20 cm, height: 2.5 m}}, contact: {contact}}}
time_limit: 60 s
vehicles:
  a:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    behaviors:
      up:   {{do: take_off, height: 1 m, then: slow}}
      slow:
        do: run_until
        velocity: [0.3, 0, 0]
        at_most: 40 cm
        then: down
        next: [{{after: 1 s, go: on}}]
      on:
        do: run_until
        velocity: [0.8, 0, 0]
        at_most: 1.2 m
        patience: 3 s
        then: down
        failed: down
      down: {{do: land}}
expect: ["always distance(a to [1 0 1]) > 42 cm"]
"""


def guarded(tmp_path: Path, contact: str) -> Plan:
    return compiled(tmp_path / "mission.yaml", MISSION.format(contact=contact), warns=True)


@pytest.mark.thorough
def test_run_until_into_a_pillar_stops_before_it_and_says_so(tmp_path: Path) -> None:
    _, told = succeeds(guarded(tmp_path, "forbidden"), tmp_path / "run")
    [clamp] = named(told, "clamp_started")
    assert clamp.fields["processor"] == "obstacle_guard"
    assert named(told, "behavior_failed")


@pytest.mark.thorough
def test_what_is_there_to_be_touched_is_touched_and_no_collision(tmp_path: Path) -> None:
    run, told = flight_of(guarded(tmp_path, "allowed"), tmp_path / "run")
    assert "42 cm" in run.summary["reason"]
    assert "ran into" not in run.summary["reason"]
    assert named(told, "clamp_started", "collided") == []


IN_A_LAB = """
kybflow: 1
mission: pressed
import: {{std: kybflow/airframes}}
world:
  fence: {{from: [-3, -3, 0], to: [3, 3, 2.5]}}
  obstacles:
    pillar: {{cylinder: {{at: [1, 0, 0], radius: 20 cm, height: 2.5 m}}}}
    north:  {{plane: {{at: [0, 2, 0], facing: [0, -1, 0]}}}}
    west:   {{plane: {{at: [-2, 0, 0], facing: [1, 0, 0]}}}}
targets: {{lab: {{all: {{driver: {{use: sim, calm: false}}}}}}}}
inputs: {{stick: {{use: script, file: stick.csv}}}}
faults:
  - {{when: behavior == go and elapsed > 8 s, on: v, inject: gust, velocity: [-2, 2, 0], for: 1 s}}
vehicles:
  v:
    like: std.{frame}
    start: {{at: [0, 0, 0]}}
    behaviors:
      up:   {{do: take_off, height: 1 m, then: wait, within: 15 s}}
      wait: {{do: hover, for_time: 2 s, then: go}}
      go:   {{{go}, {then}failed: down, next: [{{after: 25 s, go: down}}]}}
      down: {{do: land}}
"""
STICK = """t, x, y, z, turn, buttons, lost
0, 0, 0, 0, 0, ,
8, -0.7, 0.7, 0, 0, ,
"""
PRESSED = {
    "circle": "do: circle, center: [0, 0, 1], radius: {beside}, speed: 0.7 m/s, laps: 2",
    "figure_eight": "do: figure_eight, width: {across}, lap: 9 s, laps: 2",
    "follow_path": "do: follow_path, path: [[0, {off}, 1], [2, {off}, 1]], speed: 1 m/s",
    "steer": "do: steer, input: stick, frame: world, speed: 1 m/s, clearance: 6 cm",
    "trajectory_input": "do: trajectory_input",
}
"""What leads nearer to the pillar or to a corner than the guard allows, though no nearer than the
compiler does."""


class Nearest:
    """An observer: how near the hull comes to an obstacle in the air, m."""

    def __init__(self) -> None:
        self.room = inf

    def __call__(self, engine: Engine) -> None:
        [vehicle] = engine.vehicles
        if vehicle.airborne and vehicle.truth is not None:
            rooms = (s.distance(vehicle.truth.position) for s in vehicle.context.obstacles.values())
            self.room = min(self.room, min(rooms) - vehicle.context.airframe.hull)


@pytest.mark.thorough
@pytest.mark.parametrize("frame", ["nano_plus", pytest.param("mk_quadro", marks=pytest.mark.slow)])
@pytest.mark.parametrize("behavior", PRESSED)
def test_whatever_flies_it_stays_clear_and_says_why(
    behavior: str, frame: str, tmp_path: Path
) -> None:
    arm = {"nano_plus": 0.095, "mk_quadro": 0.25}[frame]
    off = 0.2 + arm + 0.01
    go = PRESSED[behavior].format(beside=1.0 - off, across=2.0 * (1.0 - off), off=off)
    then = "" if behavior in ("steer", "trajectory_input") else "then: down, "
    (tmp_path / "stick.csv").write_text(STICK, encoding="utf-8")
    text = IN_A_LAB.format(frame=frame, go=go, then=then)
    plan = compiled(tmp_path / "mission.yaml", text, target="lab", warns=True)
    through = tuple(
        RecordedCommand((8 + i) * NS, f"track v time={11 + i} position=[{x}, 0.03, 1]", "p", False)
        for i, x in enumerate((0.4, 0.8, 1.2, 1.6, 1.2, 0.8))
        if behavior == "trajectory_input"
    )
    nearest = Nearest()
    _, told = succeeds(plan, tmp_path / "run", nearest, seed=1, again=through)
    assert 0.05 < nearest.room < 0.11
    assert named(told, "clamp_started")
    assert not named(told, "collided")
