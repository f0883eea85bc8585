"""Every reaction of the failsafe, flown: what it does, when it is over, what it says."""

from __future__ import annotations

import pytest
from failsafe_parts import LINE, alarming, followed, largest_steps, orders
from plans import part, state, then, vehicle
from short_flights import down, hold, hovers, named, path, up

from kybflow.core.signals import NS, Reaction
from kybflow.dsl.plan import TransitionPlan
from kybflow.runtime.vehicle.requests import Requester

CUT, LAND_BLIND, LAND, GO_HOME, BRAKE, WARN = sorted(Reaction, reverse=True)


def flight(*supervisors, **more):
    always = vehicle("a", [down()]).supervisors
    away = state("away", part("behaviors", "fly_to", position=(0.6, 0.0, 0.6)), then("hold"))
    states = [up("away"), away, hold(4.0, "down"), down()]
    return vehicle("a", states, supervisors=(*always, *supervisors), **more)


@pytest.mark.parametrize(
    ("reaction", "way"),
    [
        (WARN, ["down", "landed"]),
        (BRAKE, ["down", "landed"]),
        (GO_HOME, ["auto_home", "auto_land", "fault"]),
        (LAND, ["auto_land", "fault"]),
        (LAND_BLIND, ["land_blind", "auto_land", "fault"]),
        (CUT, ["fault"]),
    ],
)
def test_each_reaction_goes_its_own_way_and_ends_on_the_ground(run, reaction, way):
    flown, told = run(flight(alarming((8.0, 8.2, reaction))))
    assert path(told, "a") == ["up", "away", "hold", *way]
    assert flown.summary["vehicles"]["a"]["final"] == "ground"
    assert flown.exit_code == (1 if way[-1] == "fault" else 0)


def test_its_event_carries_the_reason_the_value_the_bound_and_the_mission_line(run):
    _, told = run(flight(alarming((8.0, 8.2, LAND))))
    expected = {"reaction": "land", "reason": "the test says so", "value": 2.0, "bound": 1.0}
    for name in ("alarmed", "failsafe_started"):
        [event] = named(told, name)
        assert (event.fields, event.at) == (expected, LINE)


@pytest.mark.thorough
def test_the_severest_of_a_tick_wins(run):
    first, second = (alarming((8.0, 8.2, r), event=r.name.lower()) for r in (GO_HOME, LAND_BLIND))
    _, told = run(flight(first, second))
    reactions = [e.fields["reaction"] for e in named(told, "failsafe_started")]
    assert reactions == ["land_blind", "land"]
    assert {e.name for e in told} >= {"go_home", "land_blind"}


@pytest.mark.thorough
def test_what_is_latched_gives_way_to_what_is_severer_and_to_nothing_else(run):
    alarms = alarming((7.0, 7.2, GO_HOME), (7.5, 7.7, BRAKE), (8.0, 8.2, LAND), (8.5, 9.0, GO_HOME))
    _, told = run(flight(alarms))
    assert path(told, "a") == ["up", "away", "hold", "auto_home", "auto_land", "fault"]
    reactions = [e.fields["reaction"] for e in named(told, "failsafe_started")]
    assert reactions == ["go_home", "land"]


@pytest.mark.thorough
def test_go_home_lands_at_the_start(run):
    where = []

    def look(engine):
        where.append(engine.vehicles[0].truth.position)

    run(flight(alarming((8.0, 8.2, GO_HOME))), observers=(look,))
    assert where[0] == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    assert where[-1] == pytest.approx((0.0, 0.0, 0.0), abs=0.1)
    assert max(z for _, _, z in where) == pytest.approx(1.0, abs=0.1)


def test_cut_is_watched_until_the_vehicle_has_fallen(run):
    flown, told = run(flight(alarming((8.0, 8.2, CUT))))
    [started] = named(told, "failsafe_started")
    assert flown.summary["sim_time_s"] - started.time / NS == pytest.approx(2.0, abs=0.01)


@pytest.mark.thorough
def test_a_brake_ends_a_second_after_its_alarms_and_the_mission_goes_on(run):
    circle = part("behaviors", "circle", center=(0.0, 0.0, 0.6), radius=0.5, speed=0.5, laps=1.0)
    tracker, samples = followed()
    states = [up("circle"), state("circle", circle, then("down")), down()]
    plan = {"supervisors": (alarming((6.0, 6.5, BRAKE)),), "tracker": tracker}
    flown, told = run(vehicle("a", states, **plan))
    assert path(told, "a") == ["up", "circle", "down", "landed"]
    [started], [ended] = named(told, "failsafe_started"), named(told, "failsafe_ended")
    assert started.time / NS == pytest.approx(6.0, abs=0.005)
    assert ended.time / NS == pytest.approx(7.5, abs=0.01)
    assert ended.fields == {"reaction": "brake", "alarm": "alarmed"}
    assert flown.exit_code == 0
    position, velocity = largest_steps(samples)
    assert position <= 0.5 * 0.004 + 1e-6
    assert velocity <= 0.01


@pytest.mark.thorough
def test_two_alarms_brake_until_both_are_silent(run):
    one = alarming((6.0, 6.5, BRAKE), event="one")
    two = alarming((6.2, 8.0, BRAKE), event="two")
    _, told = run(flight(one, two))
    [ended] = named(told, "failsafe_ended")
    assert ended.time / NS == pytest.approx(9.0, abs=0.01)
    assert ended.fields["alarm"] == "one and two"


@pytest.mark.thorough
def test_a_brake_that_comes_again_holds_for_good_and_lands(run):
    alarms = alarming((6.0, 6.5, BRAKE), (9.0, 9.5, BRAKE))
    flown, told = run(flight(alarms, hover_limit=5.0))
    assert len(named(told, "failsafe_ended")) == 1
    assert path(told, "a")[-2:] == ["auto_land", "landed"]
    [home] = [e for e in named(told, "behavior_started") if e.fields["behavior"] == "auto_land"]
    assert home.time / NS == pytest.approx(9.0 + 5.0, abs=0.05)
    assert "held for 5 s" in flown.summary["reason"]
    assert flown.exit_code == 1


@pytest.mark.thorough
def test_a_brake_whose_cause_passes_ends_a_second_time_once_the_vehicle_stands(run):
    alarms = alarming((6.0, 6.1, BRAKE), (9.0, 9.1, BRAKE), passes=True)
    flown, told = run(flight(alarms))
    assert [e.time / NS for e in named(told, "failsafe_ended")] == [
        pytest.approx(7.1, abs=0.02),
        pytest.approx(9.1 + 5.0, abs=0.02),
    ]
    assert flown.exit_code == 0


@pytest.mark.thorough
def test_a_third_brake_holds_for_good_even_so(run):
    times = (6.0, 6.1, BRAKE), (9.0, 9.1, BRAKE), (15.0, 15.1, BRAKE)
    flown, told = run(flight(alarming(*times, passes=True), hover_limit=8.0))
    assert len(named(told, "failsafe_ended")) == 2
    [home] = [e for e in named(told, "behavior_started") if e.fields["behavior"] == "auto_land"]
    assert home.time / NS == pytest.approx(15.0 + 8.0, abs=0.05)
    assert "held for 8 s" in flown.summary["reason"]


@pytest.mark.thorough
def test_a_brake_that_holds_for_good_does_not_stop_within(run):
    """Its behavior never goes on, so that only a landing is left of what it may take."""
    late = TransitionPlan(target="away", cause="within", after=4.0)
    timed = state("timed", part("behaviors", "hover", for_time=20.0), then("down"), late)
    alarms = alarming((4.0, 4.5, BRAKE), (7.0, 7.5, BRAKE))
    always = vehicle("a", [down()]).supervisors
    flown, told = run(vehicle("a", [up("timed"), timed, down()], supervisors=(*always, alarms)))
    assert path(told, "a") == ["up", "timed", "auto_land", "landed"]
    [home] = [e for e in named(told, "behavior_started") if e.fields["behavior"] == "auto_land"]
    assert 7.0 < home.time / NS < 7.0 + 4.0
    assert "`timed` failed: held for" in flown.summary["reason"]


@pytest.mark.thorough
def test_a_brake_that_lasts_lands_though_its_alarm_goes_on(run):
    flown, told = run(flight(alarming((6.0, 99.0, BRAKE)), hover_limit=3.0))
    assert path(told, "a")[-2:] == ["auto_land", "landed"]
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


def test_while_it_brakes_only_what_brings_it_down_is_granted(run):
    asks = orders(
        (6.5, lambda v: v.requests.switch("hold", Requester.FLOW)),
        (7.0, lambda v: v.requests.switch("down", Requester.FLOW)),
    )
    _, told = run(flight(alarming((6.0, 7.5, BRAKE))), observers=(asks,))
    [refused] = named(told, "switch_refused")
    assert refused.fields["reason"] == "the failsafe brakes it (alarmed)"
    assert path(told, "a")[-2:] == ["down", "landed"]


@pytest.mark.parametrize("reaction", [GO_HOME, LAND])
def test_a_latched_vehicle_accepts_only_what_is_severer(run, reaction):
    asks = orders(
        (7.2, lambda v: v.requests.switch("hold", Requester.OPERATOR)),
        (7.3, lambda v: v.requests.switch("down", Requester.OPERATOR)),
        (7.4, lambda v: v.requests.pause("operator")),
        (7.5, lambda v: v.requests.reset("operator")),
        (7.6, lambda v: v.requests.switch("land_blind", Requester.OPERATOR)),
    )
    _, told = run(flight(alarming((7.0, 7.1, reaction))), observers=(asks,))
    refused = [e.fields["state"] for e in named(told, "switch_refused")]
    assert refused == ["hold", "down"]
    [pause], [reset] = named(told, "pause_refused"), named(told, "reset_refused")
    assert pause.fields["reason"] == f"failsafe active ({reaction.name.lower()})"
    assert reset.fields["reason"] == "it is in the air"
    assert path(told, "a")[-2:] == ["land_blind", "fault"]


def test_no_brake_for_the_estimates_sake_stops_a_vehicle_that_comes_down(run):
    alarms = alarming((14.0, 14.5, BRAKE), event="estimate_lost")
    _, told = run(flight(alarms))
    [lost] = named(told, "estimate_lost")
    assert path(told[: told.index(lost)], "a")[-1] == "down"
    assert named(told, "failsafe_started") == []


@pytest.mark.thorough
def test_a_reset_on_the_ground_makes_it_fly_again(run):
    other = hovers(14.0, "b", start=(1.5, 0.0, 0.0))
    asks = orders(
        (14.0, lambda v: v.requests.switch("up", Requester.OPERATOR)),
        (14.5, lambda v: v.requests.reset("operator")),
        (15.0, lambda v: v.requests.switch("up", Requester.OPERATOR)),
    )
    flown, told = run(flight(alarming((7.0, 7.1, LAND))), other, observers=(asks,))
    [refused] = named(told, "switch_refused")
    assert refused.fields["reason"] == "it is in `fault`, until a person resets it"
    assert path(told, "a")[3:] == [
        "auto_land", "fault", "landed", "up", "away", "hold", "down", "landed",
    ]  # fmt: skip
    assert flown.exit_code == 0
