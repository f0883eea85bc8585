"""Objects in a recording and on its page: where they are, and what presses them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from toolchain import compiled, with_library

from kybflow.api.flight import RunRequest, fly
from kybflow.report.data import Run, read_run
from kybflow.report.figures import figures

MISSION = """\
kybflow: 1
mission: push
summary: An AR.Drone flies into the plate of a bar, whose pivot slides on a rail.
import: {std: library/airframes.yaml}
world:
  fence: {from: [-2, -2, 0], to: [4, 2, 2.5]}
  objects:
    car:
      at: [0.5, 0, 80 cm]
      size: [16 cm, 16 cm, 10 cm]
      mass: 1 kg
      slide: {along: [1, 0, 0], from: -1 m, to: 3 m, friction: 0.4 N, damping: 0.3 N s/m}
    bar:
      on: car
      at: [0, 0, 20 cm]
      size: [6 cm, 1.2 m, 6 cm]
      mass: 500 g
      turn: {about: [0, 0, 1], from: -60 deg, to: 60 deg, friction: 0.01 N m, damping: 0.02 N m s}
      surfaces:
        left: {at: [-4 cm, 45 cm, 0], facing: [-1, 0, 0], width: 40 cm, height: 30 cm}
vehicles:
  v:
    like: std.ardrone_hull
    start: {at: [-0.2, 0.45, 0]}
    behaviors:
      up: {do: take_off, height: 1 m, then: go}
      go: {do: fly_to, position: [0.4, 0.45, 1], speed: 25 cm/s, then: back}
      back: {do: fly_to, position: [-0.2, 0.45, 1], then: down}
      down: {do: land}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = with_library(tmp_path_factory.mktemp("push"))
    plan = compiled(folder / "push.yaml", MISSION)
    flown = fly(plan, RunRequest(seed=1, out=folder / "run"))
    assert flown.summary["outcome"] == "succeeded", flown.summary["reason"]
    return read_run(Path(flown.folder))


def test_the_objects_are_where_they_were_at_the_start_and_turned_at_the_end(run: Run) -> None:
    bar, car = run.objects["bar"], run.objects["car"]
    assert bar.position[0] == pytest.approx((0.5, 0.0, 1.0))
    assert bar.outlines(0.0)[0].min(axis=0) == pytest.approx((0.47, -0.6))
    assert bar.outlines(0.0)[1].min(axis=0) == pytest.approx((0.46, 0.25))
    assert bar.heading[-1] < -0.2
    assert np.ptp(car.position[:, 0]) < 0.1
    low = bar.outlines(run.end)[0].min(axis=0)
    assert low[0] < 0.4


def test_a_contact_is_an_event_and_a_curve(run: Run) -> None:
    force = run.objects["bar"].forces["v.left"]
    assert 0.05 < force.max() < 2.0
    told = [e for e in run.events if e["event"].startswith("contact_")]
    assert told[0]["event"] == "contact_began"
    assert told[0]["fields"] == {"object": "bar", "surface": "left"}
    names = [e["event"] for e in told]
    assert names.count("contact_began") == names.count("contact_ended")
    drawn = {figure.name: figure for figure in figures(run)}
    assert [trace["name"] for trace in drawn["contacts"].traces] == ["bar: v on left"]
    assert "object" in {trace.get("name") for trace in drawn["path"].traces}
