"""Who has the vehicle, what it is told and what it tells."""

from __future__ import annotations

import random

import pytest
from framing import ARM, FAILED, INTERVAL, REJECTED, REQUEST, SET_MODE, UNSUPPORTED, Framing
from scripted_autopilot import (
    AIR,
    BOTH,
    GROUND,
    LANDING,
    RESTING,
    STREAM,
    UP,
    Bench,
    at,
    estimate,
    flying,
    mavlink,
    standing,
)
from test_preflight_checks import looked

from kybflow.core.errors import DriverError, Refused
from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS, Imu, Odometry
from kybflow.drivers.mavlink.protocol.framing import NUMBERS
from kybflow.drivers.mavlink.transport.router import heartbeat
from kybflow.parts import Effect, StatusText
from kybflow.world.vehicle_context import Parcel

STEADY = frozenset(
    NUMBERS[name]
    for name in (
        "CURRENT_MODE", "SYS_STATUS", "EXTENDED_SYS_STATE", "ATTITUDE_QUATERNION",
        "LOCAL_POSITION_NED", "HIGHRES_IMU", "ESTIMATOR_STATUS", "BATTERY_STATUS",
        "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "RC_CHANNELS",
    )
)  # fmt: skip
"""The messages that every PX4 is asked for, beside its heartbeat."""
ATTITUDE, POSITION = NUMBERS["ATTITUDE_QUATERNION"], NUMBERS["LOCAL_POSITION_NED"]
IMU, SERVOS, THROTTLE = (NUMBERS[n] for n in ("HIGHRES_IMU", "SERVO_OUTPUT_RAW", "VFR_HUD"))


def land(bench, seconds):
    """Whether it rests after that time."""
    for _ in range(round(seconds * 50)):
        bench.tick()
        landed = bench.link.land(bench.now)
    return landed


def reason(bench):
    return bench.link.override.reason


def test_heartbeats_of_a_ground_station_and_of_a_computer_come_with_the_tick():
    bench = Bench()
    bench.run(10.0)
    kinds = [m.type for m in bench.fake.took("HEARTBEAT")]
    assert kinds.count(mavlink.MAV_TYPE_GCS) == 10
    assert kinds.count(mavlink.MAV_TYPE_ONBOARD_CONTROLLER) == 10


def test_streams_are_asked_for_and_what_does_not_come_again():
    bench = Bench()
    bench.run(8.0)
    asked = [m.param1 for m in bench.fake.commands(INTERVAL) if m.param2 > 0.0]
    assert set(asked) == STEADY
    assert asked.count(ATTITUDE) == 1
    assert asked.count(IMU) == 2


def test_px4s_heartbeat_is_requested_and_ardupilots_rate_is_set():
    for name, requests, intervals in (("px4", 8, 0), ("ardupilot", 0, 1)):
        bench = Bench(name)
        bench.run(2.0)
        polls = [m for m in bench.fake.commands(REQUEST) if m.param1 == 0.0]
        rates = [m for m in bench.fake.commands(INTERVAL) if m.param1 == 0.0]
        assert len(polls) == pytest.approx(requests, abs=1)
        assert len(rates) == intervals


def test_the_imu_is_asked_for_at_its_full_rate_once_somebody_flies_by_it():
    bench = Bench()
    bench.run(8.0)
    imu = [m.param2 for m in bench.fake.commands(INTERVAL) if m.param1 == IMU]
    assert set(imu) == {40_000.0}
    bench.fake.sent.clear()
    bench.link.subscribe(frozenset({Imu}))
    bench.link.subscribe(frozenset({Imu, Odometry}))
    bench.run(0.1)
    assert [(m.param1, m.param2) for m in bench.fake.commands(INTERVAL)] == [
        (IMU, 10_000.0), (ATTITUDE, 20_000.0), (POSITION, 20_000.0),
    ]  # fmt: skip


def test_its_own_estimate_comes_more_rarely_where_nobody_flies_by_it():
    bench = Bench()
    bench.run(8.0)
    own = [m.param2 for m in bench.fake.commands(INTERVAL) if m.param1 in (ATTITUDE, POSITION)]
    assert set(own) == {40_000.0}


def test_what_only_some_vehicles_need_is_asked_of_those_alone():
    def asked(**params):
        bench = standing(**params)
        return {m.param1 for m in bench.fake.commands(INTERVAL)} - {0.0, *STEADY}

    assert asked() == set()
    assert asked(position="own") == {mavlink.MAVLINK_MSG_ID_GPS_RAW_INT}
    assert asked(simulator=True) == {mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION}
    assert asked(payload=Parcel(mass=0.2, size=0.1)) == {mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW}


def test_an_imu_that_is_needed_from_the_beginning_is_never_slow():
    bench = Bench()
    bench.link.subscribe(frozenset({Imu}))
    bench.run(8.0)
    assert {m.param2 for m in bench.fake.commands(INTERVAL) if m.param1 == IMU} == {10_000.0}


def unread(bench, seconds):
    """Let time pass in which VFR_HUD comes in every tick and HOME_POSITION once a second, beside
    SERVO_OUTPUT_RAW, which a vehicle without payload does not read either; what was switched off,
    by number."""
    for tick in range(round(seconds * 50)):
        bench.fake.send(mavlink.MAVLink_vfr_hud_message(0.0, 0.0, 0, 0, 0.0, 0.0))
        if tick % 50 == 0:
            bench.fake.send(
                mavlink.MAVLink_home_position_message(
                    0, 0, 0, 0.0, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], *3 * [0.0]
                )
            )
        bench.tick()
    return [m.param1 for m in bench.fake.commands(INTERVAL) if m.param2 == -1.0]


def test_what_comes_often_and_unread_is_switched_off_and_on_again_at_the_end():
    bench = Bench()
    assert unread(bench, 1.5) == []
    assert unread(bench, 1.0) == [SERVOS, THROTTLE]
    bench.close()
    back = [(m.param1, m.param2) for m in bench.fake.commands(INTERVAL)[-2:]]
    assert back == [(SERVOS, 0.0), (THROTTLE, 0.0)]


def test_every_stream_comes_as_before_once_the_link_is_closed():
    bench = standing()
    asked = {m.param1 for m in bench.fake.commands(INTERVAL)}
    assert len(asked) > 5
    bench.close()
    assert {m.param1 for m in bench.fake.commands(INTERVAL) if m.param2 == 0.0} == asked


def test_an_autopilot_that_does_not_switch_off_is_flown_all_the_same():
    bench = Bench()
    bench.fake.refuses[INTERVAL] = (UNSUPPORTED, "")
    assert set(unread(bench, 20.0)) == {36.0, 74.0}
    bench.fly()
    assert bench.link.override is None


@pytest.mark.parametrize("kind", [mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ONBOARD_CONTROLLER])
def test_nothing_is_switched_off_where_somebody_else_listens_too(kind):
    bench = Bench()
    beside = Framing(255, 190)
    bench.fake.wire.send(beside.pack(heartbeat(kind)))
    assert unread(bench, 12.0) == []


def test_set_points_go_out_at_their_rate_in_its_own_frame():
    bench = flying()
    bench.fake.sent.clear()
    bench.run(1.0, at((1.0, 2.0, 3.0)))
    sent = bench.fake.took(STREAM)
    assert 49 <= len(sent) <= 51
    assert (sent[-1].x, sent[-1].y, sent[-1].z) == (2.0, 1.0, -3.0)


def test_set_points_stop_with_the_engine():
    bench = flying()
    bench.fake.sent.clear()
    bench.run(5.0)
    assert len(bench.fake.took(STREAM)) <= 13


def test_a_pilot_is_yielded_to_at_once():
    bench = flying()
    bench.fake.go("POSITION")
    bench.run(0.04, UP)
    assert reason(bench) == "a pilot took over: POSITION"
    assert not bench.link.override.lands
    bench.fake.sent.clear()
    bench.run(10.0, UP)
    bench.run(1.0, RESTING)
    assert bench.fake.took(STREAM) == []
    assert bench.fake.commands(SET_MODE) == bench.fake.commands(ARM) == []
    with pytest.raises(Refused, match="a pilot took over"):
        bench.link.land(bench.now)


def test_it_is_taken_back_only_when_asked():
    bench = flying()
    bench.fake.go("POSITION")
    bench.run(1.0, UP)
    bench.fake.position = (4.0, 0.0, 1.0)
    bench.run(0.1, UP)
    bench.fake.sent.clear()
    bench.link.reclaim(bench.now)
    bench.run(0.9, UP)
    assert bench.link.override is not None
    assert {m.y for m in bench.fake.took(STREAM)} == {4.0}
    bench.run(1.0, UP)
    assert bench.link.override is None
    assert bench.fake.mode == bench.fake.profile.modes["offboard"]
    assert bench.fake.took(STREAM)[-1].z == -1.0


def test_its_own_failsafe_is_known_by_its_words_which_may_be_late():
    bench = flying()
    bench.fake.go("LAND")
    bench.run(0.2, UP)
    assert bench.link.override is None
    bench.fake.say("Offboard control signal lost")
    bench.run(0.1, UP)
    assert reason(bench) == "its own failsafe: LAND ('Offboard control signal lost')"
    assert bench.link.override.lands


@pytest.mark.parametrize(("text", "severity"), [("Fence Breached", 5), ("Battery 1 is low", 4)])
def test_a_failsafe_that_its_words_tell_is_no_persons(text, severity):
    bench = flying("ardupilot")
    bench.fake.say(text, severity)
    bench.fake.go("RTL")
    bench.run(0.2, UP)
    assert reason(bench) == f"its own failsafe: RTL ('{text}')"
    assert bench.link.override.lands


def test_where_nobody_says_why_that_is_said():
    bench = flying()
    bench.fake.go("RETURN")
    bench.run(1.0, UP)
    assert "for an unknown reason" in reason(bench)
    assert not bench.link.override.lands


@pytest.mark.parametrize("after", ["land", "resume"])
def test_after_a_cut_link_it_is_landed_or_resumed_as_asked(after):
    bench = flying(after_failsafe=after)
    bench.fake.position = (0.0, 0.0, 1.0)
    bench.run(0.1, UP)
    bench.cut(5.0, UP)
    bench.fake.go("LAND")
    bench.run(0.5, UP)
    assert reason(bench).startswith("its own failsafe: LAND, after 5.0 s without a link")
    assert bench.link.override.lands == (after == "land")
    bench.run(4.0, UP)
    assert (bench.link.override is None) == (after == "resume")


@pytest.mark.parametrize(("landed", "height"), [(GROUND, 1.0), (AIR, 0.1)])
def test_one_that_its_failsafe_has_landed_does_not_take_off_again_unasked(landed, height):
    bench = flying(after_failsafe="resume")
    bench.fake.position = (0.0, 0.0, height)
    bench.cut(5.0, UP)
    bench.fake.landed = landed
    bench.fake.go("LAND")
    bench.run(6.0, UP)
    assert bench.link.override is not None
    assert bench.fake.mode == bench.fake.profile.modes["land"]


def test_a_failsafe_that_lands_is_joined_by_its_land_mode():
    bench = flying()
    bench.fake.say("Failsafe activated")
    bench.fake.go("RETURN")
    bench.run(0.5, UP)
    assert not bench.link.land(bench.now)
    bench.run(0.5)
    assert bench.fake.mode == bench.fake.profile.modes["land"]
    assert bench.link.override is None


def test_its_own_land_mode_ends_disarmed():
    bench = flying()
    assert not land(bench, 1.0)
    bench.fake.sent.clear()
    bench.run(1.0)
    assert bench.fake.took(STREAM) == []
    bench.fake.armed, bench.fake.landed = False, GROUND
    bench.run(1.0)
    assert bench.link.land(bench.now)


def test_a_land_mode_that_is_refused_says_why_and_set_points_fly_on():
    bench = flying()
    bench.fake.refuses[SET_MODE] = (REJECTED, "Mode not possible")
    with pytest.raises(Refused, match=r"from OFFBOARD to LAND.*Mode not possible"):
        land(bench, 10.0)
    bench.fake.refuses.clear()
    bench.fake.sent.clear()
    bench.run(2.0, UP)
    assert bench.fake.took(STREAM)
    assert bench.link.override is None


def test_a_land_mode_that_a_pilot_leaves_is_his():
    bench = flying()
    land(bench, 1.0)
    bench.fake.go("POSITION")
    bench.tick()
    with pytest.raises(Refused, match="a pilot took over"):
        bench.link.land(bench.now)
    bench.fake.sent.clear()
    bench.run(3.0, UP)
    assert bench.fake.took(STREAM) == []


def test_a_disarm_on_the_ground_is_waited_out_and_one_in_the_air_is_not():
    bench = flying()
    bench.fake.armed, bench.fake.landed = False, GROUND
    bench.run(2.0, UP)
    assert bench.link.override is None
    bench.run(3.0, RESTING)
    assert bench.link.override is None
    bench = flying()
    bench.fake.armed, bench.fake.landed = False, AIR
    bench.run(0.5, UP)
    assert reason(bench).startswith("it disarmed in the air")


def test_the_target_of_a_mode_that_is_not_ours_is_nobody_elses():
    """PX4 tells the targets of a pilot's modes too, and those of its own failsafes."""
    bench = flying()
    away = mavlink.MAVLink_position_target_local_ned_message(0, 1, 0xDF8, 3.0, *[0.0] * 10)
    for mode, foreign in (("POSITION", 0), ("offboard", 1)):
        bench.fake.mode = bench.fake.profile.modes[mode]
        for _ in range(4):
            bench.run(0.25, UP)
            bench.fake.send(away)
        bench.run(0.02)
        assert len(bench.link.foreign_commands()) == foreign


@BOTH
def test_one_that_stays_armed_is_disarmed_by_force_unless_it_says_that_it_flies(name):
    bench = flying(name)
    bench.fake.refuses[ARM] = (FAILED, "Disarm refused: not landed")
    with pytest.raises(Refused, match="it reports that it is in the air"):
        bench.link.disarm_by_force(bench.now)
    bench.fake.landed = LANDING
    bench.run(8.0, RESTING)
    assert bench.link.armed
    bench.link.disarm_by_force(bench.now)
    bench.run(1.0, RESTING)
    assert not bench.link.armed
    assert bench.link.override is None


def told(bench, seconds, position=ZERO, source="mocap", age=0.01):
    for _ in range(round(seconds * 50)):
        bench.tick()
        bench.link.tell_position(estimate(bench.now, position, source, age), bench.now)
    return bench.fake.took("ODOMETRY")


def test_it_is_told_where_it_is_at_its_own_rate():
    bench = standing(vision_rate=25.0)
    assert 49 <= len(told(bench, 2.0)) <= 51


def test_an_old_estimate_is_not_told_and_neither_is_one_where_it_knows_itself():
    bench = standing()
    assert told(bench, 1.0, age=0.2) == []
    bench = standing(position="own")
    assert told(bench, 1.0) == []


def test_a_jump_and_another_source_count_as_resets():
    bench = standing()
    assert told(bench, 1.0)[-1].reset_counter == 0
    assert told(bench, 1.0, (0.2, 0.0, 0.0))[-1].reset_counter == 0
    assert told(bench, 1.0, (1.2, 0.0, 0.0))[-1].reset_counter == 1
    assert told(bench, 1.0, (1.2, 0.0, 0.0), "tags")[-1].reset_counter == 2


def test_only_ardupilot_is_told_a_place_on_earth():
    for name, count in (("ardupilot", True), ("px4", False)):
        bench = standing(name)
        told(bench, 1.0)
        assert bool(bench.fake.took("SET_GPS_GLOBAL_ORIGIN")) == count


def test_its_own_position_is_laid_where_the_mission_begins():
    bench = Bench(position="own")
    bench.fake.position = (7.0, 8.0, 1.0)
    bench.run(1.0)
    last = [m for m in bench.measured if isinstance(m, Odometry)][-1]
    assert last.position == pytest.approx(ZERO)
    assert bench.arm(command=at((0.0, 0.0, 2.0)))
    bench.run(0.1, at((0.0, 0.0, 2.0)))
    sent = bench.fake.took(STREAM)[-1]
    assert (sent.x, sent.y, sent.z) == pytest.approx((8.0, 7.0, -3.0))


def test_what_it_says_of_warning_or_worse_is_told_once():
    bench = Bench()
    bench.run(0.1)
    bench.fake.say("all well", 6)
    bench.fake.say("Preflight Fail: no position", 2)
    bench.fake.say("Preflight Fail: no position", 2)
    bench.run(0.1)
    assert bench.link.status_texts() == [StatusText("critical", "Preflight Fail: no position")]
    assert bench.link.status_texts() == ()


def test_silence_from_the_start_is_an_error_with_a_way_out_and_later_it_is_age():
    bench = Bench()
    bench.fake.is_quiet = True
    said = r"system 1 was silent.*nothing is heard.*\? Start it.*`address`"
    with pytest.raises(DriverError, match=said):
        bench.run(11.0)
    bench = standing()
    bench.fake.is_quiet = True
    bench.run(30.0)


def test_whatever_is_said_nothing_breaks():
    chance = random.Random(7)
    bench = flying("px4", position="own", simulator=True, payload=Parcel(mass=0.2, size=0.1))
    for number, sort in mavlink.mavlink_map.items():
        for _ in range(20):
            payload = chance.randbytes(sort.unpacker.size)
            bench.wire.other.send(frame(number, payload, sort.crc_extra))
        bench.tick()
        bench.link.tell_position(estimate(bench.now), bench.now)
        bench.link.send(UP, bench.now)
        bench.link.status_texts()
        bench.link.truth()


def frame(number, payload, extra):
    """A frame of system 1, component 1, whose checksum is right."""
    head = bytes((len(payload), 0, 0, 0, 1, 1)) + number.to_bytes(3, "little")
    body = head + payload
    checksum = mavlink.x25crc(body + bytes((extra,))).crc
    return b"\xfd" + body + checksum.to_bytes(2, "little")


def test_closing_puts_the_mode_of_a_disarmed_vehicle_back():
    bench = standing("ardupilot", position="own")
    looked(bench)
    bench.close()
    assert bench.fake.mode == bench.fake.profile.modes["hold"]


def test_what_was_forgotten_after_a_start_is_asked_for_again():
    bench = Bench()
    bench.run(20.0)
    asked = len(bench.fake.commands(INTERVAL))
    bench.now += NS
    bench.fake.is_quiet, bench.fake.deaf_to = True, {REQUEST}
    bench.run(4.0)
    bench.fake.is_quiet = False
    bench.run(1.0)
    assert len(bench.fake.commands(INTERVAL)) >= asked + len(STEADY)


def test_on_a_firmwares_simulator_faults_cut_the_link_on_our_side_and_on_hardware_nothing_does():
    bench = Bench(simulator=True)
    bench.run(2.0)
    rig, cut = bench.link.faults, Effect(deaf=True, mute=True)
    assert rig is not None
    rig.begin(cut, bench.now)
    sent, heard = len(bench.fake.sent), len(bench.measured)
    bench.run(1.0, at(ZERO))
    assert (len(bench.fake.sent), len(bench.measured)) == (sent, heard)
    rig.end(cut)
    bench.run(1.0, at(ZERO))
    assert len(bench.fake.sent) > sent
    assert len(bench.measured) > heard
    assert Bench().link.faults is None
