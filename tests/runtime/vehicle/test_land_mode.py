"""The land mode of the vehicle itself is preferred for the reaction `land`; whatever becomes of it,
the vehicle comes down."""

from __future__ import annotations

from dataclasses import replace

import pytest
from failsafe_parts import alarming
from plans import NANO, part, vehicle, wrapped
from short_flights import down, hold, named, path, up

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import GRAVITY, LEVEL, ZERO
from kybflow.core.signals import NS, Command, Reaction
from kybflow.parts import Link
from kybflow.runtime.vehicle.link import HANDED_OVER, LinkGuard, LinkOut

AT = 6.0
"""When the failsafe lands the vehicle, seconds."""
LAND = alarming((AT, AT + 0.2, Reaction.LAND))
SINKS = -0.4


class Autopilot(Link):
    """A simulated vehicle that has a land mode: level, sinking with 0.4 m/s. `way` is what becomes
    of it; `calls` is what it was asked for."""

    def __init__(self, link: Link, way: str) -> None:
        self.link, self.way = link, way
        self.faults = link.faults
        self.calls: list[tuple[float, str]] = []

    def read(self, now):
        silent = self.way == "silent" and now >= (AT - 0.45) * NS
        return () if silent else self.link.read(now)

    def subscribe(self, kinds):
        self.link.subscribe(kinds)

    def truth(self):
        return self.link.truth()

    def send(self, command, now):
        self.calls.append((now / NS, "send" if command.armed else "rest"))
        self.link.send(command, now)

    def land(self, now):
        self.calls.append((now / NS, "land"))
        if self.way == "refuses" or (self.way == "leaves" and now >= (AT + 0.5) * NS):
            raise Refused("COMMAND_DENIED: no position")
        if self.way == "breaks":
            raise DriverError("the cable is out")
        truth = self.link.truth()
        if truth.position[2] < 0.01 and abs(truth.velocity[2]) < 0.02:
            return True
        speed = 0.0 if self.way == "hangs" else SINKS
        force = 1.05 * NANO.mass * (GRAVITY + 8.0 * (speed - truth.velocity[2]))
        self.link.send(Command(LEVEL, force, ZERO, None), now)
        return False


def driver(way: str, lands: bool = True, lands_blind: bool = False):
    """(the driver, the links that it opened)"""
    opened: list[Autopilot] = []

    def wrap(_, link):
        opened.append(Autopilot(link, way))
        return opened[0]

    return wrapped(wrap, lands=lands, lands_blind=lands_blind), opened


def flight(own, *more_supervisors, seconds=20.0, **more):
    more.setdefault("supervisors", (*vehicle("a", [down()]).supervisors, *more_supervisors))
    return vehicle("a", [up("hold"), hold(seconds, "down"), down()], driver=own, **more)


def asked(opened: list[Autopilot]) -> list[str]:
    """What the link was asked for since the alarm, repetitions left out."""
    calls = [what for time, what in opened[0].calls if time >= AT]
    return [what for i, what in enumerate(calls) if i == 0 or calls[i - 1] != what]


def is_down(flown) -> bool:
    return flown.summary["vehicles"]["a"]["final"] == "ground"


def test_a_vehicle_lands_by_its_own_mode_and_is_sent_nothing_meanwhile(run):
    own, opened = driver("lands")
    commands = []

    def look(engine):
        if engine.seconds() > AT + 0.1 and engine.vehicles[0].airborne:
            commands.append(engine.vehicles[0].link_out.sent)

    flown, told = run(flight(own, LAND), observers=(look,))
    assert asked(opened) == ["land", "rest"]
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert len(named(told, "land_mode_started")) == 1
    assert named(told, "land_mode_refused") == []
    assert len(named(told, "landed")) == 1
    assert set(commands) == {HANDED_OVER}
    assert is_down(flown)
    assert flown.summary["sim_time_s"] - AT == pytest.approx(0.6 / -SINKS, abs=0.6)


@pytest.mark.parametrize(
    ("way", "reason", "code"),
    [
        ("refuses", "COMMAND_DENIED: no position", 1),
        pytest.param("leaves", "COMMAND_DENIED: no position", 1, marks=pytest.mark.thorough),
        pytest.param("hangs", "it has not landed within 13 s", 1, marks=pytest.mark.thorough),
        ("breaks", "DriverError: the cable is out", 3),
    ],
)
def test_a_mode_that_does_not_land_it_gives_way_to_our_own_landing(run, way, reason, code):
    own, opened = driver(way)
    flown, told = run(flight(own, LAND))
    assert asked(opened) == ["land", "send", "rest"]
    assert path(told, "a") == ["up", "hold", "auto_land", "auto_land", "fault"]
    [refused] = named(told, "land_mode_refused")
    assert refused.fields["reason"] == reason
    assert flown.exit_code == code
    assert is_down(flown)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("severer", "way", "then"),
    [(Reaction.LAND_BLIND, ["land_blind", "auto_land", "fault"], ["land", "send", "rest"]),
     (Reaction.CUT, ["fault"], ["land", "rest"])],
)  # fmt: skip
def test_what_is_severer_ends_the_mode(run, severer, way, then):
    own, opened = driver("lands")
    alarms = alarming((AT, AT + 0.2, Reaction.LAND), (AT + 0.4, AT + 0.6, severer))
    flown, told = run(flight(own, alarms))
    assert path(told, "a") == ["up", "hold", "auto_land", *way]
    assert asked(opened) == then
    assert is_down(flown)


@pytest.mark.thorough
@pytest.mark.parametrize("way", ["lands", "refuses"])
def test_one_that_lands_without_a_position_lands_blind_by_its_own_mode(run, way):
    own, opened = driver(way, lands_blind=True)
    flown, told = run(flight(own, alarming((AT, AT + 0.2, Reaction.LAND_BLIND))))
    refuses = way == "refuses"
    assert asked(opened) == (["land", "send", "rest"] if refuses else ["land", "rest"])
    again = ["land_blind", "auto_land"] if refuses else []
    assert path(told, "a") == ["up", "hold", "land_blind", *again, "fault"]
    assert len(named(told, "land_mode_refused")) == refuses
    assert is_down(flown)


@pytest.mark.thorough
def test_a_vehicle_whose_link_is_silent_is_not_asked(run):
    own, opened = driver("silent")
    silence = part("supervisors", "link")
    _, told = run(flight(own, supervisors=(silence,)))
    assert named(told, "failsafe_started")[0].fields["reaction"] == "land"
    assert path(told, "a")[2] == "auto_land"
    assert "land" not in asked(opened)
    assert named(told, "land_mode_started") == []


@pytest.mark.thorough
def test_neither_is_one_whose_driver_has_no_land_mode(run):
    own, opened = driver("lands", lands=False)
    flown, told = run(flight(own, LAND))
    assert asked(opened) == ["send", "rest"]
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert is_down(flown)


def test_a_link_that_says_nothing_of_a_land_mode_refuses():
    class Plain(Link):
        def read(self, now):
            return ()

        def send(self, command, now):
            raise AssertionError

    out = LinkOut(flight(driver("lands")[0]), Plain(), LinkGuard("sim", lambda failure: None), None)
    with pytest.raises(Refused, match="no land mode"):
        out.land(0)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("alarms", "way"),
    [((), ["down", "landed"]),
     ((alarming((AT, AT + 0.2, Reaction.GO_HOME)),), ["auto_home", "auto_land", "fault"])],
)  # fmt: skip
def test_the_missions_own_landing_and_go_home_do_not_use_it(run, alarms, way):
    own, opened = driver("lands")
    flown, told = run(flight(own, *alarms, seconds=3.0))
    assert path(told, "a") == ["up", "hold", *way]
    assert "land" not in {what for _, what in opened[0].calls}
    assert is_down(flown)


@pytest.mark.thorough
def test_an_interrupt_lands_by_it(run):
    own, opened = driver("lands")

    def interrupt(engine):
        if engine.seconds() >= AT:
            engine.interrupts = 1

    flown, told = run(flight(own), observers=(interrupt,))
    assert asked(opened)[-2:] == ["land", "rest"]
    assert len(named(told, "land_mode_started")) == 1
    assert flown.exit_code == 130
    assert is_down(flown)


@pytest.mark.thorough
def test_a_part_that_fails_lands_by_it(run):
    cascade = part("trackers", "cascade")

    class Fails(cascade.cls):
        def update(self, setpoint, tick):
            if tick.now >= AT * NS:
                raise ZeroDivisionError("a lab's own bug")
            return super().update(setpoint, tick)

    own, opened = driver("lands")
    flown, told = run(flight(own, tracker=replace(cascade, cls=Fails)))
    assert asked(opened) == ["land", "rest"]
    assert path(told, "a") == ["up", "hold", "auto_land", "fault"]
    assert is_down(flown)
