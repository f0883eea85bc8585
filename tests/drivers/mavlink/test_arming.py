"""Getting ready, refused in its own words, and resting again."""

from __future__ import annotations

import pytest
from framing import ARM, FAILED, REJECTED, SET_MODE, TAKEOFF
from scripted_autopilot import (
    AIR,
    GROUND,
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
from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import Command, CommandKind, Setpoint, SetpointKind
from kybflow.drivers.mavlink.control.arming import FORCE


def order(fake, *kinds):
    """The sort of what was sent, each run of the same as one."""
    found = []
    for message in fake.sent:
        sort = message.get_type()
        name = message.command if sort == "COMMAND_LONG" else sort
        if name in kinds and found[-1:] != [name]:
            found.append(name)
    return found


def test_px4_has_set_points_for_a_second_before_the_mode_and_then_arms():
    bench = standing("px4")
    begun = bench.now
    assert bench.arm()
    assert order(bench.fake, STREAM, SET_MODE, ARM)[:2] == [STREAM, SET_MODE]
    before = bench.fake.sent.index(bench.fake.commands(SET_MODE)[0])
    assert sum(m.get_type() == STREAM for m in bench.fake.sent[:before]) >= 45
    assert bench.now - begun >= 1_000_000_000
    assert bench.link.armed
    assert bench.fake.commands(TAKEOFF) == []


def test_ardupilot_is_asked_to_take_off_and_follows_once_it_lifted():
    bench = standing("ardupilot")
    assert bench.arm()
    kinds = (SET_MODE, ARM, TAKEOFF, STREAM)
    assert order(bench.fake, *kinds)[:3] == [SET_MODE, ARM, TAKEOFF]
    assert bench.fake.commands(TAKEOFF)[0].param7 == pytest.approx(0.5)
    assert bench.fake.took(STREAM) == []
    bench.run(0.2, UP)
    assert bench.fake.took(STREAM)


def test_an_acknowledgement_alone_does_not_arm():
    bench = standing("px4")
    bench.fake.obeys = False
    bench.fake.mode = bench.fake.profile.modes["offboard"]
    assert not bench.arm(5.0)


def test_a_refusal_is_in_its_own_words_and_leaves_it_at_rest():
    bench = standing("px4", arming_time=5.0)
    bench.fake.refuses[ARM] = (REJECTED, "Arming denied: Resolve health failures first")
    with pytest.raises(Refused) as refusal:
        bench.arm()
    bench.tick()
    said = str(refusal.value)
    assert said.startswith("px4 won't arm: ")
    assert "TEMPORARILY_REJECTED" in said
    assert said.count("Resolve health failures first") == 1
    bench.fake.sent.clear()
    bench.run(2.0, RESTING)
    assert bench.fake.took(STREAM) == []
    assert not bench.fake.armed


def test_one_that_is_not_ready_says_what_keeps_it():
    bench = standing("ardupilot", arming_time=4.0)
    bench.fake.flags = 167
    bench.fake.refuses[ARM] = (FAILED, "Arm: Need Position Estimate")
    with pytest.raises(Refused, match="Need Position Estimate"):
        bench.arm()


def test_a_take_off_that_is_refused_ends_disarmed():
    bench = standing("ardupilot", arming_time=4.0)
    bench.fake.refuses[TAKEOFF] = (FAILED, "Takeoff refused")
    with pytest.raises(Refused, match=r"won't take off.*Takeoff refused"):
        bench.arm()
    bench.run(2.0, RESTING)
    assert not bench.fake.armed


def test_resting_disarms_and_never_by_force():
    bench = flying("px4")
    bench.fake.landed = GROUND
    bench.run(1.0, RESTING)
    assert bench.link.armed is False
    assert {m.param2 for m in bench.fake.commands(ARM)} == {0.0}


def test_what_won_t_disarm_lands_by_its_own_mode():
    bench = flying("px4")
    bench.fake.landed = GROUND
    bench.fake.refuses[ARM] = (REJECTED, "Disarming denied")
    bench.run(3.0, RESTING)
    assert bench.fake.mode == bench.fake.profile.modes["land"]
    bench.fake.refuses.clear()
    bench.run(5.0, RESTING)
    assert bench.link.armed is False


def test_what_does_not_know_that_it_is_on_the_ground_lands_before_it_is_disarmed():
    bench = flying("px4")
    asked = len(bench.fake.commands(ARM))
    bench.run(0.2, RESTING)
    assert bench.fake.mode == bench.fake.profile.modes["land"]
    bench.run(2.0, RESTING)
    assert len(bench.fake.commands(ARM)) == asked
    bench.fake.landed = GROUND
    bench.run(0.3, RESTING)
    assert bench.link.armed is False


@pytest.mark.parametrize("told", [True, False])
def test_only_what_is_sent_no_positions_any_more_idles_after_a_landing_by_thrust(told):
    bench = flying("px4")
    for _ in range(50):
        bench.link.tell_position(estimate(bench.now), bench.now)
        bench.run(0.02, Command(LEVEL, 1.0, ZERO, None))
    bench.run(0.0 if told else 0.6, Command(LEVEL, 1.0, ZERO, None))
    bench.run(0.1, RESTING)
    bench.fake.sent.clear()
    bench.run(0.5, RESTING)
    assert bool(bench.fake.took("SET_ATTITUDE_TARGET")) is not told
    assert bench.fake.mode == bench.fake.profile.modes["land" if told else "offboard"]


def test_what_was_landed_by_thrust_idles_until_it_detects_the_landing():
    bench = flying("px4")
    level = Command(LEVEL, 1.0, ZERO, None)
    bench.run(0.5, level)
    bench.run(0.1, RESTING)
    bench.fake.sent.clear()
    bench.run(1.0, RESTING)
    assert bench.fake.mode == bench.fake.profile.modes["offboard"]
    idle = bench.fake.took("SET_ATTITUDE_TARGET")
    assert len(idle) >= 40
    assert {m.thrust for m in idle} == {0.0}
    bench.fake.landed = GROUND
    bench.run(0.3, RESTING)
    assert bench.link.armed is False
    bench.fake.sent.clear()
    bench.run(0.5, RESTING)
    assert bench.fake.took("SET_ATTITUDE_TARGET") == []


@pytest.mark.parametrize(
    ("name", "height", "idles"),
    [("px4", 0.1, True), ("px4", 0.5, False), ("ardupilot", 0.1, False)],
)
def test_only_a_px4_landed_by_accelerations_idles_and_only_near_the_ground(name, height, idles):
    """It doesn't detect the landing otherwise, and its land mode would lift it."""
    bench = flying(name)
    sinks = Setpoint(SetpointKind.ACCELERATION, None, None, (0.0, 0.0, -0.5), heading=0.0)
    bench.fake.position = (0.0, 0.0, height)
    bench.run(0.5, Command(LEVEL, 0.0, ZERO, 0.0, True, CommandKind.ACCELERATION, sinks))
    bench.run(0.1, RESTING)
    bench.fake.sent.clear()
    bench.run(0.5, RESTING)
    assert bool(bench.fake.took("SET_ATTITUDE_TARGET")) is idles
    assert bench.fake.mode == bench.fake.profile.modes["offboard" if idles else "land"]
    bench.run(3.0, RESTING)
    assert bench.fake.mode == bench.fake.profile.modes["land"]


def test_what_was_landed_by_thrust_and_does_not_detect_it_lands_by_its_own_mode():
    bench = flying("ardupilot")
    bench.run(0.5, Command(LEVEL, 1.0, ZERO, None))
    bench.run(3.0, RESTING)
    assert bench.fake.mode == bench.fake.profile.modes["land"]


def test_cutting_is_by_force_and_repeated_until_the_rotors_rest():
    bench = flying("px4")
    bench.fake.obeys = False
    bench.link.cut(bench.now)
    bench.run(2.0, RESTING)
    asked = [m for m in bench.fake.commands(ARM) if m.param2 == FORCE]
    assert len(asked) >= 4
    assert {m.param1 for m in asked} == {0.0}
    bench.fake.obeys = True
    bench.run(1.0, RESTING)
    assert bench.link.armed is False


def test_a_vehicle_that_somebody_else_armed_is_not_touched():
    bench = Bench("px4")
    bench.run(5.0, RESTING)
    bench.fake.armed = True
    bench.fake.go("POSITION")
    bench.fake.sent.clear()
    bench.run(5.0, RESTING)
    with pytest.raises(Refused, match="a pilot or another program controls it"):
        bench.link.arm(UP, bench.now)
    bench.run(3.0, RESTING)
    assert bench.fake.commands(ARM) == bench.fake.commands(SET_MODE) == []


def test_one_that_is_armed_again_by_a_person_after_a_flight_is_not_touched():
    bench = flying("px4")
    bench.fake.landed = GROUND
    bench.run(5.0, RESTING)
    assert bench.link.armed is False
    bench.fake.armed = True
    bench.fake.go("POSITION")
    bench.fake.sent.clear()
    bench.fake.landed = AIR
    bench.run(5.0, RESTING)
    assert bench.fake.commands(ARM) == bench.fake.commands(SET_MODE) == []
    assert bench.link.override is not None
    bench.fake.armed, bench.fake.landed = False, GROUND
    bench.run(1.0, RESTING)
    assert bench.arm(command=at(ZERO))
    assert bench.link.override is None


def test_what_would_end_its_own_take_off_waits_until_it_lifted():
    bench = standing("ardupilot")
    assert bench.arm(command=at(ZERO))
    bench.run(1.0, at((0.0, 0.0, 0.1)))
    assert bench.fake.took(STREAM) == []
    bench.run(0.1, at((0.0, 0.0, 0.4)))
    assert bench.fake.took(STREAM)
    bench = standing("ardupilot")
    assert bench.arm(command=at(ZERO))
    bench.run(6.0, at((0.0, 0.0, 0.1)))
    assert bench.fake.took(STREAM)


def test_a_pilot_who_takes_over_while_it_gets_ready_is_not_disarmed():
    bench = standing("ardupilot")
    bench.fake.refuses[TAKEOFF] = (FAILED, "")
    assert not bench.arm(2.0)
    assert bench.fake.armed
    bench.fake.go("LOITER")
    with pytest.raises(Refused, match="a pilot took over: LOITER"):
        bench.arm(2.0)
    bench.fake.sent.clear()
    bench.run(5.0, RESTING)
    assert bench.fake.commands(ARM) == bench.fake.commands(SET_MODE) == []


def test_a_mode_that_was_never_answered_is_not_asked_for_against_a_pilot():
    bench = standing("ardupilot")
    bench.fake.deaf_to.add(SET_MODE)
    bench.arm(0.1)
    bench.fake.go("offboard")
    bench.fake.armed, bench.fake.landed = True, AIR
    assert bench.arm(1.0)
    bench.tick()
    bench.fake.go("STABILIZE")
    bench.tick()
    bench.fake.sent.clear()
    bench.run(3.0, UP)
    assert bench.fake.commands(SET_MODE) == []
