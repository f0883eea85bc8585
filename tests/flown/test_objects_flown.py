"""A vehicle with a bumper pushes a bar: what conditions and expectations read of the objects."""

from __future__ import annotations

from pathlib import Path

from toolchain import compiled

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import NS, Event

MISSION = """\
kybflow: 1
mission: push
import: {std: kybflow/airframes}
world:
  fence: {from: [-2, -2, 0], to: [4, 2, 2.5]}
  objects:
    car:
      at: [1, 0, 80 cm]
      size: [16 cm, 16 cm, 10 cm]
      mass: 1 kg
      slide: {along: [1, 0, 0], from: -1 m, to: 3 m, friction: 0.4 N, damping: 0.3 N s/m}
    bar:
      on: car
      at: [0, 0, 20 cm]
      size: [6 cm, 1.2 m, 6 cm]
      mass: 0.5 kg
      turn: {about: [0, 0, 1], from: -60 deg, to: 60 deg, friction: 0.01 N m, damping: 0.02 N m s}
      surfaces:
        left: {at: [-4 cm, 45 cm, 0], facing: [-1, 0, 0], width: 40 cm, height: 30 cm}
    box: {at: [2, 1, 0.1], size: [30 cm, 30 cm, 30 cm], mass: 2 kg}
vehicles:
  v:
    like: std.ardrone_hull
    start: {at: [-1, 0.45, 0]}
    behaviors:
      up:   {do: take_off, height: 1 m, then: go}
      go:   {do: fly_to, position: [1.2, 0.45, 1], speed: 25 cm/s, then: back, failed: back, within: 12 s}
      back: {do: fly_to, position: [-1, 0.45, 1], then: down}
      down: {do: land}
on:
  - {when: bar.angle < -3 deg, do: [{log: turned}]}
expect:
  - max(car.position) < 1 m
  - min(bar.yaw in v.go) < -3 deg
  - eventually bar.turn_rate < -2 deg/s
  - min(distance(v to bar.left)) < 40 cm
  - finally box.speed < 1 cm/s
"""  # noqa: E501 - as a mission is written


def test_conditions_read_what_is_seen_and_expectations_the_truth(tmp_path: Path) -> None:
    plan = compiled(tmp_path / "push.yaml", MISSION)
    told: list[Event] = []
    turned: list[float] = []

    def look(engine) -> None:
        if engine.true_objects.states["bar"].q < -0.05236 and not turned:
            turned.append(engine.clock.now / NS)

    flown = fly(plan, RunRequest(seed=1, out=tmp_path / "run"), (told.append,), (look,))
    assert [one["held"] for one in flown.summary["expectations"]] == [True] * 5
    touched = next(e.time for e in told if e.name == "contact_began") / NS
    noticed = next(e.time for e in told if e.name == "logged") / NS
    assert touched < turned[0] <= noticed + 0.05
    assert noticed - turned[0] < 0.1
