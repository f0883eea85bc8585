"""A vehicle that arms by itself, refuses to, or is taken away: the engine waits, tells, leaves it
alone, and goes on when it has it back."""

from __future__ import annotations

from dataclasses import replace

import pytest
from failsafe_parts import alarming
from plans import part, state, vehicle, wrapped
from short_flights import down, hold, named, path, up

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import norm
from kybflow.core.signals import NS, Command, Estimate, Reaction
from kybflow.dsl.plan import TransitionPlan
from kybflow.parts import Check, Link, Override, StatusText
from kybflow.runtime.vehicle.requests import Requester

SLOW = 2.0
"""Seconds that the autopilot takes to arm."""
TAKEN, BACK = 8.0, 11.0
SINKS = 0.95
"""Of the thrust that held it, what a pilot lands it with before `BACK`."""
PILOT = Override("a pilot took over: POSCTL")
FAILSAFE = Override("no set-points", lands=True)


class Autopilot(Link):
    """A simulated vehicle with a will of its own. While a pilot has it, it follows the last command
    that it got before, lowered only by one who lands it. `way` is what becomes of it."""

    def __init__(self, link: Link, way: str) -> None:
        self.link, self.way = link, way
        self.faults = link.faults
        self.armed = False
        self.asked: float | None = None
        self.calls: list[tuple[float, str]] = []
        self.told: list[Estimate] = []
        self.arming: list[Command] = []
        self.reclaimed = False
        self.asked_to_land: float | None = None
        self._last: Command | None = None

    def read(self, now):
        seconds = now / NS
        late = self.way == "found late" and self.armed and self.asked_to_land is None
        if late and seconds >= TAKEN:
            self.override = Override("nobody says why", lands=seconds >= TAKEN + 0.5)
        if self.way in ("pilot", "failsafe", "pilot lands") and self.armed and not self.reclaimed:
            if seconds >= TAKEN:
                self.override = PILOT if "pilot" in self.way else FAILSAFE
            if self.way == "pilot lands" and seconds >= BACK:
                self.armed = False
        if self.override is not None and self._last is not None:
            last = self._last
            if self.way == "pilot lands":
                last = last._replace(thrust=SINKS * last.thrust)
            rotors = last if self.armed else self._last._replace(armed=False, thrust=0.0)
            self.link.send(rotors, now)
        is_silent = self.way == "falls silent" and seconds >= TAKEN
        return () if is_silent else self.link.read(now)

    def subscribe(self, kinds):
        self.link.subscribe(kinds)

    def truth(self):
        return self.link.truth()

    def arm(self, command, now):
        self.calls.append((now / NS, "arm"))
        self.arming.append(command)
        if self.way == "breaks":
            raise DriverError("the cable is out")
        self.asked = now / NS if self.asked is None else self.asked
        if self.way == "refuses" and now / NS - self.asked > 1.0:
            raise Refused("PreArm: Compass not calibrated")
        self.armed = now / NS - self.asked > SLOW
        return self.armed

    def send(self, command, now):
        self.calls.append((now / NS, "send" if command.armed else "rest"))
        self.armed = command.armed or self.way == "falls silent"
        self._last = command
        self.link.send(command, now)

    def cut(self, now):
        self.calls.append((now / NS, "cut"))

    def reclaim(self, now):
        self.calls.append((now / NS, "reclaim"))
        self.reclaimed, self.override = True, None

    def tell_position(self, estimate, now):
        self.told.append(estimate)

    def status_texts(self):
        return [StatusText("warning", "low memory")] if not self.calls else []

    def land(self, now):
        self.calls.append((now / NS, "land"))
        self.asked_to_land = now / NS
        self.override = None
        raise Refused("it has no land mode")


def driver(way: str, **declared):
    opened: list[Autopilot] = []

    def wrap(_, link):
        opened.append(Autopilot(link, way))
        return opened[0]

    return wrapped(wrap, **declared), opened


def flight(own, seconds=8.0, **more):
    return vehicle("a", [up("hold"), hold(seconds, "down"), down()], driver=own, **more)


def asked(opened: list[Autopilot]) -> list[str]:
    calls = [what for _, what in opened[0].calls]
    return [what for i, what in enumerate(calls) if i == 0 or calls[i - 1] != what]


@pytest.mark.thorough
def test_a_behaviors_time_stands_still_until_the_vehicle_obeys(run):
    own, opened = driver("slow")
    flown, told = run(flight(own, 1.0))
    plain, _ = run(flight(part("drivers", "sim"), 1.0))
    late = flown.summary["sim_time_s"] - plain.summary["sim_time_s"]
    assert late == pytest.approx(SLOW, abs=0.3)
    assert asked(opened) == ["arm", "send", "rest"]
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.exit_code == 0
    assert len(set(opened[0].arming)) > 100  # tracked anew, since it may be on its way up


@pytest.mark.thorough
def test_one_that_falls_silent_for_good_is_not_waited_for_to_say_that_it_is_disarmed(run):
    own, _ = driver("falls silent")
    flown, told = run(flight(own))
    assert "failsafe_started" in {event.name for event in told}
    assert TAKEN + 10.0 < flown.summary["sim_time_s"] < TAKEN + 20.0
    assert flown.summary["outcome"] == "failed"


def test_a_vehicle_that_will_not_arm_stays_down_and_its_words_are_told(run):
    own, opened = driver("refuses")
    flown, told = run(flight(own))
    [refused] = named(told, "arming_refused")
    assert refused.fields == {"reason": "PreArm: Compass not calibrated"}
    assert path(told, "a") == ["up", "landed"]
    assert "send" not in asked(opened)
    assert "PreArm: Compass not calibrated" in flown.summary["reason"]
    assert flown.exit_code == 1


def test_the_mission_may_say_what_follows_a_refusal(run):
    own, _ = driver("refuses")
    climb = up("hold")
    failed = TransitionPlan(target="ground", cause="failed")
    climb = replace(climb, transitions=(*climb.transitions, failed))
    wait = state("ground", part("behaviors", "wait_on_ground"))
    flown, told = run(vehicle("a", [climb, hold(1.0, "down"), down(), wait], driver=own))
    assert path(told, "a") == ["up", "ground"]
    assert flown.exit_code == 0


def test_a_link_that_breaks_while_it_arms_keeps_the_vehicle_down(run):
    own, _ = driver("breaks")
    flown, told = run(flight(own))
    assert path(told, "a")[-1] == "fault"
    assert flown.exit_code == 3


@pytest.mark.thorough
def test_nobody_lands_by_command_what_a_pilot_has_and_the_run_goes_on(run):
    own, _ = driver("pilot")
    asked = ((BACK, "operator.land"), (BACK + 1.0, "operator.resume"))
    flown, told = run(flight(own), emitted=asked)
    land, resume = named(told, "command_given")
    assert (land.fields["command"], land.fields["accepted"]) == ("land", False)
    assert land.fields["reason"] == "another pilot or program has control until `operator.resume`"
    assert resume.fields["accepted"]
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.exit_code == 0


@pytest.mark.thorough
def test_a_vehicle_that_a_pilot_took_is_left_alone_until_a_person_asks_for_it(run):
    own, opened = driver("pilot")
    flown, told = run(flight(own), emitted=((BACK, "operator.resume"),))
    [taken], [back] = named(told, "control_taken"), named(told, "control_returned")
    assert taken.fields == {"reason": PILOT.reason}
    assert taken.time / NS == pytest.approx(TAKEN, abs=0.01)
    assert back.time / NS == pytest.approx(BACK, abs=0.02)
    between = {what for time, what in opened[0].calls if TAKEN + 0.01 < time < BACK}
    assert between == set()
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.exit_code == 0


@pytest.mark.parametrize(
    "brakes",
    [
        pytest.param((7.5, 7.9), marks=pytest.mark.thorough),
        (7.5, 8.5),
        pytest.param((7.99, 10.9), marks=pytest.mark.thorough),
    ],
)
def test_a_brake_from_before_it_was_taken_ends_with_that(run, brakes):
    """What it braked for is over, or is found again when it is back."""
    own, _ = driver("pilot")
    alarm = alarming((*brakes, Reaction.BRAKE))
    flown, told = run(flight(own, supervisors=(alarm,)), emitted=((BACK, "operator.resume"),))
    assert named(told, "failsafe_started")[0].time / NS == pytest.approx(brakes[0], abs=0.01)
    [back] = named(told, "control_returned")
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    [_, held, *_] = named(told, "behavior_ended")
    assert held.fields == {"behavior": "hold", "how": "done"}
    assert held.time - back.time < 12 * NS
    assert flown.exit_code == 0


@pytest.mark.thorough
def test_a_brake_that_is_due_when_it_is_back_holds_it_then(run):
    own, _ = driver("pilot")
    alarm = alarming((7.5, BACK + 0.5, Reaction.BRAKE))
    _, told = run(flight(own, supervisors=(alarm,)), emitted=((BACK, "operator.resume"),))
    [_, again], [ended] = named(told, "failsafe_started"), named(told, "failsafe_ended")
    assert again.time / NS == pytest.approx(BACK, abs=0.05)
    assert ended.time / NS == pytest.approx(BACK + 1.5, abs=0.05)
    assert path(told, "a") == ["up", "hold", "down", "landed"]


class Keeping(Autopilot):
    """It is asked for back and does not come; a second later it says so."""

    asked_back: float | None = None

    def reclaim(self, now):
        self.asked_back = now / NS
        self.override = PILOT

    def read(self, now):
        measured = super().read(now)
        if self.asked_back is not None and now / NS > self.asked_back + 1.0:
            self.override = PILOT._replace(refused="it does not change from POSCTL to OFFBOARD")
        return measured


def test_a_vehicle_that_is_asked_for_and_does_not_come_is_told_each_time(run):
    own = wrapped(lambda _, link: Keeping(link, "pilot lands"))
    asks = tuple((TAKEN + at, "operator.resume") for at in (0.2, 1.8))
    _, told = run(flight(own), emitted=asks)
    found = named(told, "control_refused")
    assert [event.fields for event in found] == [
        {"reason": "it does not change from POSCTL to OFFBOARD"}
    ] * 2
    times = [event.time / NS for event in found]
    assert times == pytest.approx([TAKEN + 1.2, TAKEN + 2.8], abs=0.03)
    assert len(named(told, "control_taken")) == 1
    assert named(told, "control_returned") == []


@pytest.mark.thorough
def test_nobody_else_gets_a_vehicle_that_a_pilot_has(run):
    own, _ = driver("pilot")
    asks = []

    def ask(engine):
        if engine.seconds() > TAKEN + 1.0 and not asks:
            asks.append(1)
            engine.vehicles[0].requests.switch("down", Requester.CALLBACK)

    _, told = run(flight(own), observers=(ask,), emitted=((BACK, "operator.resume"),))
    [refused] = named(told, "switch_refused")
    assert (
        refused.fields["reason"] == "another pilot or program has control until `operator.resume`"
    )


def test_a_run_ends_when_the_pilot_has_put_the_vehicle_down(run):
    own, opened = driver("pilot lands")
    flown, told = run(flight(own))
    assert path(told, "a") == ["up", "hold", "landed"]
    assert flown.summary["reason"] == f"a: {PILOT.reason}" or PILOT.reason in str(flown.summary)
    assert flown.exit_code == 1
    assert "reclaim" not in asked(opened)


def test_an_interrupted_run_leaves_the_vehicle_to_its_pilot(run):
    own, opened = driver("pilot")

    def interrupt(engine):
        if engine.seconds() >= TAKEN + 1.0:
            engine.interrupts = 1

    flown, _ = run(flight(own), observers=(interrupt,))
    after = {what for time, what in opened[0].calls if time > TAKEN + 0.01}
    assert after == set()
    assert flown.exit_code == 130


def test_a_vehicle_that_its_own_failsafe_took_is_landed(run):
    own, opened = driver("failsafe", lands=True)
    flown, told = run(flight(own))
    [lost], [started] = named(told, "control_lost"), named(told, "failsafe_started")
    assert lost.fields == {"reason": "no set-points"}
    assert lost.time == started.time
    assert (started.fields["reaction"], started.fields["reason"]) == ("land", "no set-points")
    assert path(told, "a")[-2:] == ["auto_land", "fault"]
    assert "land" in asked(opened)
    assert flown.exit_code == 1


def test_a_vehicle_whose_own_failsafe_is_found_late_is_landed_then(run):
    own, opened = driver("found late", lands=True)
    _, told = run(flight(own))
    assert len(named(told, "control_taken")) == 1
    [started] = named(told, "failsafe_started")
    assert started.time / NS == pytest.approx(TAKEN + 0.5, abs=0.01)
    assert opened[0].asked_to_land == pytest.approx(TAKEN + 0.5, abs=0.01)
    assert path(told, "a")[-2:] == ["auto_land", "fault"]


def test_rotors_that_are_cut_are_cut_by_the_link_too(run):
    from failsafe_parts import alarming

    own, opened = driver("slow")
    alarms = alarming((6.0, 6.2, Reaction.CUT))
    run(flight(own, supervisors=(alarms,)))
    assert asked(opened) == ["arm", "send", "cut", "rest"]


def test_a_vehicle_is_told_where_it_is_by_others_only(run):
    own, opened = driver("slow")
    _flown, told = run(flight(own, 1.0))
    assert {estimate.source for estimate in opened[0].told} == {"mocap"}
    assert norm(opened[0].told[-1].position) < 0.1
    [said] = named(told, "vehicle_said")[:1]
    assert said.fields == {"severity": "warning", "text": "low memory"}


@pytest.mark.thorough
def test_what_a_vehicle_checks_itself_is_part_of_the_preflight(run):
    class Settling(Autopilot):
        def checks(self, now):
            return [Check("position", now > 7 * NS, "EKF flags 167")]

    class Wrong(Autopilot):
        def checks(self, now):
            return [Check("parameters", False, "FS_GCS_ENABLE is 0", waits=False)]

    ready = wrapped(lambda _, link: Settling(link, "slow"), preflight_timeout=20.0)
    flown, told = run(flight(ready, 1.0))
    [waits] = named(told, "preflight_waits")
    assert waits.fields == {"check": "position", "reason": "EKF flags 167"}
    assert flown.exit_code == 0
    wrong = wrapped(lambda _, link: Wrong(link, "slow"), preflight_timeout=20.0)
    flown, told = run(flight(wrong, 1.0))
    assert "FS_GCS_ENABLE is 0" in flown.summary["reason"]
    assert flown.summary["sim_time_s"] == pytest.approx(5.0, abs=0.1)


@pytest.mark.thorough
def test_nobody_takes_off_again_with_what_a_pilot_put_down(run):
    def ask(engine):
        if engine.seconds() > BACK + 1.0 and not asks:
            asks.append(engine.seconds())
            engine.vehicles[0].requests.switch("up", Requester.FLOW)

    own, opened = driver("pilot lands")
    asks = []
    other = vehicle("b", [up("hold"), hold(8.0, "down"), down()], start=(1.0, 0.0, 0.0))
    mine = flight(own, start=(-1.0, 0.0, 0.0))
    _flown, told = run(mine, other, observers=(ask,))
    after = [what for time, what in opened[0].calls if time > BACK + 0.1]
    assert "arm" not in after
    assert path(told, "a") == ["up", "hold", "landed"]
    [refused] = named(told, "switch_refused")
    assert (
        refused.fields["reason"] == "another pilot or program has control until `operator.resume`"
    )


class Guest(Autopilot):
    """Somebody arms it once it has landed."""

    def read(self, now):
        measured = super().read(now)
        resting = self.calls and self.calls[-1][1] == "rest"
        if resting and now / NS - self.calls[-1][0] < 0.1:
            self.armed, self.override = True, PILOT
        return measured

    def send(self, command, now):
        if self.override is None:
            super().send(command, now)


def test_a_run_ends_though_somebody_armed_the_vehicle_after_it(run):
    own = wrapped(lambda _, link: Guest(link, "slow"))
    flown, told = run(flight(own, 1.0))
    assert path(told, "a") == ["up", "hold", "down", "landed"]
    assert flown.summary["sim_time_s"] < 30.0
    assert flown.exit_code == 0
