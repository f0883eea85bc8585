"""What callbacks mean: groups and `any` become vehicles, values SI, names what they stand for."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_writing import without_places
from toolchain import compiled, result_of

from kybflow.dsl.compiler import Result
from kybflow.dsl.expressions import InState
from kybflow.dsl.plan import (
    CallbackPlan,
    Emit,
    Enable,
    EnterPhase,
    LogText,
    SetOption,
    Stop,
    Switch,
)

HEAD = """\
kybflow: 1
mission: m
import: {std: kybflow/airframes}
groups: {both: [a, b]}
expect: [finally all both in landed]
world:
  fence: {from: [-3, -3, 0], to: [3, 3, 2.5]}
vehicles:
  a:
    like: std.nano_plus
    behaviors:
      up:   {do: take_off, height: 1 m, then: hold NEXT}
      hold: {do: hover, for_time: 3 s, then: down}
      down: {do: land}
  b: {like: a, start: {at: [1, 1, 0]}}
"""


def checked(folder: Path, on: str, arrows: str = "") -> Result:
    return result_of(folder / "m.yaml", HEAD.replace(" NEXT", arrows) + on)


def meant(folder: Path, on: str) -> tuple[CallbackPlan, ...]:
    return compiled(folder / "m.yaml", HEAD.replace(" NEXT", "") + on).callbacks


@pytest.mark.parametrize(
    ("event", "heard"),
    [
        ("a.landed", ("landed", ("a",))),
        ("any.landed", ("landed", ("a", "b"))),
        ("both.landed", ("landed", ("a", "b"))),
        ("run_started", ("run_started", ("",))),
        ("operator.go", ("operator.go", ("",))),
        ("half.way", ("half.way", ("",))),
    ],
)
def test_whose_event_it_is(event: str, heard: tuple[str, tuple[str, ...]], tmp_path: Path) -> None:
    other = "{event: a.took_off, do: [{emit: half.way}]}"
    callback = meant(tmp_path, f"on: [{{event: {event}, do: [{{log: it}}]}}, {other}]\n")[0]
    assert (callback.event, callback.vehicles) == heard


def test_every_action_is_lowered_in_its_place(tmp_path: Path) -> None:
    on = """\
on:
  - event: a.behavior_ended
    behavior: hold
    when: b in hold
    do:
      - switch: {both: down}
      - set: {both.processors.limit_speed.speed: 50 cm/s, a.tracker.tilt: 10 deg}
      - disable: both.processors.limit_speed
      - enable: a.processors.limit_speed
      - emit: ready
      - log: "{vehicle} left {behavior}"
      - stop: over
"""
    [callback] = meant(tmp_path, on)
    assert callback.fields == (("behavior", "hold"),)
    assert callback.when == InState("b", "hold")
    assert callback.at.endswith("m.yaml:17")
    tilt = SetOption("a.tracker.tilt", pytest.approx(0.17453, abs=1e-5))
    assert callback.actions == (
        Switch("a", "down"),
        Switch("b", "down"),
        SetOption("a.processors.limit_speed.speed", 0.5),
        SetOption("b.processors.limit_speed.speed", 0.5),
        tilt,
        Enable("a", "processors.limit_speed", False),
        Enable("b", "processors.limit_speed", False),
        Enable("a", "processors.limit_speed", True),
        Emit("ready"),
        LogText("{vehicle} left {behavior}"),
        Stop("over"),
    )


FLOW = """\
flows:
  tour:
    phases:
      climb: {run: {both: up}, within: 20 s, otherwise: away}
      away:  {run: {both: down}}
"""


@pytest.mark.parametrize("phase", ["away", "{tour: away}"])
def test_a_phase_belongs_to_a_flow(phase: str, tmp_path: Path) -> None:
    on = FLOW + f"on: [{{event: any.failsafe_started, do: [{{phase: {phase}}}]}}]\n"
    assert meant(tmp_path, on)[0].actions == (EnterPhase("tour", "away"),)


def test_a_state_that_only_a_callback_asks_for_is_reached(tmp_path: Path) -> None:
    arrows = "}\n      home: {do: hover, for_time: 1 s, then: down"
    asked = "on: [{event: b.landed, do: [{switch: {both: home}}]}]\n"
    assert [d.code for d in checked(tmp_path, "", arrows).diagnostics] == ["KYB204"]
    assert checked(tmp_path, asked, arrows).diagnostics == ()


def test_a_chain_that_is_asked_for_is_entered_by_its_first_state(tmp_path: Path) -> None:
    arrows = "}\n      tour: {do: chain.look, then: down"
    on = """\
chains:
  look: {behaviors: {one: {do: hover, for_time: 1 s, then: two}, two: {do: hover, for_time: 1 s}}}
on: [{event: any.took_off, do: [{switch: {a: tour}}, {switch: {b: tour}}]}]
"""
    result = checked(tmp_path, on, arrows)
    assert result.diagnostics == ()
    assert result.plan is not None
    assert result.plan.callbacks[0].actions == (Switch("a", "tour.one"), Switch("b", "tour.one"))


def test_an_arrow_does_not_hear_a_group(tmp_path: Path) -> None:
    [found] = checked(tmp_path, "", ", next: [{event: both.landed, go: brake}]").diagnostics
    assert (found.code, found.help) == ("KYB208", "did you mean `b.landed`?")
    assert checked(tmp_path, "", ", next: [{event: any.landed, go: brake}]").diagnostics == ()


def test_they_are_written_so_that_they_read_back_the_same(tmp_path: Path) -> None:
    on = """\
on:
  - {event: any.estimator_changed, estimator: mocap, do: [{log: "{vehicle}: it's on {estimator}"}]}
  - {event: both.landed, when: a in landed, do: [{switch: {b: down}}, {stop: "enough, really"}]}
  - {event: a.took_off, do: [{set: {both.tracker.tilt: 10 deg}}]}
  - {event: operator.fast, do: [{disable: a.processors.limit_speed}]}
"""
    first = checked(tmp_path, on).plan
    assert first is not None
    again = compiled(tmp_path / "resolved.yaml", first.resolved)
    assert without_places(again) == without_places(first)
