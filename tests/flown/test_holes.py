"""Ways by which a vehicle could have come to harm, each closed."""

from __future__ import annotations

from dataclasses import replace

import pytest
from failsafe_parts import orders
from plans import part, state, then, vehicle
from short_flights import down, hold, named, path, up

from kybflow.core.signals import NS, Alarm, Battery, Reaction
from kybflow.dsl.expressions import InState
from kybflow.dsl.plan import FaultPlan, FlowPlan, PhasePlan, Request, TransitionPlan
from kybflow.parts import Effect
from kybflow.runtime.vehicle.requests import Requester

CASCADE = part("trackers", "cascade")


class Off(CASCADE.cls):
    """Stops the rotors after five seconds."""

    def update(self, setpoint, tick):
        command = super().update(setpoint, tick)
        return command._replace(armed=False) if tick.now > 5 * NS else command


def waits():
    return state("wait", part("behaviors", "wait_on_ground"))


def relay():
    """When `a` is down again, `b` takes off."""
    over = [TransitionPlan(target="two", when=InState("a", s)) for s in ("landed", "fault")]
    phases = {
        "one": PhasePlan(
            name="one", run={"a": Request("up")}, give={}, options=(), transitions=tuple(over)
        ),
        "two": PhasePlan(name="two", run={"b": Request("up")}, give={}, options=(), transitions=()),
    }
    return FlowPlan(name="team", begin="one", vehicles=("a", "b"), phases=phases)


def two():
    return [
        vehicle(name, [waits(), up("hold"), hold(4.0, "down"), down()], start=(x, 0.0, 0.0))
        for name, x in (("a", 0.0), ("b", 1.0))
    ]


def interrupted(at: float):
    def observe(engine) -> None:
        if engine.seconds() >= at:
            engine.interrupts = max(engine.interrupts, 1)

    return observe


def test_after_an_interrupt_nobody_takes_off(run):
    flown, told = run(*two(), flows=(relay(),), observers=(interrupted(5.0),))
    assert "up" not in path(told, "b")
    assert flown.summary["sim_time_s"] < 15.0


def test_after_the_time_limit_nobody_takes_off(run):
    _, told = run(*two(), flows=(relay(),), time_limit=5.0)
    assert "up" not in path(told, "b")


def test_after_a_person_landed_it_no_flow_starts_it(run):
    ask = orders((9.0, lambda v: v.requests.switch("up", Requester.CALLBACK)))
    one = vehicle("a", [up("hold"), hold(9.0, "down"), down()])
    _, told = run(one, emitted=((5.0, "operator.land"),), observers=(ask,))
    assert path(told, "a") == ["up", "hold", "auto_land", "landed"]


def test_a_tracker_can_not_stop_the_rotors_in_the_air(run):
    off = replace(CASCADE, cls=Off)
    flown, told = run(vehicle("a", [up("hold"), hold(4.0, "down"), down()], tracker=off))
    assert path(told, "a")[-2:] == ["land_blind", "fault"]
    assert flown.summary["outcome"] == "failed"


@pytest.mark.parametrize("rubbish", ["land", Alarm("a", "land", "b", 0.0, 0.0)])  # type: ignore[arg-type]
def test_a_supervisor_that_talks_nonsense_lands_its_vehicle(run, rubbish):
    tilt = part("supervisors", "tilt")

    class Mad(tilt.cls):
        def check(self, tick, airborne):
            return rubbish if tick.now > 5 * NS else None

    mad = replace(tilt, cls=Mad)
    _, told = run(vehicle("a", [up("hold"), hold(4.0, "down"), down()], supervisors=(mad,)))
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]


def test_an_empty_battery_keeps_it_from_a_second_take_off(run):
    battery = part("supervisors", "battery")

    class Empties(battery.cls):
        def check(self, tick, airborne):
            if airborne and tick.now > 9 * NS:
                tick = tick._replace(battery=Battery(tick.now, 0.09, 12.0))
            return super().check(tick, airborne)

    first, again = hold(1.0, "down"), state("again", part("behaviors", "take_off", height=0.6))
    rest = state(
        "rest", part("behaviors", "wait_on_ground"), TransitionPlan(target="again", after=2.0)
    )
    landing = state("down", part("behaviors", "land"), then("rest"))
    empties = replace(battery, cls=Empties)
    states = [up("hold"), first, landing, rest, replace(again, transitions=(then("down"),))]
    _, told = run(vehicle("a", states, supervisors=(empties,)))
    assert path(told, "a")[-2:] == ["again", "landed"]
    [failed] = named(told, "behavior_failed")
    assert "9% left" in failed.fields["reason"]


def test_going_home_it_lands_where_another_is_in_the_way():
    from kybflow.core.signals import Tick
    from kybflow.runtime.events import Events
    from kybflow.runtime.vehicle.failsafe import Failsafe, RaisedAlarm

    failsafe = Failsafe("a", {}, {}, Events())
    failsafe.latched = Reaction.GO_HOME
    tick = Tick(0, 0.004, 0.0, object(), None, None, {})  # type: ignore[arg-type]
    near = RaisedAlarm(Alarm("too_close", Reaction.BRAKE, "near", 0.1, 0.2), "")
    assert failsafe.decide(near, tick, True, "auto_home") is Reaction.LAND


def test_a_fault_that_no_world_can_have_is_told_and_the_flight_goes_on(run):
    gust = part("faults", "gust", velocity=(1.0, 0.0, 0.0))

    class Wrong(gust.cls):
        def effects(self, vehicle):
            return {vehicle: Effect(body="nobody")}

    wrong = FaultPlan(part=replace(gust, cls=Wrong), vehicle="a", time=5.0)
    one = vehicle("a", [up("hold"), hold(4.0, "down"), down()])
    flown, told = run(one, faults=(wrong,))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert len(named(told, "fault_failed")) == 1
    assert flown.summary["outcome"] == "failed"


@pytest.mark.parametrize("what", ["filter", "wind"])
def test_a_fault_that_raises_at_work_is_left_out_and_the_flight_goes_on(run, what):
    gust = part("faults", "gust", velocity=(1.0, 0.0, 0.0))

    class Bad(gust.cls):
        def effects(self, vehicle):
            return {vehicle: Effect(**{what: self.bad})}

        def bad(self, _):
            raise ZeroDivisionError("a lab's own bug")

    bad = FaultPlan(part=replace(gust, cls=Bad), vehicle="a", time=5.0, duration=1.0)
    one = vehicle("a", [up("hold"), hold(4.0, "down"), down()])
    flown, told = run(one, faults=(bad,))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert [e.name for e in told if e.name.startswith("fault_")] == [
        "fault_injected", "fault_failed",
    ]  # fmt: skip
    assert flown.exit_code == 1
    assert "the fault `gust` failed at work: ZeroDivisionError" in flown.summary["reason"]


def test_a_battery_that_reports_no_more_is_told_and_the_flight_goes_on(run):
    gust = part("faults", "gust", velocity=(1.0, 0.0, 0.0))

    class Unread(gust.cls):
        def effects(self, vehicle):
            return {vehicle: Effect(filter=lambda m: None if isinstance(m, Battery) else m)}

    unread = FaultPlan(part=replace(gust, cls=Unread), vehicle="a", time=4.0)
    one = vehicle("a", [up("hold"), hold(8.0, "down"), down()])
    flown, told = run(one, faults=(unread,))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.exit_code == 0
    [lost] = named(told, "battery_lost")
    assert lost.time / NS == pytest.approx(9.0, abs=0.15)
    assert (lost.fields["reaction"], lost.fields["bound"]) == ("warn", 5.0)
    assert lost.fields["value"] == pytest.approx(5.0, abs=0.05)
    assert "last report" in str(lost.fields["reason"])
