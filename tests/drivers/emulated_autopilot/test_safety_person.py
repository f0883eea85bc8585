"""A person with a transmitter, or with a keyboard, or with commands; and rotors that are cut."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is not installed")

from commanders import Asked, People
from dry_runs import (
    AUTOPILOTS,
    DRIVER,
    FOLLOWS,
    HEIGHT,
    LANDS,
    LINE,
    WRONG,
    DryRun,
    opening,
    supervised,
)
from fingers import Person
from framing import REQUEST
from plans import part, plan, state, vehicle
from short_flights import NoParams, down, hold, named, path, up

from kybflow.api.flight import RunRequest, fly
from kybflow.core.signals import NS, Alarm, Reaction
from kybflow.drivers.mavlink.protocol.framing import NUMBERS
from kybflow.dsl.plan import PartPlan, TransitionPlan
from kybflow.parts import Supervisor

SWITCH = {"px4": ("POSCTL", "POSITION"), "ardupilot": ("LOITER", "LOITER")}
"""The pilot's mode as the emulated firmware and as the driver call it."""
BACK = WRONG + 2.0
thorough = pytest.mark.thorough


def switches(flight):
    """The pilot's, with what is sent to the vehicle from then on counted, but for requests for its
    messages."""
    wire, sent = flight.link.wire, []
    flight.sent = sent
    send = wire.send

    def counting(data, to=None):
        number, command = (int.from_bytes(data[a:b], "little") for a, b in ((7, 10), (38, 40)))
        if (number, command) != (NUMBERS["COMMAND_LONG"], REQUEST):
            sent.append((flight.engine.seconds(), number))
        send(data, to)

    wire.send = counting
    flight.pilot.give_to_pilot(SWITCH[flight.name][0])


SET_POINTS = {
    NUMBERS[f"SET_{name}"]
    for name in ("ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT")
}
COMMANDS = {NUMBERS["COMMAND_LONG"]}
"""Numbers of the messages that steer."""


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", [pytest.param("px4", marks=thorough), "ardupilot"])
def test_a_pilot_has_it_at_once_and_until_it_is_asked_for(autopilot, tmp_path):
    deeds, resume = [(WRONG, switches)], (BACK, "operator.resume")
    flight = DryRun(autopilot, tmp_path, deeds=deeds, emitted=[resume])
    taken = flight.only("control_taken")
    assert (taken.at, taken.fields["reason"]) == (
        DRIVER,
        f"a pilot took over: {SWITCH[autopilot][1]}",
    )
    assert flight.at("control_taken") - WRONG < 0.03
    between = {n for at, n in flight.sent if flight.at("control_taken") <= at < BACK}
    assert not between & (SET_POINTS | COMMANDS)
    assert 0.0 <= flight.at("control_returned") - BACK < 1.5
    assert flight.path == ["up", "hold", "down", "landed"]
    assert flight.flown.exit_code == 0
    assert flight.is_safe()


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_a_pilot_who_lands_it_ends_the_run(autopilot, tmp_path):
    def lands(flight):
        flight.pilot.change(flight.pilot.firmware.land, flight.pilot.now, asked=True)

    deeds = [(WRONG, switches), (WRONG + 0.5, lands)]
    flight = DryRun(autopilot, tmp_path, deeds=deeds)
    assert flight.path == ["up", "hold", "landed"]
    assert "a pilot took over" in flight.flown.summary["reason"]
    assert flight.flown.exit_code == 1
    assert flight.is_safe()


def interrupted(times):
    return lambda flight: setattr(flight.engine, "interrupts", times)


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_ctrl_c_lands_it_by_its_own_mode(autopilot, tmp_path):
    flight = DryRun(autopilot, tmp_path, deeds=[(WRONG, interrupted(1))])
    assert flight.only("land_mode_started").at == DRIVER
    assert flight.after(WRONG, LANDS[autopilot]) < 0.15
    assert flight.flown.exit_code == 130
    assert flight.is_safe()


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", [pytest.param("px4", marks=thorough), "ardupilot"])
def test_a_second_ctrl_c_cuts_the_stream_and_it_lands_by_itself(autopilot, tmp_path):
    deeds = [(WRONG, interrupted(2))]
    flight = DryRun(autopilot, tmp_path, deeds=deeds)
    assert flight.mode == {"px4": "OFFBOARD", "ardupilot": "GUIDED"}[autopilot]
    assert flight.pilot.state.armed
    flight.go_on(20.0)
    assert flight.after(WRONG, LANDS[autopilot]) < 2.1
    assert flight.flown.exit_code == 130
    assert flight.is_safe()


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_who_disarms_it_in_its_landing_has_not_landed_it(autopilot, tmp_path):
    """It is down before its heartbeat says that its rotors rest."""

    def stops(flight):
        flight.pilot.stop(flight.pilot.now, "Disarmed by external command")

    def watches(flight):
        if flight.path[-1] == "down" and flight.position[2] < 0.4:
            stops(flight)
        else:
            flight.do_next(watches)

    flight = DryRun(autopilot, tmp_path, deeds=[(WRONG, watches)])
    assert flight.path == ["up", "hold", "down", "fault"]
    assert "it disarmed in the air" in flight.only("control_lost").fields["reason"]
    assert flight.events("landed") == []
    assert flight.flown.exit_code == 1


class Cuts(Supervisor[NoParams]):
    """Asks for `cut` from `WRONG` on."""

    def check(self, tick, off_ground):
        wrong = WRONG * NS <= tick.now < (WRONG + 0.2) * NS
        return Alarm("alarmed", Reaction.CUT, "the test says so") if wrong else None


@pytest.mark.parametrize("autopilot", ["px4", pytest.param("ardupilot", marks=thorough)])
def test_cut_stops_its_rotors_in_the_air(autopilot, tmp_path):
    alarm = PartPlan("cuts", Cuts, NoParams(), "supervisors.cuts", LINE)
    flight = DryRun(autopilot, tmp_path, supervisors=(*supervised(), alarm))
    first = next(s for s in flight.samples if s.time >= WRONG and not s.armed)
    assert first.time - WRONG <= 0.06
    assert first.position[2] > 0.8 * HEIGHT
    assert (first.mode, flight.only("failsafe_started").at) == (FOLLOWS[autopilot], LINE)
    assert flight.path == ["up", "hold", "fault"]


TAKEN = 17.0
SOMEBODYS = "another pilot or program has control until `operator.resume`"


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_person_starts_pauses_takes_back_and_lands_it(autopilot, tmp_path):
    own, opened = opening(autopilot)
    go = TransitionPlan(target="up", event="operator.go")
    idle = state("idle", part("behaviors", "wait_on_ground"), go)
    states = [idle, up("hold", 0.6), hold(60.0, "down"), down()]
    one = vehicle("a", states, driver=own, tracker=part("trackers", "on_board"))
    people = People(
        Asked(5.0, "emit operator.go"), Asked(14.0, "pause"), Asked(15.0, "resume"),
        Asked(TAKEN + 1.0, "switch a down"), Asked(TAKEN + 1.5, "land"),
        Asked(TAKEN + 2.0, "resume a"), Asked(TAKEN + 6.0, "land"),
    )  # fmt: skip

    def pilots(engine):
        if engine.seconds() >= TAKEN and not given:
            given.append(opened[0].links["a"].onboard.give_to_pilot(SWITCH[autopilot][0]))

    given, told = [], []
    request = RunRequest(out=tmp_path / "run")
    observers = (people.look, pilots)
    flown = fly(plan(one, time_limit=90.0), request, (told.append,), observers, (people.serve,))
    assert people.answers == [
        ("emit operator.go", True, ""), ("pause", True, ""), ("resume", True, ""),
        ("switch a down", False, SOMEBODYS), ("land", False, SOMEBODYS),
        ("resume a", True, ""), ("land", True, ""),
    ]  # fmt: skip
    [taken], [back] = named(told, "control_taken"), named(told, "control_returned")
    assert taken.fields["reason"] == f"a pilot took over: {SWITCH[autopilot][1]}"
    assert 0.0 <= back.time / NS - TAKEN - 2.0 < 1.5
    assert path(told, "a") == ["idle", "up", "hold", "auto_land", "landed"]
    assert named(told, "foreign_command") == []
    assert flown.exit_code == 0


GO, PILOT_TAKES, ASKED_BACK = 3.0, 9.0, 11.0
"""Seconds: of `operator.go`, of the pilot's take-over, and of `resume`."""


@pytest.mark.thorough
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_a_person_lets_it_go_and_asks_it_back_from_a_pilot(autopilot, tmp_path):
    person, offered = Person(), []

    def takes_over(flight):
        flight.pilot.give_to_pilot(SWITCH[autopilot][0])

    def asks_back(flight):
        person.see(flight.engine)
        offered.extend(offer.name for offer in person.commander.offers)
        person.press(flight.engine, "resume", "enter")

    go = TransitionPlan(target="up", event="operator.go")
    idle = state("idle", part("behaviors", "wait_on_ground"), go)
    flight = DryRun(
        autopilot,
        tmp_path,
        states=[idle, up("hold", HEIGHT), hold(5.0, "down"), down()],
        deeds=[
            (GO, lambda flight: person.press(flight.engine, "operator.go", "enter")),
            (PILOT_TAKES, takes_over),
            (ASKED_BACK, asks_back),
        ],
        servers=(person.commander.serve,),
    )
    assert 0.0 <= flight.at("control_taken") - PILOT_TAKES < 0.1
    assert offered == ["pause", "resume", "stop"]
    assert 0.0 <= flight.at("control_returned") - ASKED_BACK < 1.5
    assert flight.path == ["idle", "up", "hold", "down", "landed"]
    assert [e.fields["command"] for e in flight.events("command_given")] == [
        "emit operator.go",
        "resume",
    ]
    assert flight.flown.exit_code == 0
    assert flight.is_safe()
