"""`estimators` under a behavior, and under the use of a chain."""

from __future__ import annotations

from pathlib import Path

from toolchain import compiled, result_of

MISSION = """\
kybflow: 1
mission: m
import: {std: kybflow/airframes}
world: {fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}}
chains:
  wait: {behaviors: {stay: {do: hover, for_time: 1 s}}}
  hop:
    behaviors:
      rise: {do: take_off, height: 1 m, then: pause, estimators: [inertial, mocap]}
      pause: {do: chain.wait, then: down}
      down: {do: land}
vehicles:
  a:
    like: std.mk_quadro
    estimators: [{use: mocap, healthy: age < 250 ms}, {use: inertial, for_at_most: 2 s}]
    behaviors:
      up:    {do: take_off, height: 1 m, then: down, estimators: [inertial]}
      down:  {do: land, then: again}
      again: {do: chain.hop, estimators: [mocap]}
"""
EXPECTED = {
    "up": ("inertial",),
    "down": (),
    "again.rise": ("inertial", "mocap"),
    "again.pause.stay": ("mocap",),
    "again.down": ("mocap",),
}


def test_who_comes_first_in_which_state(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    plan = compiled(path, MISSION)
    states = plan.vehicles[0].states
    own = {name: state.estimators for name, state in states.items() if not state.built_in}
    assert own == EXPECTED
    again = compiled(path, plan.resolved)
    assert {n: again.vehicles[0].states[n].estimators for n in EXPECTED} == EXPECTED


def test_an_unknown_one_of_a_chains_use_is_told_once(tmp_path: Path) -> None:
    text = MISSION.replace("chain.hop, estimators: [mocap]", "chain.hop, estimators: [x]")
    result = result_of(tmp_path / "m.yaml", text)
    assert [d.message for d in result.diagnostics] == ["`a` has no estimator `x`"]
