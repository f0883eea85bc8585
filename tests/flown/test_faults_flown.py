"""Every fault in flight: it does what it says, is told, and the vehicle comes down."""

from __future__ import annotations

import pytest
import short_flights
from plans import part, plan, state, then, vehicle
from short_flights import hold, hovers, named, path, up

from kybflow.api.flight import RunRequest, fly
from kybflow.dsl.plan import EstimatorPlan
from kybflow.parts import Driver, Link
from kybflow.parts.events import Collided
from kybflow.parts.link import ReportsTouches
from kybflow.runtime.events import Events
from kybflow.world.shapes import Box

FAULTS = {
    "mocap_dropout": {"share": 0.5},
    "mocap_noise": {"position": 0.01},
    "gust": {"velocity": (1.0, 0.0, 0.0)},
    "wind": {"velocity": (1.0, 0.0, 0.0)},
    "push": {"acceleration": (0.5, 0.0, 0.0)},
    "battery_sag": {"by": 0.1},
    "mass_change": {"factor": 1.2},
    "rotor_weak": {"left": 0.9},
    "imu_bias_step": {"gyro": (0.02, 0.0, 0.0), "accelerometer": (0.1, 0.0, 0.1)},
    "clock_late": {"by": 0.02},
}
QUICK = ("gust", "clock_late")


def fault(name, on="a", time=3.0, lasts=1.0, **params):
    return short_flights.fault(name, time, lasts, on, **params)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The position error while it hovers with nothing broken."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    return hover_error(fly(plan(hovers()), RunRequest(out=folder)))


def hover_error(flown):
    return flown.summary["vehicles"]["a"]["behaviors"][1]["position_error_m"]


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.thorough) for n in FAULTS]
)
def test_a_vehicle_feels_it_flies_through_it_and_it_is_told(run, undisturbed, name):
    flown, told = run(hovers(), faults=(fault(name, **FAULTS[name]),))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["outcome"] == "succeeded"
    [began], [ended] = named(told, "fault_injected"), named(told, "fault_ended")
    assert (began.vehicle, began.fields, began.at) == ("a", {"fault": name}, "m.yaml:9")
    assert ended.time - began.time == 1_000_000_000
    assert hover_error(flown) != undisturbed


@pytest.mark.thorough
@pytest.mark.parametrize(("lasts", "ends"), [(0.2, "landed"), (1.0, "fault")])
def test_a_short_cut_of_the_link_is_nothing_and_a_long_one_brings_it_down(run, lasts, ends):
    """The vehicle's own watchdog waits for 250 ms."""
    flown, told = run(hovers(), faults=(fault("link_cut", lasts=lasts),))
    assert path(told, "a")[-1] == ends
    assert (flown.summary["outcome"] == "succeeded") is (ends == "landed")
    assert len(named(told, "link_lost")) == (ends == "fault")


def test_a_swap_of_two_in_flight_ends_on_the_ground(run):
    two = (hovers(), hovers(name="b", start=(0.6, 0.0, 0.0)))
    _, told = run(*two, faults=(fault("mocap_swap", other="b", lasts=None),))
    assert {e.vehicle for e in named(told, "landed")} == {"a", "b"}


@pytest.mark.thorough
def test_an_estimator_that_is_killed_is_told_and_the_vehicle_lands_on_the_next(run):
    estimators = tuple(
        EstimatorPlan(one, recover_after=1.0)
        for one in (part("estimators", "mocap"), part("estimators", "fusion", source="mocap"))
    )
    killed = fault("estimator_killed", estimator="mocap")
    _, told = run(hovers(estimators=estimators), faults=(killed,))
    [failed] = named(told, "part_failed")
    assert failed.fields["part"] == "estimators.mocap"
    assert failed.fields["reason"] == "RuntimeError: killed by a fault of the mission"
    assert named(told, "estimator_changed")[-1].fields["estimator"] == "fusion"
    assert path(told, "a") == ["up", "auto_land", "fault"]


@pytest.mark.thorough
def test_a_fault_that_cannot_be_injected_fails_the_run(run):
    flown, told = run(hovers(), faults=(fault("mocap_swap", other="nobody"),))
    assert path(told, "a")[-1] == "landed"
    assert flown.summary["outcome"] != "succeeded"
    assert "mocap_swap" in flown.summary["reason"]


@pytest.mark.thorough
def test_the_seed_of_the_run_is_that_of_its_faults(run):
    def error():
        return hover_error(run(hovers(), faults=(fault("mocap_dropout", share=0.5),))[0])

    assert error() == error()


@pytest.mark.thorough
def test_a_vehicle_that_runs_into_an_obstacle_has_not_flown_its_mission(run):
    beam = Box((-0.5, -0.5, 0.5), (0.5, 0.5, 0.6))
    flown, told = run(hovers(), obstacles={"beam": beam}, time_limit=10.0)
    [collided, *_] = named(told, "collided")
    assert (collided.vehicle, collided.fields) == ("a", {"into": "beam"})
    assert flown.summary["outcome"] != "succeeded"


def test_a_vehicle_that_hits_the_floor_in_flight_has_not_flown_its_mission(run):
    """It is too heavy for a moment, drops onto the floor, and flies on to its end."""
    flown, told = run(
        hovers(height=0.3), faults=(fault("mass_change", time=4.0, lasts=0.4, factor=3.0),)
    )
    [collided] = named(told, "collided")
    assert collided.fields == {"into": "the floor"}
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["reason"] == "`a` ran into `the floor`"


@pytest.mark.thorough
def test_on_the_way_to_where_it_lands_the_floor_is_no_place_to_touch_down(run):
    there = part("behaviors", "land", position=(2.0, 0.0, 0.0))
    states = [up("hold", height=0.3), hold(0.5, "down"), state("down", there, then("landed"))]
    falls = fault("mass_change", time=6.0, lasts=0.4, factor=3.0)
    _, told = run(vehicle("a", states), faults=(falls,), time_limit=8.0)
    [collided] = named(told, "collided")
    assert path(told[: told.index(collided)], "a") == ["up", "hold", "down"]


def test_a_landing_that_is_too_hard_is_told_with_its_speed_and_is_no_success(run):
    flown, told = run(hovers(), faults=(fault("mass_change", time=8.0, lasts=2.0, factor=4.0),))
    [hard] = named(told, "landed_hard")
    assert hard.fields["onto"] == "the floor"
    assert 1.5 < hard.fields["speed"] < 3.0
    assert named(told, "collided") == []
    assert f"landed hard ({hard.fields['speed']:.2f} m/s)" in flown.summary["reason"]


def test_nobody_hears_a_collision_but_who_records():
    told = []
    events = Events((told.append,))
    events.turn(0)
    events.emit(Collided(into="b"), "a")
    events.turn(1)
    assert [e.name for e in told] == ["collided"]
    assert events.heard("a") == frozenset()


def test_a_link_without_a_simulator_has_no_rig_and_knows_no_touches():
    class Wire(Link):
        def read(self, now):
            return ()

        def send(self, command, now):
            pass

    assert Wire().faults is None
    assert not isinstance(Wire(), ReportsTouches)
    assert Driver.watchdog(None) is None
