"""Who has the vehicle, where the obvious answer would hurt: after its own failsafe, with stale
positions, when somebody insists, after a new start."""

from __future__ import annotations

import pytest
from framing import ARM, REJECTED, SET_MODE
from scripted_autopilot import (
    AIR,
    BOTH,
    GROUND,
    PERIOD,
    RESTING,
    STREAM,
    UP,
    Bench,
    at,
    estimate,
    flying,
    standing,
)

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS, Odometry

OWN = {"px4": "RETURN", "ardupilot": "RTL"}
HAND = {"px4": "POSITION", "ardupilot": "LOITER"}
OTHER = {"px4": "MISSION", "ardupilot": "AUTO"}


def failed_over(name: str) -> Bench:
    """In the air, and its own failsafe has just had it after a cut link."""
    bench = flying(name, after_failsafe="resume")
    bench.fake.landed, bench.fake.position = AIR, (0.0, 0.0, 1.0)
    bench.run(0.1, UP)
    bench.cut(5.0, UP)
    bench.fake.go(OWN[name])
    bench.run(0.5, UP)
    assert bench.link.override.reason.startswith("its own failsafe")
    bench.fake.sent.clear()
    return bench


@BOTH
def test_it_comes_back_from_its_failsafe(name):
    bench = failed_over(name)
    bench.run(4.0, UP)
    assert bench.link.override is None


@BOTH
@pytest.mark.parametrize("modes", [HAND, OTHER])
def test_it_is_left_to_a_person_who_took_it_from_its_failsafe(name, modes):
    bench = failed_over(name)
    bench.fake.go(modes[name])
    bench.run(5.0, UP)
    bench.fake.go(OWN[name])
    bench.run(10.0, UP)
    assert bench.fake.commands(SET_MODE) == bench.fake.took(STREAM) == []
    assert bench.link.override is not None


@BOTH
def test_a_person_ends_an_attempt_that_is_under_way(name):
    bench = failed_over(name)
    bench.fake.refuses = {SET_MODE: (REJECTED, "")}
    bench.run(3.0, UP)
    assert bench.fake.commands(SET_MODE)
    bench.fake.go(HAND[name])
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
    bench.fake.go(OWN[name])
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
    bench = flying(name)
    bench.fake.landed, bench.fake.position = AIR, (0.0, 0.0, 1.0)
    bench.run(0.1, UP)
    bench.fake.refuses = {SET_MODE: (REJECTED, "")}
    assert not bench.link.land(bench.now)
    bench.run(0.5)
    bench.fake.go(HAND[name])
    bench.run(0.1)
    with pytest.raises(Refused, match="a pilot took over"):
        bench.link.land(bench.now)
    bench.fake.sent.clear()
    bench.run(5.0)
    assert bench.fake.commands(SET_MODE) == []
    assert bench.link.override.reason == f"a pilot took over: {HAND[name]}"


def taken_by_a_pilot(name="px4") -> Bench:
    bench = flying(name)
    bench.fake.go("POSITION" if name == "px4" else "LOITER")
    bench.run(0.5, UP)
    assert bench.link.override is not None
    bench.fake.sent.clear()
    return bench


def deaf_to_positions(bench, monkeypatch) -> None:
    """Its heartbeats go on, its position does not come any more."""
    send = bench.fake.send
    monkeypatch.setattr(
        bench.fake, "send", lambda m: None if m.get_type() == "LOCAL_POSITION_NED" else send(m)
    )


def test_it_is_not_sent_back_to_where_it_was_long_ago(monkeypatch):
    bench = taken_by_a_pilot()
    deaf_to_positions(bench, monkeypatch)
    bench.run(3.0, UP)
    bench.link.reclaim(bench.now)
    bench.run(2.0, UP)
    assert bench.fake.took(STREAM) == []
    assert bench.link.override is not None


@BOTH
def test_nobody_insists_for_ever_on_a_vehicle_that_its_pilot_keeps(name):
    bench = taken_by_a_pilot(name)
    bench.fake.refuses = {SET_MODE: (1, "")}
    bench.link.reclaim(bench.now)
    bench.run(30.0, UP)
    bench.fake.refuses = {}
    bench.fake.sent.clear()
    bench.run(10.0, UP)
    assert bench.fake.took(STREAM) == bench.fake.commands(SET_MODE) == []
    bench.link.reclaim(bench.now)
    bench.run(3.0, UP)
    assert bench.link.override is None


@BOTH
def test_that_nobody_insists_any_more_is_said_with_its_words(name):
    bench = taken_by_a_pilot(name)
    bench.fake.refuses = {SET_MODE: (1, "Mode change denied: not today")}
    bench.link.reclaim(bench.now)
    bench.run(9.0, UP)
    assert bench.link.override.refused == ""
    bench.run(2.0, UP)
    refused = bench.link.override.refused
    assert refused.startswith("it does not change from ")
    assert "not today" in refused
    assert refused.endswith(", asked for 10 s")
    bench.link.reclaim(bench.now)
    assert bench.link.override.refused == ""


def test_that_it_cannot_be_asked_for_is_said(monkeypatch):
    bench = taken_by_a_pilot()
    deaf_to_positions(bench, monkeypatch)
    bench.run(3.0, UP)
    bench.link.reclaim(bench.now)
    assert bench.link.override.refused == "it can't hold its position, which is unknown"


def after_landing(refuses: str) -> Bench:
    """On the ground after a flight, and it won't disarm."""
    bench = flying()
    bench.fake.landed = GROUND
    bench.fake.refuses = {ARM: (1, refuses)}
    assert bench.link.status_texts() == ()
    return bench


def said(bench, seconds):
    """What it is told to have said in this time, while it is to rest."""
    found = []
    for _ in range(round(seconds * 50)):
        bench.run(0.02, RESTING)
        found += [text for _, text in bench.link.status_texts()]
    return found


def test_a_refusal_to_disarm_is_not_told_where_it_rests_soon_after():
    bench = after_landing("Disarming denied: not landed")
    assert said(bench, 2.0) == []
    assert bench.fake.armed
    bench.fake.refuses = {}
    assert said(bench, 20.0) == []
    assert not bench.fake.armed


def test_a_refusal_to_disarm_is_told_once_when_it_does_not_end():
    bench = after_landing("Disarming denied: not landed")
    assert said(bench, 9.5) == []
    assert said(bench, 10.0) == ["Disarming denied: not landed"]


def test_what_else_it_says_while_it_is_disarmed_is_told_at_once():
    bench = after_landing("")
    bench.fake.say("Critical battery", 2)
    assert said(bench, 0.5) == ["Critical battery"]


@pytest.mark.parametrize(
    ("text", "severity"),
    [
        ("Crash: Disarming: AngErr=95>30, Accel=0.5<3.0", 0),
        ("Disarming denied: motors are on fire", 1),
        ("Motors disarmed by a failsafe", 2),
    ],
)
def test_only_a_refusal_to_disarm_is_kept_back_and_none_that_is_an_alert(text, severity):
    bench = after_landing("Disarming denied: not landed")
    assert said(bench, 1.0) == []
    bench.fake.say(text, severity)
    bench.fake.refuses, bench.fake.armed = {}, False
    assert said(bench, 10.0) == [text]


@pytest.mark.parametrize("text", ["Disarm: not landed", "Disarm denied", "DISARMING REJECTED"])
def test_a_refusal_to_disarm_is_known_by_its_words(text):
    bench = after_landing(text)
    assert said(bench, 9.5) == []
    assert said(bench, 10.0) == [text]


@BOTH
def test_one_that_its_pilot_puts_down_is_not_asked_back_any_more(name):
    bench = taken_by_a_pilot(name)
    bench.fake.refuses = {SET_MODE: (1, "")}
    bench.link.reclaim(bench.now)
    bench.run(1.0, UP)
    bench.fake.armed, bench.fake.landed = False, GROUND
    bench.run(1.0, RESTING)
    bench.fake.refuses = {}
    bench.fake.armed, bench.fake.landed = True, AIR
    bench.fake.sent.clear()
    bench.run(8.0, RESTING)
    assert bench.fake.commands(SET_MODE) == bench.fake.commands(ARM) == []
    assert bench.fake.took(STREAM) == []


def test_the_mode_that_a_pilot_chose_stays_when_the_run_ends():
    bench = taken_by_a_pilot()
    bench.fake.armed, bench.fake.landed = False, GROUND
    bench.run(1.0, RESTING)
    bench.fake.sent.clear()
    bench.close()
    assert bench.fake.commands(SET_MODE) == []


def reboot(bench) -> None:
    """Its clock begins anew."""
    start, stream = bench.now // 1_000_000, bench.fake.stream
    bench.fake.stream = lambda ms: stream(ms - start)


def own_frame() -> Bench:
    bench = Bench("px4", position="own")
    bench.fake.position = (2.0, 1.0, 0.0)
    bench.run(2.0)
    assert bench.measured[-1] is not None
    return bench


def places(bench) -> list:
    return [m.position for m in bench.measured if type(m) is Odometry]


def test_a_frame_of_its_own_is_laid_anew_when_it_starts_anew_before_the_flight():
    bench = own_frame()
    assert places(bench)[-1] == pytest.approx(ZERO, abs=1e-6)
    reboot(bench)
    bench.fake.position = (-4.0, 3.0, 0.5)
    bench.run(2.0)
    bench.measured.clear()
    bench.run(0.5)
    assert places(bench)[-1] == pytest.approx(ZERO, abs=1e-6)


def test_where_a_frame_lies_that_began_anew_after_a_flight_is_not_known():
    bench = own_frame()
    assert bench.arm(command=UP)
    bench.run(1.0, UP)
    bench.fake.armed, bench.fake.landed = False, GROUND
    bench.run(1.0, RESTING)
    reboot(bench)
    bench.fake.position = ZERO
    bench.run(1.0, RESTING)
    bench.measured.clear()
    bench.run(2.0, RESTING)
    assert places(bench) == []


@BOTH
def test_nothing_is_sent_while_the_tick_stands_still(name):
    bench = flying(name)
    bench.fake.step(bench.now)
    bench.fake.sent.clear()
    for _ in range(250):
        bench.now += PERIOD
        bench.fake.step(bench.now)
    assert bench.fake.sent == []
    bench.tick()
    bench.fake.sent.clear()
    bench.tick()
    assert bench.fake.took(STREAM) == []


@BOTH
def test_a_refusal_to_arm_ends_the_set_points(name):
    bench = standing(name, arming_time=3.0)
    bench.fake.refuses = {ARM: (4, "PreArm: Compass not calibrated")}
    with pytest.raises(Exception, match="Compass"):
        bench.arm(10.0)
    bench.run(0.1, RESTING)
    bench.fake.refuses = {}
    bench.fake.sent.clear()
    bench.run(10.0, RESTING)
    assert bench.fake.took(STREAM) == bench.fake.commands(ARM) == []
    assert not bench.fake.armed


def test_the_drift_is_learnt_with_its_sign():
    bench = flying("px4")
    for _ in range(500):
        bench.tick()
        x, y, z = bench.fake.position
        bench.link.tell_position(estimate(bench.now, (x + 0.2, y - 0.1, z + 0.05)), bench.now)
        bench.link.send(at((1.2, 0.9, 1.05)), bench.now)
    sent = bench.fake.took(STREAM)[-1]
    assert (sent.y, sent.x, -sent.z) == pytest.approx((1.0, 1.0, 1.0), abs=0.01)
    assert bench.now < 60 * NS
