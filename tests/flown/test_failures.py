"""Whatever part of a vehicle fails, in whatever stage: it comes down by the gentlest way that is
left, its rotors never stop in the air, and nobody else is disturbed. Ways by which a vehicle could
have come to harm are closed."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import numpy as np
import pytest
from failsafe_parts import orders
from plans import Through, after, failed, part, state, then, vehicle, wrapped
from short_flights import NoParams, Still, down, hold, hovers, named, path, up

from kybflow.core.errors import DriverError, Refused
from kybflow.core.signals import NS, Alarm, Battery, Reaction, Setpoint, SetpointKind, Tick
from kybflow.dsl.expressions import InState
from kybflow.dsl.plan import (
    EstimatorPlan,
    FaultPlan,
    FlowPlan,
    PartPlan,
    PhasePlan,
    Request,
    TransitionPlan,
)
from kybflow.flight.motion import IDLE
from kybflow.parts import AIR, GROUND, Behavior, Effect, Entry, Link, Supervisor
from kybflow.recording.messages import read_recording
from kybflow.runtime.events import Events
from kybflow.runtime.trackers.cascade import Cascade
from kybflow.runtime.vehicle.failsafe import Failsafe, RaisedAlarm
from kybflow.runtime.vehicle.requests import Requester

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


def rests_at_the_end(flown, told) -> bool:
    """On the ground, in `fault`."""
    return path(told, "a")[-1] == "fault" and flown.summary["vehicles"]["a"]["final"] == "ground"


def sinks_for(flown) -> float:
    """Seconds from the failure to the end of the run."""
    return flown.summary["sim_time_s"] - AT


def test_a_supervisor_that_raises_in_every_tick_lands_its_vehicle(run):
    flown, told = run(hovers(20.0, supervisors=(broken("supervisors", "battery", "check"),)))
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert [e.fields["part"] for e in named(told, "part_failed")] == ["supervisors.battery"]
    assert rests_at_the_end(flown, told)


def test_without_any_supervisor_left_a_lost_estimate_still_lands_blind(run):
    estimator = EstimatorPlan(broken("estimators", "mocap", "update"), recover_after=1.0)
    flown, told = run(hovers(20.0, estimators=(estimator,), supervisors=()))
    assert path(told, "a") == ["up", "hold", "land_blind", "fault"]
    assert [e.fields["part"] for e in named(told, "part_failed")] == ["estimators.mocap"]
    assert rests_at_the_end(flown, told)
    assert sinks_for(flown) > 1.0


def test_a_tracker_that_raises_in_every_tick_lands_blind(run):
    flown, told = run(hovers(20.0, tracker=broken("trackers", "cascade", "update")))
    assert path(told, "a") == ["up", "hold", "auto_land", "land_blind", "fault"]
    assert {e.fields["part"] for e in named(told, "part_failed")} == {"trackers.cascade"}
    assert rests_at_the_end(flown, told)
    assert sinks_for(flown) > 1.0


def test_a_warning_before_the_rotors_turn_does_not_make_a_flight_a_stand(run):
    low = part("drivers", "sim", battery=0.25)
    flown, told = run(hovers(20.0, driver=low, tracker=broken("trackers", "cascade", "update")))
    assert named(told, "battery_low")[0].time < NS
    assert path(told, "a") == ["up", "hold", "auto_land", "land_blind", "fault"]
    assert sinks_for(flown) > 1.0


@pytest.mark.parametrize(
    "believed", [nan, *(pytest.param(b, marks=pytest.mark.thorough) for b in (0.0, 1e9, None))]
)
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

    flown, told = run(hovers(20.0, tracker=replace(part("trackers", "cascade"), cls=Mad)))
    assert path(told, "a")[-2:] == ["land_blind", "fault"]
    assert 1.0 < sinks_for(flown) < 14.0
    assert rests_at_the_end(flown, told)


@pytest.mark.parametrize(
    "name", ["limit_speed", pytest.param("position_error", marks=pytest.mark.thorough)]
)
def test_a_processor_that_raises_is_left_out_and_the_vehicle_lands(run, name):
    processors = (broken("processors", name, "__call__"), part("processors", "fence"))
    flown, told = run(hovers(20.0, processors=processors))
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
    failed = named(told, "part_failed")[0].fields
    assert (failed["part"], failed["reason"]) == ("behaviors.bad", "KeyError: 'not there'")
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

    flown, told = run(hovers(20.0, tracker=replace(part("trackers", "cascade"), cls=Never)))
    assert path(told, "a") == ["up", "fault"]
    assert flown.summary["sim_time_s"] < 1.0


def test_a_part_that_can_not_be_made_is_the_reason_why_nothing_flew(run):
    class Unbuilt(Supervisor[NoParams]):
        def __init__(self, params, context):
            raise ValueError("no such sensor")

        def check(self, tick, off_ground):
            return None

    plan = PartPlan("unbuilt", Unbuilt, NoParams(), "supervisors.unbuilt")
    flown, told = run(hovers(20.0, supervisors=(plan,)))
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

    one = state("one", Shut, then("down"), failed("two"))
    two = state("two", Shut, then("down"), failed("one"))
    _, told = run(vehicle("a", [up("one"), one, two, down()], hover_limit=1.0))
    assert path(told, "a") == ["up", "one", "two", "brake", "hover", "auto_land", "landed"]


class Cut(Through):
    """A link to a simulated vehicle whose `method` raises from `AT` on."""

    def __init__(self, link: Link, method: str) -> None:
        super().__init__(link)
        self.method = method

    def read(self, now):
        self.fail("read", now)
        return super().read(now)

    def send(self, command, now):
        self.fail("send", now)
        super().send(command, now)

    def fail(self, method, now):
        if method == self.method and now >= AT * NS:
            raise DriverError("the cable is out")


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("method", "way"),
    [("read", ["auto_land", "land_blind", "fault"]), ("send", ["auto_land"])],
)
def test_a_link_that_fails_ends_its_own_vehicle_and_no_other(run, method, way):
    driver = wrapped(lambda name, link: Cut(link, method) if name == "a" else link)
    other = hovers(2.0, "b", start=(1.0, 0.0, 0.0), driver=driver)
    flown, told = run(hovers(20.0, driver=driver), other, time_limit=20.0)
    assert flown.exit_code == 3
    assert "the cable is out" in flown.summary["reason"]
    assert path(told, "a")[: 2 + len(way)] == ["up", "hold", *way]
    assert path(told, "b") == ["up", "hold", "down", "landed"]


@pytest.mark.parametrize("state", ["override", pytest.param("armed", marks=pytest.mark.thorough)])
def test_a_link_whose_state_raises_ends_its_own_vehicle_and_no_other(run, state):
    class Broken(Cut):
        def read(self, now):
            self.now = now
            return super().read(now)

    def raising(link):
        link.fail("state", getattr(link, "now", 0))

    setattr(Broken, state, property(raising))
    driver = wrapped(lambda name, link: Broken(link, "state") if name == "a" else link)
    other = hovers(2.0, "b", start=(1.0, 0.0, 0.0), driver=driver)
    flown, told = run(hovers(2.0, driver=driver), other, time_limit=20.0)
    assert flown.exit_code == 3
    assert "the cable is out" in flown.summary["reason"]
    assert path(told, "b") == ["up", "hold", "down", "landed"]


def test_a_link_may_answer_with_values_of_numpy(run):
    def measured(_, link):
        link.delay = np.float32(0.01)
        return link

    flown, _ = run(vehicle("a", [up("down"), down()], driver=wrapped(measured)))
    assert flown.exit_code == 0
    answers = read_recording(flown.folder / "log.mcap")["/a/link"].json()
    state = next(answer for answer in answers if "state" in answer)
    assert state["state"][3] == pytest.approx(0.01)


def test_a_listener_and_an_observer_that_raise_do_not_stop_a_flight(run):
    def shut(_):
        raise BrokenPipeError("the terminal is gone")

    flown, told = run(vehicle("a", [up("down"), down()]), listeners=(shut,), observers=(shut,))
    assert flown.exit_code == 0
    assert path(told, "a") == ["up", "down", "landed"]
    reasons = [e.fields["reason"] for e in named(told, "observer_failed")]
    assert reasons == ["BrokenPipeError: the terminal is gone"] * 2


CASCADE = part("trackers", "cascade")
GUST = part("faults", "gust", velocity=(1.0, 0.0, 0.0))


class Off(CASCADE.cls):
    """Stops the rotors after five seconds."""

    def update(self, setpoint, tick):
        command = super().update(setpoint, tick)
        return command._replace(armed=False) if tick.now > 5 * NS else command


def relay():
    """When `a` is down again, `b` takes off."""
    over = [TransitionPlan(target="two", when=InState("a", s)) for s in ("landed", "fault")]
    phases = {
        "one": PhasePlan(name="one", run={"a": Request("up")}, transitions=tuple(over)),
        "two": PhasePlan(name="two", run={"b": Request("up")}),
    }
    return FlowPlan(name="team", begin="one", vehicles=("a", "b"), phases=phases)


def two():
    waits = state("wait", part("behaviors", "wait_on_ground"))
    return [
        vehicle(name, [waits, up("hold"), hold(4.0, "down"), down()], start=(x, 0.0, 0.0))
        for name, x in (("a", 0.0), ("b", 1.0))
    ]


@pytest.mark.thorough
def test_after_an_interrupt_nobody_takes_off(run):
    def interrupts(engine) -> None:
        if engine.seconds() >= 5.0:
            engine.interrupts = max(engine.interrupts, 1)

    flown, told = run(*two(), flows=(relay(),), observers=(interrupts,))
    assert "up" not in path(told, "b")
    assert flown.summary["sim_time_s"] < 15.0


@pytest.mark.thorough
def test_after_the_time_limit_nobody_takes_off(run):
    _, told = run(*two(), flows=(relay(),), time_limit=5.0)
    assert "up" not in path(told, "b")


def test_after_a_person_landed_it_no_flow_starts_it(run):
    ask = orders((9.0, lambda v: v.requests.switch("up", Requester.CALLBACK)))
    _, told = run(hovers(9.0), emitted=((5.0, "operator.land"),), observers=(ask,))
    assert path(told, "a") == ["up", "hold", "auto_land", "landed"]


def test_a_tracker_can_not_stop_the_rotors_in_the_air(run):
    flown, told = run(hovers(tracker=replace(CASCADE, cls=Off)))
    assert path(told, "a")[-2:] == ["land_blind", "fault"]
    assert flown.summary["outcome"] == "failed"


@pytest.mark.parametrize("rubbish", ["land", Alarm("a", "land", "b", 0.0, 0.0)])  # type: ignore[arg-type]
def test_a_supervisor_that_talks_nonsense_lands_its_vehicle(run, rubbish):
    tilt = part("supervisors", "tilt")

    class Mad(tilt.cls):
        def check(self, tick, off_ground):
            return rubbish if tick.now > 5 * NS else None

    mad = replace(tilt, cls=Mad)
    _, told = run(hovers(supervisors=(mad,)))
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]


def test_an_empty_battery_keeps_it_from_a_second_take_off(run):
    battery = part("supervisors", "battery")

    class Empties(battery.cls):
        def check(self, tick, off_ground):
            if off_ground and tick.now > 9 * NS:
                tick = tick._replace(battery=Battery(tick.now, 0.09, 12.0))
            return super().check(tick, off_ground)

    again = state("again", part("behaviors", "take_off", height=0.6), then("down"))
    rest = state("rest", part("behaviors", "wait_on_ground"), after(2.0, "again"))
    landing = state("down", part("behaviors", "land"), then("rest"))
    states = [up("hold"), hold(1.0, "down"), landing, rest, again]
    _, told = run(vehicle("a", states, supervisors=(replace(battery, cls=Empties),)))
    assert path(told, "a")[-2:] == ["again", "landed"]
    [failed] = named(told, "behavior_failed")
    assert "9% left" in failed.fields["reason"]


def test_going_home_it_lands_where_another_is_in_the_way():
    failsafe = Failsafe("a", {}, {}, Events())
    failsafe.latched = Reaction.GO_HOME
    tick = Tick(0, 0.004, 0.0, object(), None, None, {})  # type: ignore[arg-type]
    near = RaisedAlarm(Alarm("too_close", Reaction.BRAKE, "near", 0.1, 0.2), "")
    assert failsafe.decide(near, tick, True, "auto_home") is Reaction.LAND


def test_a_fault_that_no_world_can_have_is_told_and_the_flight_goes_on(run):
    class Wrong(GUST.cls):
        def effects(self, vehicle):
            return {vehicle: Effect(body="nobody")}

    wrong = FaultPlan(part=replace(GUST, cls=Wrong), vehicle="a", time=5.0)
    flown, told = run(hovers(), faults=(wrong,))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert len(named(told, "fault_failed")) == 1
    assert flown.summary["outcome"] == "failed"


@pytest.mark.thorough
@pytest.mark.parametrize("what", ["filter", "wind"])
def test_a_fault_that_raises_at_work_is_left_out_and_the_flight_goes_on(run, what):
    class Bad(GUST.cls):
        def effects(self, vehicle):
            return {vehicle: Effect(**{what: self.bad})}

        def bad(self, _):
            raise ZeroDivisionError("a lab's own bug")

    bad = FaultPlan(part=replace(GUST, cls=Bad), vehicle="a", time=5.0, duration=1.0)
    flown, told = run(hovers(), faults=(bad,))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert [e.name for e in told if e.name.startswith("fault_")] == [
        "fault_injected", "fault_failed",
    ]  # fmt: skip
    assert flown.exit_code == 1
    assert "the fault `gust` failed at work: ZeroDivisionError" in flown.summary["reason"]


@pytest.mark.thorough
def test_a_battery_that_reports_no_more_is_told_and_the_flight_goes_on(run):
    class Unread(GUST.cls):
        def effects(self, vehicle):
            return {vehicle: Effect(filter=lambda m: None if isinstance(m, Battery) else m)}

    unread = FaultPlan(part=replace(GUST, cls=Unread), vehicle="a", time=4.0)
    flown, told = run(hovers(8.0), faults=(unread,))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.exit_code == 0
    [lost] = named(told, "battery_lost")
    assert lost.time / NS == pytest.approx(9.0, abs=0.15)
    assert (lost.fields["reaction"], lost.fields["bound"]) == ("warn", 5.0)
    assert lost.fields["value"] == pytest.approx(5.0, abs=0.05)
    assert "last report" in str(lost.fields["reason"])
