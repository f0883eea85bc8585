"""What is asked of a vehicle: who is heard, and why somebody is not."""

from __future__ import annotations

import pytest
from failsafe_parts import orders
from plans import part, state, then, vehicle
from short_flights import NoParams, Still, down, hold, named, path, up

from kybflow.core.errors import Refused
from kybflow.core.signals import SetpointKind
from kybflow.dsl.plan import TransitionPlan
from kybflow.parts import AIR
from kybflow.runtime.vehicle.requests import Requester


class Shut(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: NoParams, entry) -> None:
        raise Refused("the door is shut")


class Bad(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
    def __init__(self, params: NoParams, entry) -> None:
        raise KeyError("not there")


def flight(*more, **facts):
    side = state("side", part("behaviors", "fly_to", position=(0.5, 0.0, 0.6)), then("down"))
    return vehicle("a", [up("hold"), hold(4.0, "down"), side, *more, down()], **facts)


def refusals(told):
    return [(e.fields["state"], e.fields["by"], e.fields["reason"], e.at)
            for e in named(told, "switch_refused")]  # fmt: skip


@pytest.mark.thorough
def test_a_granted_wish_leaves_the_state_with_how_asked_and_says_who_asked(run):
    ask = orders((5.0, lambda v: v.requests.switch("side", Requester.FLOW, "m.yaml:9")))
    _, told = run(flight(), observers=(ask,))
    assert path(told, "a") == ["up", "hold", "side", "down", "landed"]
    [left] = [e for e in named(told, "behavior_ended") if e.fields["behavior"] == "hold"]
    assert (left.fields["how"], left.at) == ("asked", "m.yaml:9")


@pytest.mark.thorough
def test_of_several_in_one_tick_the_operator_is_heard_and_the_others_are_told(run):
    def all_of_them(v):
        v.requests.switch("hold", Requester.CALLBACK, "m.yaml:1")
        v.requests.switch("side", Requester.FLOW, "m.yaml:2")
        v.requests.switch("down", Requester.OPERATOR)
        v.requests.switch("down", Requester.CALLBACK, "m.yaml:3")

    _, told = run(flight(), observers=(orders((5.0, all_of_them)),))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    because = "the operator requested `down` in the same tick"
    assert refusals(told) == [
        ("hold", "callback", because, "m.yaml:1"),
        ("side", "flow", because, "m.yaml:2"),
    ]


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        ("up", "`take_off` can't start while the vehicle is in the air"),
        pytest.param(
            "landed",
            "`wait_on_ground` can't start while the vehicle is in the air",
            marks=pytest.mark.thorough,
        ),
        pytest.param(
            "fault", "it is not a state that can be requested", marks=pytest.mark.thorough
        ),
        ("nowhere", "it is not a state that can be requested"),
        ("shut", "the door is shut"),
    ],
)
def test_what_can_not_be_entered_is_refused_and_nothing_changes(run, goal, reason):
    shut = state("shut", Shut, then("down"))
    ask = orders((5.0, lambda v: v.requests.switch(goal, Requester.CALLBACK, "m.yaml:4")))
    flown, told = run(flight(shut), observers=(ask,))
    assert refusals(told) == [(goal, "callback", reason, "m.yaml:4")]
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    [visit] = [b for b in flown.summary["vehicles"]["a"]["behaviors"] if b["name"] == "hold"]
    assert visit["end_s"] - visit["start_s"] == pytest.approx(4.0, abs=0.05)


def test_an_arrow_hears_the_refusal(run):
    listening = state(
        "hold",
        part("behaviors", "hover"),
        TransitionPlan(target="down", event="switch_refused"),
    )
    ask = orders((5.0, lambda v: v.requests.switch("up", Requester.FLOW)))
    _, told = run(vehicle("a", [up("hold"), listening, down()]), observers=(ask,))
    assert path(told, "a") == ["up", "hold", "down", "landed"]


def test_a_wish_whose_behavior_raises_lands(run):
    ask = orders((5.0, lambda v: v.requests.switch("bad", Requester.FLOW)))
    _, told = run(flight(state("bad", Bad, then("down"))), observers=(ask,))
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    [failed] = named(told, "part_failed")
    assert failed.fields["part"] == "behaviors.bad"
    assert failed.fields["reason"] == "KeyError: 'not there'"


def test_a_persons_wish_ends_a_pause(run):
    asks = orders(
        (5.0, lambda v: v.requests.pause("x")),
        (6.0, lambda v: v.requests.switch("side", Requester.OPERATOR)),
    )
    _, told = run(flight(), observers=(asks,))
    assert path(told, "a") == ["up", "hold", "side", "down", "landed"]


def test_a_flow_ends_no_pause_but_may_land(run):
    asks = orders(
        (5.0, lambda v: v.requests.pause("x")),
        (6.0, lambda v: v.requests.switch("side", Requester.FLOW)),
        (7.0, lambda v: v.requests.switch("down", Requester.FLOW)),
    )
    _, told = run(flight(), observers=(asks,))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    [refused] = named(told, "switch_refused")
    assert refused.fields["reason"] == "it is paused"


def test_processors_are_switched_off_and_on_but_no_safety_part(run):
    def all_of_them(v):
        v.requests.enable("processors.limit_speed", False, "callback", "m.yaml:5")
        v.requests.enable("processors.fence", False, "callback", "m.yaml:6")
        v.requests.enable("supervisors.battery", False, "callback", "m.yaml:7")

    asks = orders(
        (5.0, all_of_them),
        (6.0, lambda v: v.requests.enable("processors.limit_speed", True, "flow")),
    )
    limits = part("processors", "limit_speed", speed=0.3), part("processors", "fence")
    _, told = run(flight(processors=limits), observers=(asks,))
    [off], [on] = named(told, "processor_disabled"), named(told, "processor_enabled")
    assert (off.fields, off.at) == (
        {"processor": "processors.limit_speed", "by": "callback"}, "m.yaml:5",
    )  # fmt: skip
    assert on.fields["by"] == "flow"
    assert [(e.fields["option"], e.fields["reason"]) for e in named(told, "option_refused")] == [
        ("a.processors.fence", "a safety part can't be switched off"),
        ("a.supervisors.battery", "only processors can be switched on and off"),
    ]


def test_a_run_that_is_told_to_stop_lands_and_has_ended_as_it_should(run):
    def stop(engine):
        if engine.seconds() >= 5.0:
            engine.stop("enough")
        if engine.seconds() >= 5.5:
            engine.vehicles[0].requests.switch("hold", Requester.OPERATOR)

    flown, told = run(flight(), observers=(stop,))
    assert path(told, "a") == ["up", "hold", "auto_land", "landed"]
    assert refusals(told)[0][2] == "the run ends: enough"
    assert flown.exit_code == 0
