"""What an emulated autopilot does by itself and what it refuses, as it was seen on firmware."""

from __future__ import annotations

import struct

import pytest

mavlink = pytest.importorskip("pymavlink.dialects.v20.all", reason="pymavlink is not installed")

from autopilot_bench import (  # noqa: E402
    BRAKE,
    GUIDED,
    LAND,
    PX4_HOLD,
    PX4_LAND,
    PX4_OFFBOARD,
    PX4_POSITION,
    PX4_RETURN,
    STABILIZE,
    VELOCITY,
    Bench,
)
from framing import (  # noqa: E402
    ACCEPTED,
    FAILED,
    REJECTED,
)
from sim_worlds import FRAME  # noqa: E402

from kybflow.core.signals import NS  # noqa: E402
from kybflow.drivers.emulated_autopilot.state import PilotSticks  # noqa: E402
from kybflow.drivers.mavlink.control.arming import FORCE  # noqa: E402
from kybflow.drivers.mavlink.telemetry.received_status import READY  # noqa: E402


def after(bench, becomes, most=20.0):
    """Seconds until `becomes` is true."""
    start = bench.now
    assert bench.run(most, becomes)
    return (bench.now - start) / NS


def setting(bench, name, value):
    if bench.px4:
        value = struct.unpack("<f", struct.pack("<i", value))[0]
    kind = 6 if bench.px4 else 9
    bench.say(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind))
    bench.run(0.05)


@pytest.mark.parametrize(
    ("action", "mode"), [(0, PX4_RETURN), (4, PX4_LAND), (5, PX4_HOLD), (3, PX4_RETURN)]
)
def test_px4_leaves_offboard_half_a_second_after_the_last_set_point(action, mode):
    bench = Bench("px4").take_off(1.0)
    setting(bench, "COM_OBL_RC_ACT", action)
    bench.wanted = None
    assert 0.4 < after(bench, lambda: bench.pilot.state.mode != PX4_OFFBOARD) < 0.65
    assert bench.pilot.state.mode == mode
    assert "offboard signal lost" in bench.texts()


def test_px4_as_it_comes_climbs_to_return():
    bench = Bench("px4").take_off(1.0)
    setting(bench, "COM_OBL_RC_ACT", 0)
    bench.wanted = lambda: bench.go(3.5, 0.0, 2.0)
    bench.run(7.0)
    bench.wanted = None
    assert bench.run(8.0, lambda: bench.height > 6.0)


def test_px4_in_hold_goes_on_when_set_points_are_back():
    bench = Bench("px4").take_off(1.0)
    setting(bench, "COM_OBL_RC_ACT", 5)
    wanted, bench.wanted = bench.wanted, None
    bench.run(2.0)
    assert bench.pilot.state.mode == PX4_HOLD
    bench.wanted = wanted
    bench.run(1.0)
    assert bench.pilot.state.mode == PX4_OFFBOARD


def test_px4_lands_disarms_after_two_seconds_and_its_mode_is_the_last_that_was_asked_for():
    bench = Bench("px4").take_off(1.0)
    bench.wanted = None
    assert bench.run(10.0, lambda: bench.pilot.state.is_down)
    assert bench.pilot.state.armed
    assert 1.9 < after(bench, lambda: not bench.pilot.state.armed) < 2.1
    assert bench.pilot.state.mode == PX4_OFFBOARD


def test_ardupilot_holds_a_position_for_ever_and_stops_a_velocity():
    bench = Bench("ardupilot")
    setting(bench, "FS_GCS_ENABLE", 0.0)
    setting(bench, "GUID_TIMEOUT", 3.0)
    bench.take_off(1.0)
    bench.say(bench.go(1.0, 0.0, 1.0))
    bench.run(20.0)
    assert bench.truth.position == pytest.approx((1.0, 0.0, 1.0), abs=0.03)
    bench.say(bench.go(0.3, 0.0, 0.0, mask=VELOCITY))
    bench.run(2.8)
    assert bench.truth.velocity[0] == pytest.approx(0.3, abs=0.05)
    bench.run(2.0)
    assert abs(bench.truth.velocity[0]) < 0.08
    assert bench.pilot.state.mode == GUIDED


def test_ardupilot_drops_set_points_in_other_modes():
    bench = Bench("ardupilot").take_off(1.0)
    assert bench.mode(BRAKE) == ACCEPTED
    bench.run(1.0)
    bench.wanted = lambda: bench.go(1.0, 0.0, 1.0)
    bench.run(2.0)
    assert bench.truth.position == pytest.approx((0.0, 0.0, 1.0), abs=0.05)


@pytest.mark.parametrize(("is_prepared", "mode"), [(True, LAND), (False, GUIDED)])
def test_ardupilot_minds_the_heartbeat_of_its_station_only_where_it_is_told_to(is_prepared, mode):
    bench = Bench("ardupilot").take_off(1.0)
    if not is_prepared:
        setting(bench, "FS_GCS_ENABLE", 0.0)
    bench.wanted = lambda: bench.go(0.0, 0.0, 1.0)
    bench.beats = None
    bench.run(3.5)
    assert bench.pilot.state.mode == mode


@pytest.mark.parametrize(
    ("name", "forgets", "gives_up"),
    [("px4", 1.0, 5.0), pytest.param("ardupilot", 7.2, 7.9, marks=pytest.mark.thorough)],
)
def test_without_vision_it_lands_blindly_and_late(name, forgets, gives_up):
    bench = Bench(name).take_off(1.5)
    estimator, state = bench.pilot.state.estimator, bench.pilot.state
    bench.pilot.failures.blind = True
    lost = after(bench, lambda: not estimator.has_position(bench.now))
    assert lost == pytest.approx(forgets, abs=0.1)
    land = PX4_LAND if bench.px4 else LAND
    assert lost + after(bench, lambda: state.mode == land) == pytest.approx(gives_up, abs=0.1)
    assert bench.run(15.0, lambda: not state.armed)
    assert bench.height < 0.01


def test_px4_follows_attitudes_without_a_position():
    """As in PX4, `OffboardChecks`: only a position or velocity setpoint needs an estimate of it."""
    bench = Bench("px4").take_off(1.0)
    bench.sees = False
    bench.wanted = lambda: mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, 7, [1.0, 0.0, 0.0, 0.0], 0, 0, 0, 1.02 * FRAME.hover_thrust / FRAME.max_thrust
    )
    bench.run(bench.firmware.gives_up + 2.0)
    assert bench.pilot.state.mode == PX4_OFFBOARD
    bench.wanted = lambda: bench.go(0.0, 0.0, 1.0)
    bench.run(0.1)
    assert bench.pilot.state.mode == PX4_LAND


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_it_reports_how_far_poses_are_from_what_its_filter_expects(name):
    kind = "ESTIMATOR_STATUS" if name == "px4" else "EKF_STATUS_REPORT"
    bench = Bench(name).take_off(1.0)

    def found():
        m = bench.request(kind)
        horizontal, vertical = ("pos_horiz_ratio", "pos_vert_ratio")
        if name == "ardupilot":
            horizontal, vertical = ("pos_horiz_variance", "pos_vert_variance")
        return getattr(m, horizontal), getattr(m, vertical)

    assert max(found()) < 0.2
    bench.shift = (0.0, 0.9, 0.0)
    bench.run(0.5)
    assert found()[0] > 1.0
    assert found()[1] < 0.2
    bench.resets = 1
    bench.run(3.0)
    assert max(found()) < 0.2, "the jump was told"
    bench.shift = (0.0, 0.9, 0.45)
    bench.run(0.1)
    assert found()[0] < 0.1 < found()[1] < 1.0


def test_a_jump_of_vision_is_not_believed_at_once_unless_it_is_told():
    bench = Bench("px4").take_off(1.0)
    bench.shift = (1.0, 0.0, 0.0)
    bench.run(0.5)
    assert bench.pilot.state.estimator.position[0] == pytest.approx(0.0, abs=0.1)
    bench.resets = 1
    bench.run(0.1)
    assert bench.pilot.state.estimator.position[0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("name", "seconds"),
    [pytest.param("px4", 10.0, marks=pytest.mark.thorough), ("ardupilot", 10.0)],
)
def test_armed_and_left_alone_on_the_ground_it_disarms(name, seconds):
    bench = Bench(name, outside=False)
    bench.run(12.0)
    if not bench.px4:
        assert bench.mode(GUIDED) == ACCEPTED
    assert bench.arm() == ACCEPTED, bench.texts()
    assert after(bench, lambda: not bench.pilot.state.armed) == pytest.approx(seconds, abs=0.2)


@pytest.mark.parametrize(
    ("name", "parameter", "value", "mode"),
    [("px4", "COM_LOW_BAT_ACT", 2, PX4_LAND), ("ardupilot", "BATT_FS_LOW_ACT", 1.0, LAND)],
)
def test_a_low_battery_lands_where_the_parameters_say_so(name, parameter, value, mode):
    bench = Bench(name).take_off(1.0)
    setting(bench, parameter, value)
    bench.pilot.failures.battery = 0.06
    bench.run(0.1)
    assert bench.pilot.state.mode == mode


def test_a_pilot_takes_over():
    bench = Bench("ardupilot").take_off(1.0)
    bench.pilot.give_to_pilot("loiter")
    bench.wanted = lambda: bench.go(1.0, 0.0, 1.0)
    bench.run(3.0)
    assert bench.truth.position == pytest.approx((0.0, 0.0, 1.0), abs=0.05)
    assert bench.last("HEARTBEAT").custom_mode == 5


def test_silent_and_deaf_are_one_way_each():
    bench = Bench("px4")
    bench.run(1.0)
    bench.pilot.failures.silent = True
    heard = len(bench.heard)
    bench.run(2.0)
    assert len(bench.heard) == heard
    bench.pilot.failures.silent, bench.pilot.failures.deaf = False, True
    bench.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 0.0, tick=False)
    bench.run(0.5)
    assert len(bench.heard) > heard
    assert bench.last("COMMAND_ACK") is None


NO_SUCH_MODE = 42


def px4_in_offboard():
    bench = Bench("px4")
    bench.wanted = lambda: bench.go(0.0, 0.0, 1.0)
    bench.run(2.0)
    assert bench.mode(PX4_OFFBOARD) == ACCEPTED
    return bench


def ardupilot_in_guided(has_origin=True):
    bench = Bench("ardupilot")
    if has_origin:
        bench.set_origin()
    bench.run(2.0)
    assert bench.mode(GUIDED) == ACCEPTED
    return bench


def test_px4_takes_offboard_without_set_points_but_is_not_armed_then():
    bench = Bench("px4")
    bench.run(2.0)
    assert bench.mode(PX4_OFFBOARD) == ACCEPTED
    assert bench.last("HEARTBEAT").custom_mode == PX4_OFFBOARD
    assert bench.arm() == REJECTED
    assert "No offboard signal" in bench.texts()


def test_px4_without_a_position_is_not_armed():
    bench = px4_in_offboard()
    bench.sees = False
    bench.run(1.5)
    assert bench.arm() == REJECTED
    assert "No valid local position estimate" in bench.texts()
    bench.run(1.0)
    assert bench.last("HEARTBEAT").system_status == 0


def test_px4_in_hold_wants_a_global_position():
    bench = Bench("px4")
    bench.run(2.0)
    assert bench.pilot.state.mode == PX4_HOLD
    assert bench.arm() == REJECTED
    assert "No valid global position estimate" in bench.texts()


def test_px4_is_not_armed_in_the_mode_that_lands():
    bench = px4_in_offboard()
    assert bench.mode(PX4_LAND) == ACCEPTED
    assert bench.arm() == REJECTED


@pytest.mark.parametrize(
    ("ready", "result", "broken", "words"),
    [
        (px4_in_offboard, REJECTED, {"tilt": 35.0}, "Attitude failure"),
        (px4_in_offboard, REJECTED, {"battery": 0.05}, "low battery"),
        (px4_in_offboard, REJECTED, {"refuse": "Preflight Fail: Accel"}, "Preflight Fail: Accel"),
        (ardupilot_in_guided, FAILED, {"tilt": 35.0}, "Arm: Leaning"),
        (ardupilot_in_guided, FAILED, {"battery": 0.05}, "PreArm: Battery 1 low voltage failsafe"),
        (ardupilot_in_guided, FAILED, {"refuse": "PreArm: Compass"}, "PreArm: Compass"),
    ],
)
def test_it_says_what_is_wrong(ready, result, broken, words):
    bench = ready()
    for name, value in broken.items():
        setattr(bench.pilot.failures, name, value)
    assert bench.arm() == result
    assert words in bench.texts()


def test_ardupilot_wants_vision_and_then_an_origin():
    bench = ardupilot_in_guided(has_origin=False)
    assert bench.last("EKF_STATUS_REPORT") is None, "it streams nothing unasked"
    assert bench.arm() == FAILED
    assert "AHRS: waiting for home" in bench.texts()
    bench.sees = False
    bench.run(1.0)
    assert bench.arm() == FAILED
    assert "VisOdom: not healthy" in bench.texts()


def test_ardupilots_health_depends_on_its_mode():
    bench = Bench("ardupilot", outside=False)
    bench.run(3.0)
    assert bench.mode(STABILIZE) == ACCEPTED
    assert bench.request("SYS_STATUS").onboard_control_sensors_health & READY
    assert bench.mode(GUIDED) == ACCEPTED
    assert bench.arm() == FAILED
    assert "Need Position Estimate" in bench.texts()
    assert not bench.request("SYS_STATUS").onboard_control_sensors_health & READY


def test_ardupilot_repeats_why_every_thirty_seconds():
    bench = Bench("ardupilot")
    bench.sees = False
    bench.run(61.0)
    assert bench.texts().count("PreArm: VisOdom: not healthy") == 2


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_a_plain_disarming_is_refused_in_the_air_and_a_forced_one_is_not(name):
    bench = Bench(name).take_off(1.0)
    assert bench.disarm() == (REJECTED if bench.px4 else FAILED)
    assert bench.disarm(FORCE) == ACCEPTED
    bench.run(1.0)
    assert bench.height < 0.1


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_a_mode_that_it_has_not_is_refused_and_any_can_be_barred_with_given_words(name):
    bench = Bench(name)
    assert bench.mode(NO_SUCH_MODE) not in (ACCEPTED, None)
    bench.pilot.failures.bar = "Mode change failed: because"
    assert bench.mode(PX4_LAND if bench.px4 else GUIDED) in (REJECTED, FAILED)
    assert "because" in bench.texts()


def test_px4_holds_for_five_seconds_when_its_transmitter_is_lost_and_then_lands():
    bench = Bench("px4").take_off(1.0)
    bench.pilot.state.sticks = PilotSticks(bench.now, 0.0, 0.0, 0.0, 0.5)
    assert bench.mode(PX4_POSITION) == ACCEPTED
    assert bench.run(3.0, lambda: bench.pilot.state.mode == PX4_HOLD)
    assert "entering Hold for 5 seconds" in bench.texts()
    assert bench.height > 0.8
    assert after(bench, lambda: bench.pilot.state.mode == PX4_LAND) == pytest.approx(5.0, abs=0.1)


def test_an_ardupilot_as_it_comes_waits_for_a_transmitter():
    bench = Bench("ardupilot", outside=False, is_prepared=False)
    bench.run(12.0)
    assert bench.mode(GUIDED) == ACCEPTED
    assert bench.arm() == FAILED
    assert "PreArm: RC not found" in bench.texts()
    bench.pilot.state.sticks = PilotSticks(bench.now, 0.0, 0.0, 0.0, 0.5)
    assert bench.arm() == ACCEPTED
