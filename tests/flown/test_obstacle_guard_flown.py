"""Every vehicle stops before what stands in its way, unless it is there to be touched."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from kybflow.api.flight import Flown, RunRequest, fly
from kybflow.core.signals import Event
from kybflow.dsl.compiler import compile_mission
from kybflow.parts.catalog import load_catalog

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
Flies = Callable[..., tuple[Flown, list[Event]]]


@pytest.fixture
def flown(tmp_path: Path) -> Flies:
    def flown(contact: str = "forbidden") -> tuple[Flown, list[Event]]:
        path = tmp_path / "mission.yaml"
        path.write_text(MISSION.format(contact=contact), encoding="utf-8")
        plan = compile_mission(path, catalog=load_catalog()).plan
        assert plan is not None
        told: list[Event] = []
        return fly(plan, RunRequest(out=tmp_path / "run"), (told.append,)), told

    return flown


def test_run_until_into_a_pillar_stops_before_it_and_says_so(flown: Flies) -> None:
    run, told = flown()
    assert run.summary["outcome"] == "succeeded", run.summary["reason"]
    [clamp] = [event for event in told if event.name == "clamp_started"]
    assert clamp.fields["processor"] == "obstacle_guard"
    assert "behavior_failed" in [event.name for event in told]


def test_what_is_there_to_be_touched_is_touched_and_no_collision(flown: Flies) -> None:
    run, told = flown(contact="allowed")
    assert "42 cm" in run.summary["reason"]
    assert "ran into" not in run.summary["reason"]
    assert [event for event in told if event.name in ("clamp_started", "collided")] == []
