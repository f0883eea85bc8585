"""What a person gives while a mission flies."""

from __future__ import annotations

import pytest
from plans import part, plan, state, vehicle
from short_flights import down, hold, named, path, up

from kybflow.core.errors import EventRefused
from kybflow.core.signals import NS
from kybflow.dsl.plan import CallbackPlan, Emit, LogText, TransitionPlan
from kybflow.runtime.commanding.awaited import check_emitted


def idle(target: str):
    go = TransitionPlan("next", target, event="operator.go")
    return state("idle", part("behaviors", "wait_on_ground"), go)


def waiting():
    return vehicle("a", [idle("up"), up("hold"), hold(1.0, "down"), down()])


def held(seconds: float = 60.0):
    return vehicle("a", [up("hold"), hold(seconds, "down"), down()])


def test_an_event_is_given_at_its_time_and_heard_in_the_next_tick(run):
    flown, told = run(waiting(), emitted=((2.0, "operator.go"),))
    [given] = named(told, "operator.go")
    assert (given.time, given.vehicle) == (2 * NS, "")
    left = next(e for e in named(told, "behavior_ended") if e.fields["behavior"] == "idle")
    assert left.time == 2 * NS + NS // 250
    assert path(told, "a") == ["idle", "up", "hold", "down", "landed"]
    assert flown.exit_code == 0


def test_events_are_given_in_the_order_of_their_times(run):
    _, told = run(waiting(), emitted=((3.0, "operator.land"), (0.5, "operator.go")))
    assert [e.name for e in told if e.name.startswith("operator.")] == [
        "operator.go",
        "operator.land",
    ]


def test_pause_holds_and_resume_goes_on_with_the_same(run):
    calm, _ = run(held(2.0))
    paused, told = run(held(2.0), emitted=((6.0, "operator.pause"), (9.0, "operator.resume")))
    assert [e.name for e in told if e.name in ("paused", "resumed")] == ["paused", "resumed"]
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert paused.summary["sim_time_s"] > calm.summary["sim_time_s"] + 2.9
    assert paused.exit_code == 0


def test_land_lands(run):
    flown, told = run(held(), emitted=((8.0, "operator.land"),))
    assert path(told, "a") == ["up", "hold", "auto_land", "landed"]
    assert flown.exit_code == 0


def test_stop_lands_and_ends_a_vehicle_that_waits_on_the_ground_too(run):
    flying = vehicle("b", [up("hold"), hold(60.0, "down"), down()], start=(1.0, 1.0, 0.0))
    flown, told = run(waiting(), flying, emitted=((8.0, "operator.stop"),))
    assert named(told, "run_stopped")[0].fields == {"reason": "stopped by the operator"}
    assert path(told, "a") == ["idle", "landed"]
    assert path(told, "b")[-1] == "landed"
    assert flown.exit_code == 0


def test_what_nothing_waits_for_is_refused_with_the_nearest():
    with pytest.raises(EventRefused, match=r"`operator\.og`; did you mean `operator\.go`\?"):
        check_emitted(plan(waiting()), ["operator.og"])


@pytest.mark.parametrize("name", ["a.landed", "landed", "run_started"])
def test_nobody_can_give_an_event_of_the_engine(name: str):
    heard = CallbackPlan("landed", ("a",), (LogText("down"),))
    with pytest.raises(EventRefused, match="the mission doesn't wait for"):
        check_emitted(plan(waiting(), callbacks=(heard,)), [name])


def test_a_mission_s_own_event_and_the_commands_can_be_given():
    own = (
        CallbackPlan("landed", ("a",), (Emit("ready"),)),
        CallbackPlan("ready", ("",), (LogText("ready"),)),
    )
    check_emitted(plan(held(), callbacks=own), ["ready", "operator.pause", "operator.stop"])
