"""What an emulated autopilot says: parameters, streams, texts, positions, the truth of its
simulator."""

from __future__ import annotations

import struct

import pytest

mavlink = pytest.importorskip("pymavlink.dialects.v20.all", reason="pymavlink is not installed")

from autopilot_bench import ONBOARD, Bench  # noqa: E402
from framing import ACCEPTED, REJECTED, REQUEST, UNSUPPORTED  # noqa: E402
from sim_worlds import QUIET, seat  # noqa: E402

from kybflow.core.errors import DriverError  # noqa: E402
from kybflow.drivers.emulated_autopilot.firmware import emulated_firmware  # noqa: E402
from kybflow.drivers.emulated_autopilot.state import AutopilotFailures  # noqa: E402
from kybflow.drivers.emulated_autopilot.telemetry import MAKERS  # noqa: E402
from kybflow.drivers.emulation.breaking import read_break  # noqa: E402
from kybflow.drivers.mavlink.firmware import profile_of  # noqa: E402
from kybflow.drivers.mavlink.transport.router import heartbeat  # noqa: E402
from kybflow.parts import Seat  # noqa: E402
from kybflow.world.vehicle_context import Parcel  # noqa: E402

BOTH = pytest.mark.parametrize("name", ["px4", "ardupilot"])
INT32, REAL32 = 6, 9


def kinds(bench):
    return {message.get_type() for message in bench.heard}


@BOTH
def test_its_firmware_has_every_parameter_that_kybflow_looks_at(name):
    profile = profile_of(name)
    named = {s.name for s in profile.indoors} | {d.name for d in profile.dangers}
    assert named - set(emulated_firmware(name).parameters) == set()


@BOTH
def test_its_modes_have_the_numbers_of_the_profile(name):
    assert set(emulated_firmware(name).modes) <= set(profile_of(name).names)


@BOTH
def test_all_parameters_are_listed_once_with_their_indices(name):
    bench = Bench(name, is_prepared=False)
    bench.say(mavlink.MAVLink_param_request_list_message(1, 1))
    bench.run(0.1)
    said = [m for m in bench.heard if m.get_type() == "PARAM_VALUE"]
    assert [m.param_index for m in said] == list(range(said[0].param_count))


def test_px4s_integers_travel_as_bytes():
    bench = Bench("px4", is_prepared=False)
    value = struct.unpack("<f", struct.pack("<i", 4))[0]
    bench.say(mavlink.MAVLink_param_set_message(1, 1, b"COM_OBL_RC_ACT", value, INT32))
    bench.run(0.05)
    answer = bench.last("PARAM_VALUE")
    assert answer.param_type == INT32
    assert struct.unpack("<i", struct.pack("<f", answer.param_value)) == (4,)
    assert bench.pilot.state.parameters["COM_OBL_RC_ACT"] == 4.0


def test_ardupilots_are_plain_floats_and_nobody_answers_for_one_that_it_has_not():
    bench = Bench("ardupilot", is_prepared=False)
    bench.say(mavlink.MAVLink_param_set_message(1, 1, b"FS_GCS_ENABLE", 5.0, REAL32))
    bench.say(mavlink.MAVLink_param_request_read_message(1, 1, b"GPS1_TYPE", -1))
    bench.run(0.05)
    said = [m for m in bench.heard if m.get_type() == "PARAM_VALUE"]
    assert [(m.param_id, m.param_value) for m in said] == [("FS_GCS_ENABLE", 5.0)]


def test_it_comes_as_the_firmware_does_or_prepared():
    assert Bench("px4", is_prepared=False).pilot.state.parameters["COM_OBL_RC_ACT"] == 0.0
    assert Bench("px4").pilot.state.parameters["COM_OBL_RC_ACT"] == 4.0
    assert Bench("ardupilot").pilot.state.parameters["SYSID_MYGCS"] == 245.0
    assert Bench("ardupilot", outside=False).pilot.state.parameters["GPS_TYPE"] == 1.0


def test_px4_streams_richly_and_ardupilot_nothing_unasked():
    px4, ardupilot = Bench("px4"), Bench("ardupilot")
    px4.run(2.0)
    ardupilot.run(2.0)
    assert {"ATTITUDE", "LOCAL_POSITION_NED", "SYS_STATUS"} <= kinds(px4)
    assert kinds(ardupilot) == {"HEARTBEAT"}


@BOTH
def test_a_message_comes_at_the_interval_that_was_asked_for(name):
    bench = Bench(name)
    number = mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e5) != ACCEPTED
    number = mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 1e5) == ACCEPTED
    bench.heard.clear()
    bench.run(2.0)
    count = sum(m.get_type() == "ATTITUDE_QUATERNION" for m in bench.heard)
    assert count == pytest.approx(20, abs=1)
    assert bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, -1) == ACCEPTED
    bench.heard.clear()
    bench.run(1.0)
    assert "ATTITUDE_QUATERNION" not in kinds(bench)


@pytest.mark.parametrize(("name", "rate"), [("px4", 1), ("ardupilot", 5)])
def test_px4s_heartbeat_comes_once_a_second_and_whenever_it_is_requested(name, rate):
    bench, number = Bench(name), mavlink.MAVLINK_MSG_ID_HEARTBEAT
    is_set = bench.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 2e5) == ACCEPTED
    assert is_set == (name == "ardupilot")
    bench.heard.clear()
    bench.run(4.0)
    beats = [m for m in bench.heard if m.get_type() == "HEARTBEAT"]
    assert len(beats) == pytest.approx(4 * rate, abs=1)
    assert bench.command(mavlink.MAV_CMD_REQUEST_MESSAGE, number) == ACCEPTED


def test_streams_are_asked_for_in_groups_too():
    bench = Bench("ardupilot")
    bench.say(mavlink.MAVLink_request_data_stream_message(1, 1, 10, 4, 1))
    bench.run(1.0)
    assert "ATTITUDE" in kinds(bench)
    assert "RAW_IMU" not in kinds(bench)


def test_a_collision_saturates_what_its_imu_says():
    bench = Bench("ardupilot")
    bench.run(0.1)
    hit = bench.pilot.state.estimator.imu._replace(specific_force=(900.0, 0.0, -900.0))
    bench.pilot.add_measurement(hit, bench.now)
    said = MAKERS["RAW_IMU"](bench.pilot)
    assert (said.xacc, said.zacc) == (32767, 32767)


def test_px4_talks_to_ground_stations_alone_and_in_chunks():
    words = "Preflight Fail: " + "something that takes many words " * 3
    bench = Bench("px4")
    bench.beats = ONBOARD
    bench.pilot.failures.refuse = words
    bench.run(1.0)
    assert bench.arm() == REJECTED
    assert bench.texts() == ""
    bench.say(heartbeat(mavlink.MAV_TYPE_GCS))
    assert bench.arm() == REJECTED
    said = [m for m in bench.heard if m.get_type() == "STATUSTEXT"]
    assert [(m.id, m.chunk_seq) for m in said[:3]] == [(said[0].id, n) for n in range(3)]
    assert "".join(m.text for m in said[:3]) == f"{words}\t"


def test_another_vehicles_messages_are_not_heeded():
    bench = Bench("px4")
    bench.say(mavlink.MAVLink_command_long_message(2, 1, REQUEST, 0, 0, 0, 0, 0, 0, 0, 0))
    bench.run(0.1)
    assert bench.last("COMMAND_ACK") is None


@BOTH
def test_it_keeps_time_and_has_no_missions(name):
    bench = Bench(name)
    bench.run(1.0)
    bench.say(mavlink.MAVLink_timesync_message(0, 123))
    bench.say(mavlink.MAVLink_mission_request_list_message(1, 1))
    bench.run(0.05)
    answer = bench.last("TIMESYNC")
    assert answer.ts1 == 123
    assert answer.tc1 == pytest.approx(bench.pilot.boot_us(bench.now) * 1000, abs=60_000_000)
    assert bench.last("MISSION_COUNT").count == 0
    assert bench.command(31000) == UNSUPPORTED


def test_odometry_counts_in_its_own_frames_alone():
    bench = Bench("ardupilot")
    bench.sees = False
    bench.say(bench.vision((0.0, 0.0, 0.0), frame=1))
    bench.run(0.1)
    assert bench.pilot.state.estimator.unseen(bench.now) is None
    bench.say(bench.vision((0.0, 0.0, 0.0)))
    bench.run(0.1)
    assert bench.pilot.state.estimator.unseen(bench.now) is not None


@pytest.mark.parametrize(("name", "is_fused"), [("px4", False), ("ardupilot", True)])
def test_mocap_messages_are_fused_by_ardupilot_alone(name, is_fused):
    bench = Bench(name)
    bench.sees = False
    bench.say(mavlink.MAVLink_att_pos_mocap_message(0, [1, 0, 0, 0], 0.0, 0.0, 0.0))
    bench.run(0.1)
    assert (bench.pilot.state.estimator.unseen(bench.now) is not None) is is_fused


@pytest.mark.parametrize(
    ("name", "kind"), [("px4", "HIL_STATE_QUATERNION"), ("ardupilot", "SIM_STATE")]
)
def test_its_simulator_tells_the_truth_on_request(name, kind):
    place = seat(at=(1.0, 2.0, 0.0), heading=0.5, params=QUIET)
    bench = Bench(name, context=place)
    told, origin = bench.request(kind), bench.firmware.origin
    degrees = (told.lat_int, told.lon_int) if kind == "SIM_STATE" else (told.lat, told.lon)
    height = told.alt if kind == "SIM_STATE" else told.alt * 1e-3
    local = origin.local(degrees[0] * 1e-7, degrees[1] * 1e-7, height)
    assert local == pytest.approx((1.0, 2.0, 0.0), abs=0.02)


@BOTH
def test_a_local_position_is_north_east_down(name):
    place = seat(at=(1.0, 2.0, 0.0), params=QUIET)
    bench = Bench(name, context=place)
    bench.set_origin()
    bench.run(1.0)
    told = bench.request("LOCAL_POSITION_NED")
    assert (told.x, told.y, told.z) == pytest.approx((2.0, 1.0, 0.0), abs=0.02)


def carrying(name):
    context, params = seat(params=QUIET)
    parcel = Parcel(mass=0.1, size=0.05)
    return Bench(name, context=Seat(context._replace(payload=parcel), params))


def test_ardupilots_servo_lets_the_parcel_go():
    bench = carrying("ardupilot").take_off(1.0)
    assert bench.command(mavlink.MAV_CMD_DO_SET_ACTUATOR, -1) == UNSUPPORTED
    assert bench.command(mavlink.MAV_CMD_DO_SET_SERVO, 9, 1100) == ACCEPTED
    bench.run(1.5)
    assert bench.truth.payload[2] < 0.1
    assert bench.request("SERVO_OUTPUT_RAW").servo9_raw == 1100


def test_px4s_gripper_moves_only_while_it_is_armed_whatever_it_acknowledges():
    bench = carrying("px4")
    bench.run(1.0)
    assert bench.command(mavlink.MAV_CMD_DO_SET_SERVO, 9, 1100) == UNSUPPORTED
    assert bench.command(mavlink.MAV_CMD_DO_GRIPPER, 1, 0) == ACCEPTED
    assert bench.pilot.outputs.pulses[5] == 2000
    bench.take_off(1.0)
    assert bench.command(mavlink.MAV_CMD_DO_GRIPPER, 1, 0) == ACCEPTED
    bench.run(1.5)
    assert bench.pilot.outputs.pulses[5] == 1000
    assert bench.truth.payload[2] < 0.1


@pytest.mark.parametrize("text", ["blind@20", "battery=0.1", "refuse=no, never@3.5", "heal@1"])
def test_what_fails_can_be_written(text):
    what = read_break(text, AutopilotFailures)
    what.apply(AutopilotFailures())
    assert what.at == round(float(text.partition("@")[2] or 0.0) * 1e9)


@pytest.mark.parametrize(
    "text",
    [
        "nothing", "battery", "battery=full", "blind=1", "deaf@soon", "battery=nan@1", "deaf@nan",
        "battery=0_5", "drop=2", "battery=-0.1", "deaf@-1", "deaf@inf",
    ],
)  # fmt: skip
def test_what_can_t_fail_is_said(text):
    with pytest.raises(DriverError, match=r"can fail|value|is not|is from 0 to 1|before 0 s"):
        read_break(text, AutopilotFailures)


@BOTH
@pytest.mark.parametrize("kept_out", ["CONDITION_YAW", "DO_REPOSITION", "MISSION_START"])
def test_a_command_that_is_kept_out_is_refused_by_name(name, kept_out):
    bench = Bench(name)
    bench.run(1.0)
    assert bench.command(getattr(mavlink, f"MAV_CMD_{kept_out}")) == UNSUPPORTED
    assert f"not emulated: {kept_out}" in bench.texts()


@BOTH
def test_an_upload_of_a_mission_is_refused_by_name(name):
    bench = Bench(name)
    bench.run(1.0)
    bench.say(mavlink.MAVLink_mission_count_message(1, 1, 3))
    bench.run(0.1)
    assert bench.last("MISSION_ACK").type == mavlink.MAV_MISSION_UNSUPPORTED
    assert "not emulated: missions" in bench.texts()
