"""Flows and callbacks that enter a behavior with values of their own."""

from __future__ import annotations

from math import dist
from pathlib import Path

import pytest
from short_flights import named, path
from toolchain import compiled, flight_of

from kybflow.cli.printing.mission import show_mission

MISSION = """
kybflow: 1
mission: valued
import: {std: kybflow/airframes}
parameters: {high: {type: length, default: 1.2 m, help: How high it flies.}}
world:
  fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}
  points: {there: [1, 0, 0.8]}
vehicles:
  mk:
    like: std.nano_plus
    behaviors:
      up:   {do: take_off, height: 80 cm, then: hold}
      hold: {do: hover}
      goto: {do: fly_to, position: [0, 0, 0.8], then: hold}
      down: {do: land}
targets:
  px4: {all: {driver: {use: emulated_autopilot, autopilot: px4}, tracker: on_board}}
  ardupilot: {all: {driver: {use: emulated_autopilot, autopilot: ardupilot}, tracker: on_board}}
flows:
  tour:
    phases:
      climb:  {run: {mk: up}, next: [{when: mk in hold, go: first}], within: 20 s, otherwise: home}
      first:  {run: {mk: {goto: {position: world.points.there, speed: 90 cm/s}}},
               next: [{when: mk in hold, go: second}], within: 20 s, otherwise: home}
      second: {run: {mk: goto},
               next: [{when: mk in hold, go: third}], within: 20 s, otherwise: home}
      third:  {next: [{event: arrived, go: home}], within: 20 s, otherwise: home}
      home:   {run: {mk: down}}
on:
  - {event: phase_started, phase: third, do: [{switch: {mk: {goto: {position: [0, 1, $high]}}}}]}
  - {event: mk.behavior_ended, behavior: goto, when: mk.state.y > 0.9 m, do: [{emit: arrived}]}
"""


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    written = tmp_path / "valued.yaml"
    written.write_text(MISSION, encoding="utf-8")
    return written


@pytest.mark.parametrize(
    "target",
    [None, *(pytest.param(name, marks=pytest.mark.thorough) for name in ("px4", "ardupilot"))],
)
def test_it_goes_where_the_flow_and_the_callback_say(mission, target, tmp_path) -> None:
    seen = []

    def watch(engine) -> None:
        [one] = engine.vehicles
        if one.estimate is not None:
            seen.append(one.estimate.position)

    plan = compiled(mission, target=target, warns=True)
    done, told = flight_of(plan, tmp_path / "run", watch)
    assert done.exit_code == 0
    assert not named(told, "switch_refused")
    assert path(told, "mk") == [
        *("landed", "up", "hold", "goto", "hold", "goto", "hold", "goto", "hold", "down", "landed")
    ]
    for place in ((1.0, 0.0, 0.8), (0.0, 0.0, 0.8), (0.0, 1.0, 1.2)):
        assert min(dist(place, at) for at in seen) < 0.05


def test_who_reads_the_mission_sees_the_values(mission) -> None:
    shown = show_mission(compiled(mission, warns=True), {})
    assert "mk: goto with position [1, 0, 0.8], speed 0.9 (mk in hold: second" in shown
    assert "switch mk to goto with position [0, 1, 1.2]" in shown


def test_the_resolved_mission_is_the_same(mission, tmp_path) -> None:
    plan = compiled(mission, warns=True)
    again = compiled(tmp_path / "resolved.yaml", plan.resolved, warns=True)
    runs = [phase.run for phase in plan.flows[0].phases.values()]
    assert runs[1]["mk"].values == (("position", (1.0, 0.0, 0.8)), ("speed", 0.9))
    assert [phase.run for phase in again.flows[0].phases.values()] == runs
    assert [one.actions for one in again.callbacks] == [one.actions for one in plan.callbacks]
