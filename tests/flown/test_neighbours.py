"""Vehicles that are in each other's way when they land."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from toolchain import compiled, flight_of

from kybflow.api.flight import Flown
from kybflow.core.signals import Event

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
        plan = compiled(
            tmp_path / "mission.yaml",
            MISSION.format(goal=goal, over=over, at=at, apart=apart),
            warns=True,
        )
        run, told = flight_of(plan, tmp_path / "run", emitted=emitted)
        assert [event for event in told if event.name == "collided"] == []
        return run, told

    return flight_past


def times(told: list[Event], name: str) -> dict[str, float]:
    """When each vehicle told the event first."""
    return {e.vehicle: e.time / 1e9 for e in reversed(told) if e.name == name}


def test_it_does_not_land_on_one_that_hovers_below_but_beside(flight_past) -> None:
    run, told = flight_past(ABOVE)
    [waits] = [event for event in told if event.name == "behavior_waits"]
    assert (waits.vehicle, waits.fields["reason"]) == ("b", "`a` is below")
    assert times(told, "landed")["b"] < times(told, "landed")["a"] - 5.0
    assert run.summary["outcome"] == "succeeded"


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
        (ABOVE, "operator.land"),
        (BESIDE, "operator.down_all"),
        pytest.param(ABOVE, "operator.down_all", marks=pytest.mark.thorough),
        pytest.param(BESIDE, "operator.land", marks=pytest.mark.thorough),
    ],
)
def test_two_neighbours_land_when_they_are_asked_to(
    flight_past, order: str, goal: list[float]
) -> None:
    run, told = flight_past(goal, (9.0, order), over=30.0, apart="finally distance(a to b) > 20 cm")
    assert (set(times(told, "too_close")) == {"a", "b"}) is (goal is BESIDE)
    assert max(times(told, "landed").values()) < 17.0
    assert run.summary["outcome"] == "succeeded"


def test_over_a_point_where_another_stands_it_waits_and_then_lands_beside(flight_past) -> None:
    _, told = flight_past(ABOVE, at=", position: [0, 0, 0], patience: 2 s")
    [failed] = [event for event in told if event.name == "behavior_failed"]
    assert failed.fields["reason"] == "`a` is below for 2 s"
    assert times(told, "landed")["b"] < times(told, "landed")["a"]
