"""A vehicle that is to be taken back unasked from its own failsafe: when it is not any more."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink")

from framing import REJECTED, SET_MODE
from scripted_autopilot import AIR, Bench, at

from kybflow.core.errors import Refused

UP = at((0.0, 0.0, 1.0))
STREAM = "SET_POSITION_TARGET_LOCAL_NED"
OWN = {"px4": "RETURN", "ardupilot": "RTL"}
HAND = {"px4": "POSITION", "ardupilot": "LOITER"}
OTHER = {"px4": "MISSION", "ardupilot": "AUTO"}
BOTH = pytest.mark.parametrize("name", ["px4", "ardupilot"])


def failed_over(name: str) -> Bench:
    """In the air, and its own failsafe has just had it after a cut link."""
    bench = Bench(name, after_failsafe="resume")
    bench.fly()
    bench.fake.landed, bench.fake.position = AIR, (0.0, 0.0, 1.0)
    bench.run(0.1, UP)
    bench.wire.deaf = bench.wire.mute = True
    bench.run(5.0, UP)
    bench.wire.deaf = bench.wire.mute = False
    go(bench, OWN[name])
    bench.run(0.5, UP)
    assert bench.link.override.reason.startswith("its own failsafe")
    bench.fake.sent.clear()
    return bench


def go(bench: Bench, mode: str) -> None:
    """Into a mode by its own name."""
    names = bench.fake.profile.names
    bench.fake.mode = next(number for number, name in names.items() if name == mode)
    bench.fake.heartbeat()


@BOTH
def test_it_comes_back_from_its_failsafe(name):
    bench = failed_over(name)
    bench.run(4.0, UP)
    assert bench.link.override is None


@BOTH
@pytest.mark.parametrize("modes", [HAND, OTHER])
def test_it_is_left_to_a_person_who_took_it_from_its_failsafe(name, modes):
    bench = failed_over(name)
    go(bench, modes[name])
    bench.run(5.0, UP)
    go(bench, OWN[name])
    bench.run(10.0, UP)
    assert bench.fake.commands(SET_MODE) == bench.fake.took(STREAM) == []
    assert bench.link.override is not None


@BOTH
def test_a_person_ends_an_attempt_that_is_under_way(name):
    bench = failed_over(name)
    bench.fake.refuses = {SET_MODE: (REJECTED, "")}
    bench.run(3.0, UP)
    assert bench.fake.commands(SET_MODE)
    go(bench, HAND[name])
    bench.run(0.1, UP)
    bench.fake.sent.clear()
    bench.fake.refuses = {}
    bench.run(15.0, UP)
    assert bench.fake.commands(SET_MODE) == bench.fake.took(STREAM) == []
    assert bench.link.offboard.modes.reported == HAND[name]
    assert bench.link.override.refused == ""
    bench.link.reclaim(bench.now)
    bench.run(3.0, UP)
    assert bench.link.override is None


@BOTH
def test_one_that_goes_back_by_itself_for_a_moment_still_comes_back(name):
    bench = failed_over(name)
    bench.fake.go("offboard")
    bench.run(0.2, UP)
    go(bench, OWN[name])
    bench.run(4.0, UP)
    assert bench.link.override is None


@BOTH
def test_one_that_does_not_come_is_asked_no_more_and_says_so_once(name):
    bench = failed_over(name)
    bench.fake.refuses = {SET_MODE: (REJECTED, "Mode change denied")}
    bench.run(15.0, UP)
    assert "Mode change denied" in bench.link.override.refused
    bench.fake.refuses = {}
    bench.fake.sent.clear()
    for _ in range(30):
        bench.run(1.0, UP)
        assert "asked for 10 s" in bench.link.override.refused
    assert bench.fake.commands(SET_MODE) == bench.fake.took(STREAM) == []


@BOTH
def test_a_pilot_who_takes_one_that_will_not_land_is_not_asked_over(name):
    bench = Bench(name)
    bench.fly()
    bench.fake.landed, bench.fake.position = AIR, (0.0, 0.0, 1.0)
    bench.run(0.1, UP)
    bench.fake.refuses = {SET_MODE: (REJECTED, "")}
    assert not bench.link.land(bench.now)
    bench.run(0.5)
    go(bench, HAND[name])
    bench.run(0.1)
    with pytest.raises(Refused, match="a pilot took over"):
        bench.link.land(bench.now)
    bench.fake.sent.clear()
    bench.run(5.0)
    assert bench.fake.commands(SET_MODE) == []
    assert bench.link.override.reason == f"a pilot took over: {HAND[name]}"
