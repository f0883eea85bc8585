"""Vehicles that are in each other's way when they land, and formations in which something goes
wrong with one: the others slow, keep their distance, and all come down. Judged by the
simulator's truth."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from math import inf
from pathlib import Path

import pytest
from short_flights import named
from toolchain import compiled, flight_of

from kybflow.api.flight import Flown
from kybflow.core.geometry import Vec3, distance, norm
from kybflow.core.signals import Event
from kybflow.runtime.engine import Engine

MISSION = """
kybflow: 1
mission: neighbours
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-2, -2, 0], to: [2, 2, 2.5]}}}}
hover_limit: 5 s
time_limit: 60 s
vehicles:
  a:
    like: std.nano_plus
    start: {{at: [0, 0, 0]}}
    behaviors:
      up:   {{do: take_off, height: 60 cm, then: hold}}
      hold: {{do: hover, for_time: 20 s, then: down}}
      down: {{do: land}}
  b:
    like: std.nano_plus
    start: {{at: [1, 0, 0]}}
    behaviors:
      up:   {{do: take_off, height: {goal[2]} m, then: go}}
      go:   {{do: fly_to, position: {goal}, then: over}}
      over: {{do: hover, for_time: {over} s, then: down}}
      down: {{do: land{at}}}
expect: [{apart}]
on:
  - {{event: operator.down_all, do: [{{switch: {{a: down, b: down}}}}]}}
"""
ABOVE, BESIDE = [0.0, 0.0, 0.95], [0.2, 0.0, 0.6]


@pytest.fixture
def flight_past(tmp_path: Path) -> Callable[..., tuple[Flown, list[Event]]]:
    def flight_past(
        goal: list[float],
        *emitted: tuple[float, str],
        over: float = 0.1,
        at: str = "",
        apart: str = "finally distance(a to b) > 30 cm",
    ) -> tuple[Flown, list[Event]]:
        text = MISSION.format(goal=goal, over=over, at=at, apart=apart)
        plan = compiled(tmp_path / "mission.yaml", text, warns=True)
        run, told = flight_of(plan, tmp_path / "run", emitted=emitted)
        assert named(told, "collided") == []
        return run, told

    return flight_past


def times(told: list[Event], name: str) -> dict[str, float]:
    """When each vehicle told the event first."""
    return {e.vehicle: e.time / 1e9 for e in reversed(told) if e.name == name}


@pytest.mark.thorough
def test_it_does_not_land_on_one_that_hovers_below_but_beside(flight_past) -> None:
    run, told = flight_past(ABOVE)
    [waits] = named(told, "behavior_waits")
    assert (waits.vehicle, waits.fields["reason"]) == ("b", "`a` is below")
    assert times(told, "landed")["b"] < times(told, "landed")["a"] - 5.0
    assert run.summary["outcome"] == "succeeded"


@pytest.mark.thorough
def test_two_that_brake_each_other_land_side_by_side_and_say_why(flight_past) -> None:
    run, told = flight_past(BESIDE, apart="finally distance(a to b) > 20 cm")
    assert set(times(told, "too_close")) == {"a", "b"}
    assert run.summary["outcome"] == "failed"
    assert "b: `go` failed: held for 5 s: 0.2" in run.summary["reason"]
    assert " m from `a`, 0.24 m needed" in run.summary["reason"]
    assert set(times(told, "landed")) == {"a", "b"}


@pytest.mark.parametrize(
    ("goal", "order"),
    [
        pytest.param(ABOVE, "operator.land", marks=pytest.mark.thorough),
        pytest.param(BESIDE, "operator.down_all", marks=pytest.mark.thorough),
        pytest.param(ABOVE, "operator.down_all", marks=pytest.mark.slow),
        pytest.param(BESIDE, "operator.land", marks=pytest.mark.slow),
    ],
)
def test_two_neighbours_land_when_they_are_asked_to(
    flight_past, order: str, goal: list[float]
) -> None:
    run, told = flight_past(goal, (9.0, order), over=30.0, apart="finally distance(a to b) > 20 cm")
    assert (set(times(told, "too_close")) == {"a", "b"}) is (goal is BESIDE)
    assert max(times(told, "landed").values()) < 17.0
    assert run.summary["outcome"] == "succeeded"


@pytest.mark.thorough
def test_over_a_point_where_another_stands_it_waits_and_then_lands_beside(flight_past) -> None:
    _, told = flight_past(ABOVE, at=", position: [0, 0, 0], patience: 2 s")
    [failed] = named(told, "behavior_failed")
    assert failed.fields["reason"] == "`a` is below for 2 s"
    assert times(told, "landed")["b"] < times(told, "landed")["a"]


FORMATION = """
kybflow: 1
mission: in_trouble
import: {{std: kybflow/airframes}}
world: {{fence: {{from: [-4, -4, 0], to: [4, 4, 2.5]}}}}
hover_limit: 60 s
time_limit: 60 s
groups: {{swarm: [a, b, c, d]}}
vehicles:
  a:
    like: std.nano_plus
    start: {{at: [-0.6, -1.8, 0]}}
    behaviors:
      up:    {{do: take_off, height: 1 m, then: form}}
      form:
        {{do: formation, members: swarm, {shape}, path: [[2, 0, 1]], speed: 0.4 m/s, delay: 20 ms,
         within: 20 s, then: down, failed: down}}
      down:  {{do: land}}
    {more}
  b: {{like: a, start: {{at: [-0.6, -0.6, 0]}}}}
  c: {{like: a, start: {{at: [-0.6, 0.6, 0]}}}}
  d: {{like: a, start: {{at: [-0.6, 1.8, 0]}}}}
on:
  - {{event: operator.all_down, do: [{{switch: {{a: down, b: down, c: down, d: down}}}}]}}
faults: {faults}
"""
CREDULOUS = "{use: mocap, gate: 2 m, widest_gate: 2 m}"
FROM = 8.0
"""Seconds: all are in their places, and on their way."""
HARD = 0.2
"""m/s between two looks, 50 ms: no more than a hard brake."""


class Seen:
    """An observer. apart: the least distance of two in the air. speed: of each, the fastest from a
    second after `FROM` on, for two seconds. step: of each, the largest change of velocity between
    two looks after `FROM`."""

    def __init__(self) -> None:
        self.apart, self.speed, self.step = inf, dict[str, float](), dict[str, float]()
        self.landed: dict[str, Vec3] = {}
        self._before: dict[str, Vec3] = {}

    def __call__(self, engine: Engine) -> None:
        flying = [v for v in engine.vehicles if v.airborne and v.truth is not None]
        for one, other in combinations(flying, 2):
            self.apart = min(self.apart, distance(one.truth.position, other.truth.position))
        for vehicle in flying:
            name, velocity, now = vehicle.name, vehicle.truth.velocity, engine.seconds()
            if FROM + 1.0 < now < FROM + 3.0:
                self.speed[name] = max(self.speed.get(name, 0.0), norm(velocity))
            if FROM < now < FROM + 3.0:
                change = distance(velocity, self._before.get(name, velocity))
                self.step[name] = max(self.step.get(name, 0.0), change)
            self._before[name] = velocity
        self.landed = {v.name: v.truth.position for v in engine.vehicles if v.truth is not None}


def formation_flight(
    tmp_path: Path,
    faults: str = "[]",
    emitted: tuple[tuple[float, str], ...] = (),
    shape: str = "shape: line, side: 1.2 m",
    more: str = "",
) -> tuple[Seen, list[Event]]:
    text = FORMATION.format(faults=faults, shape=shape, more=more)
    plan = compiled(tmp_path / "mission.yaml", text, warns=True)
    seen = Seen()
    _, told = flight_of(plan, tmp_path / "run", seen, emitted=emitted)
    assert not named(told, "collided")
    return seen, told


def who(told: list[Event], name: str, **fields: str) -> set[str]:
    return {e.vehicle for e in named(told, name) if fields.items() <= e.fields.items()}


@pytest.mark.thorough
def test_the_others_slow_for_one_that_publishes_nothing_and_all_land(tmp_path: Path) -> None:
    seen, told = formation_flight(tmp_path, f"[{{at: {FROM} s, on: b, inject: neighbours_lost}}]")
    assert who(told, "neighbour_lost", neighbour="b") == {"a", "c", "d"}
    assert max(seen.speed[name] for name in "acd") < 0.1
    assert seen.apart > 0.6
    assert who(told, "landed") == set("abcd")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("estimators", "told_of_it"),
    [("", "position_refused"), (f"estimators: [{CREDULOUS}]", "jumped")],
)
def test_the_others_do_not_jump_with_one_whose_estimate_does_and_all_land(
    tmp_path: Path, estimators: str, told_of_it: str
) -> None:
    fault = f"{{at: {FROM} s, on: b, inject: mocap_jump, offset: [0, 1, 0]}}"
    seen, told = formation_flight(tmp_path, f"[{fault}]", more=estimators)
    assert who(told, told_of_it) == {"b"}
    assert max(seen.step[name] for name in "acd") < HARD
    assert seen.apart > 0.6
    assert who(told, "landed") == set("abcd")


@pytest.mark.thorough
def test_two_that_brake_each_other_in_formation_land_where_they_are(tmp_path: Path) -> None:
    seen, told = formation_flight(
        tmp_path,
        emitted=((FROM + 4.0, "operator.all_down"),),
        shape="points: [[0, 1.8, 0], [0, 0.4, 0], [0, -0.4, 0], [0, -1.8, 0]]",
        more="supervisors: [{use: proximity, distance: 90 cm}]",
    )
    assert who(told, "too_close") == {"b", "c"}
    assert who(told, "landed") == set("abcd")
    assert seen.apart > 0.6
    apart = [distance(seen.landed[a], seen.landed[b]) for a, b in combinations("abcd", 2)]
    assert min(apart) > 0.6
