"""Whatever part of a vehicle fails, in whatever stage: it comes down by the gentlest way that is
left, its rotors never stop in the air, and nobody else is disturbed."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import pytest
from plans import part, state, then, vehicle, wrapped
from short_flights import NoParams, Still, down, hold, named, path, up

from kybflow.core.errors import DriverError, Refused
from kybflow.core.signals import NS, Setpoint, SetpointKind, Tick
from kybflow.dsl.plan import EstimatorPlan, PartPlan, TransitionPlan
from kybflow.flight.motion import IDLE
from kybflow.parts import AIR, GROUND, Behavior, Entry, Link, Supervisor
from kybflow.runtime.trackers.cascade import Cascade

AT = 6.0
"""When parts fail here, seconds: in the air, at rest."""


def broken(kind: str, name: str, method: str) -> PartPlan:
    """A part of the catalog whose `method` raises from `AT` on, at every call."""
    whole = part(kind, name)

    def failing(self, *arguments):
        [now] = [a.now if isinstance(a, Tick) else a for a in arguments if type(a) in (Tick, int)]
        if now >= AT * NS:
            raise ZeroDivisionError("a lab's own bug")
        return getattr(super(cls, self), method)(*arguments)

    cls = type(whole.cls.__name__, (whole.cls,), {method: failing})
    return replace(whole, cls=cls)


def flight(**more):
    return vehicle("a", [up("hold"), hold(20.0, "down"), down()], **more)


def rests_at_the_end(flown, told) -> bool:
    """On the ground, in `fault`."""
    return path(told, "a")[-1] == "fault" and flown.summary["vehicles"]["a"]["final"] == "ground"


def sinks_for(flown) -> float:
    """Seconds from the failure to the end of the run."""
    return flown.summary["sim_time_s"] - AT


def test_a_supervisor_that_raises_in_every_tick_lands_its_vehicle(run):
    flown, told = run(flight(supervisors=(broken("supervisors", "battery", "check"),)))
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert [e.fields["part"] for e in named(told, "part_failed")] == ["supervisors.battery"]
    assert rests_at_the_end(flown, told)


def test_without_any_supervisor_left_a_lost_estimate_still_lands_blind(run):
    estimator = EstimatorPlan(broken("estimators", "mocap", "update"), recover_after=1.0)
    flown, told = run(flight(estimators=(estimator,), supervisors=()))
    assert path(told, "a") == ["up", "hold", "land_blind", "fault"]
    assert [e.fields["part"] for e in named(told, "part_failed")] == ["estimators.mocap"]
    assert rests_at_the_end(flown, told)
    assert sinks_for(flown) > 1.0


def test_a_tracker_that_raises_in_every_tick_lands_blind(run):
    flown, told = run(flight(tracker=broken("trackers", "cascade", "update")))
    assert path(told, "a") == ["up", "hold", "auto_land", "land_blind", "fault"]
    assert {e.fields["part"] for e in named(told, "part_failed")} == {"trackers.cascade"}
    assert rests_at_the_end(flown, told)
    assert sinks_for(flown) > 1.0


def test_a_warning_before_the_rotors_turn_does_not_make_a_flight_a_stand(run):
    low = part("drivers", "sim", battery=0.25)
    flown, told = run(flight(driver=low, tracker=broken("trackers", "cascade", "update")))
    assert named(told, "battery_low")[0].time < NS
    assert path(told, "a") == ["up", "hold", "auto_land", "land_blind", "fault"]
    assert sinks_for(flown) > 1.0


@pytest.mark.parametrize("believed", [nan, 0.0, 1e9, None])
def test_land_blind_starts_whatever_the_tracker_believes(run, believed):
    class Mad(Cascade):
        @property
        def hover_thrust(self):
            if believed is None:
                raise ValueError("no idea")
            return believed

        def update(self, setpoint, tick):
            if tick.now >= AT * NS:
                return super().update(setpoint, tick)._replace(thrust=nan)
            return super().update(setpoint, tick)

    flown, told = run(flight(tracker=replace(part("trackers", "cascade"), cls=Mad)))
    assert path(told, "a")[-2:] == ["land_blind", "fault"]
    assert 1.0 < sinks_for(flown) < 14.0
    assert rests_at_the_end(flown, told)


@pytest.mark.parametrize("name", ["limit_speed", "position_error"])
def test_a_processor_that_raises_is_left_out_and_the_vehicle_lands(run, name):
    processors = (broken("processors", name, "__call__"), part("processors", "fence"))
    flown, told = run(flight(processors=processors))
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert [e.fields["part"] for e in named(told, "part_failed")] == [f"processors.{name}"]
    assert rests_at_the_end(flown, told)


def test_a_velocity_that_is_not_finite_is_the_behaviors_failure(run):
    class NotFinite(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
        def update(self, tick: Tick) -> Setpoint:
            return self.setpoint._replace(velocity=(nan, 0.0, 0.0))

    flown, told = run(vehicle("a", [up("nan"), state("nan", NotFinite, then("down")), down()]))
    assert path(told, "a") == ["up", "nan", "auto_land", "fault"]
    assert named(told, "part_failed")[0].fields["part"] == "behaviors.nan"
    assert rests_at_the_end(flown, told)


def test_a_behavior_can_not_rest_the_rotors_in_the_air(run):
    class Resting(Still, flight=AIR >> AIR, emits=SetpointKind.POSITION):
        def update(self, tick: Tick) -> Setpoint:
            return IDLE

    flown, told = run(vehicle("a", [up("rest"), state("rest", Resting, then("down")), down()]))
    assert path(told, "a") == ["up", "rest", "auto_land", "fault"]
    assert rests_at_the_end(flown, told)


class Unmakable(Still, flight=(AIR >> AIR, GROUND >> GROUND), emits=SetpointKind.POSITION):
    def __init__(self, params: NoParams, entry: Entry) -> None:
        raise KeyError("not there")


def test_a_behavior_whose_constructor_raises_in_the_air_lands(run):
    flown, told = run(vehicle("a", [up("bad"), state("bad", Unmakable, then("down")), down()]))
    assert path(told, "a") == ["up", "bad", "auto_land", "fault"]
    assert named(told, "part_failed")[0].fields == {
        "part": "behaviors.bad",
        "reason": "KeyError: 'not there'",
    }
    assert rests_at_the_end(flown, told)


def test_a_first_behavior_whose_constructor_raises_stays_on_the_ground(run):
    flown, told = run(vehicle("a", [state("bad", Unmakable, then("up")), up("down"), down()]))
    assert path(told, "a") == ["bad", "fault"]
    assert flown.exit_code == 1
    assert flown.summary["sim_time_s"] < 1.0


def test_a_tracker_that_fails_before_the_rotors_turn_never_turns_them(run):
    class Never(Cascade):
        def update(self, setpoint, tick):
            raise ValueError("not today")

    flown, told = run(flight(tracker=replace(part("trackers", "cascade"), cls=Never)))
    assert path(told, "a") == ["up", "fault"]
    assert flown.summary["sim_time_s"] < 1.0


def test_a_part_that_can_not_be_made_is_the_reason_why_nothing_flew(run):
    class Unbuilt(Supervisor[NoParams]):
        def __init__(self, params, context):
            raise ValueError("no such sensor")

        def check(self, tick, airborne):
            return None

    plan = PartPlan("unbuilt", Unbuilt, NoParams(), "supervisors.unbuilt")
    flown, told = run(flight(supervisors=(plan,)))
    assert flown.exit_code == 1
    assert "`supervisors.unbuilt` can't be made: ValueError: no such sensor" in str(
        flown.summary["reason"]
    )
    assert named(told, "behavior_started") == []


def test_two_behaviors_that_refuse_and_name_each_other_end_in_brake(run):
    class Shut(Behavior[NoParams], flight=AIR >> AIR, emits=SetpointKind.POSITION):
        def __init__(self, params: NoParams, entry: Entry) -> None:
            raise Refused("shut")

        def update(self, tick: Tick) -> Setpoint:
            raise AssertionError

    one = state("one", Shut, then("down"), TransitionPlan(target="two", cause="failed"))
    two = state("two", Shut, then("down"), TransitionPlan(target="one", cause="failed"))
    _, told = run(vehicle("a", [up("one"), one, two, down()], hover_limit=1.0))
    assert path(told, "a") == ["up", "one", "two", "brake", "hover", "auto_land", "landed"]


class Cut(Link):
    """A link to a simulated vehicle whose `method` raises from `AT` on."""

    def __init__(self, link: Link, method: str) -> None:
        self.link, self.method = link, method

    def read(self, now):
        self.fail("read", now)
        return self.link.read(now)

    def send(self, command, now):
        self.fail("send", now)
        self.link.send(command, now)

    def truth(self):
        return self.link.truth()

    def fail(self, method, now):
        if method == self.method and now >= AT * NS:
            raise DriverError("the cable is out")


@pytest.mark.parametrize(
    ("method", "way"),
    [("read", ["auto_land", "land_blind", "fault"]), ("send", ["auto_land"])],
)
def test_a_link_that_fails_ends_its_own_vehicle_and_no_other(run, method, way):
    driver = wrapped(lambda name, link: Cut(link, method) if name == "a" else link)
    states = [up("hold"), hold(2.0, "down"), down()]
    other = vehicle("b", states, start=(1.0, 0.0, 0.0), driver=driver)
    flown, told = run(flight(driver=driver), other, time_limit=20.0)
    assert flown.exit_code == 3
    assert "the cable is out" in flown.summary["reason"]
    assert path(told, "a")[: 2 + len(way)] == ["up", "hold", *way]
    assert path(told, "b") == ["up", "hold", "down", "landed"]


@pytest.mark.parametrize("state", ["override", pytest.param("armed", marks=pytest.mark.thorough)])
def test_a_link_whose_state_raises_ends_its_own_vehicle_and_no_other(run, state):
    class Broken(Cut):
        def read(self, now):
            self.now = now
            return self.link.read(now)

    def raising(link):
        link.fail("state", getattr(link, "now", 0))

    setattr(Broken, state, property(raising))
    driver = wrapped(lambda name, link: Broken(link, "state") if name == "a" else link)
    states = [up("hold"), hold(2.0, "down"), down()]
    other = vehicle("b", states, start=(1.0, 0.0, 0.0), driver=driver)
    flown, told = run(vehicle("a", states, driver=driver), other, time_limit=20.0)
    assert flown.exit_code == 3
    assert "the cable is out" in flown.summary["reason"]
    assert path(told, "b") == ["up", "hold", "down", "landed"]


def test_a_listener_and_an_observer_that_raise_do_not_stop_a_flight(run):
    def shut(_):
        raise BrokenPipeError("the terminal is gone")

    flown, told = run(vehicle("a", [up("down"), down()]), listeners=(shut,), observers=(shut,))
    assert flown.exit_code == 0
    assert path(told, "a") == ["up", "down", "landed"]
    reasons = [e.fields["reason"] for e in named(told, "observer_failed")]
    assert reasons == ["BrokenPipeError: the terminal is gone"] * 2
