"""What an emulated autopilot refuses, with the acknowledgement and the words that firmware gave."""

from __future__ import annotations

import pytest

mavlink = pytest.importorskip("pymavlink.dialects.v20.all", reason="pymavlink is not installed")

from autopilot_bench import GUIDED, PX4_HOLD, PX4_LAND, PX4_OFFBOARD, STABILIZE, Bench  # noqa: E402
from framing import ACCEPTED, FAILED, REJECTED  # noqa: E402

from kybflow.drivers.mavlink.control.arming import FORCED  # noqa: E402
from kybflow.drivers.mavlink.telemetry.received_status import READY  # noqa: E402

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
        bench.say(mavlink.MAVLink_set_gps_global_origin_message(1, 473977420, 85455940, 488000, 0))
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
        (
            px4_in_offboard,
            REJECTED,
            {"refuse": "Preflight Fail: Accel 0 uncalibrated"},
            "Accel 0 uncalibrated",
        ),
        (ardupilot_in_guided, FAILED, {"tilt": 35.0}, "Arm: Leaning"),
        (ardupilot_in_guided, FAILED, {"battery": 0.05}, "PreArm: Battery 1 low voltage failsafe"),
        (
            ardupilot_in_guided,
            FAILED,
            {"refuse": "PreArm: Compass not calibrated"},
            "PreArm: Compass not calibrated",
        ),
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
    bench = Bench("ardupilot", outside=False, is_prepared=False)
    bench.run(3.0)
    ask = (mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    assert bench.mode(STABILIZE) == ACCEPTED
    assert bench.command(*ask) == ACCEPTED
    assert bench.last("SYS_STATUS").onboard_control_sensors_health & READY
    assert bench.mode(GUIDED) == ACCEPTED
    assert bench.arm() == FAILED
    assert "Need Position Estimate" in bench.texts()
    assert bench.command(*ask) == ACCEPTED
    assert not bench.last("SYS_STATUS").onboard_control_sensors_health & READY


def test_ardupilot_repeats_why_every_thirty_seconds():
    bench = Bench("ardupilot")
    bench.sees = False
    bench.run(61.0)
    assert bench.texts().count("PreArm: VisOdom: not healthy") == 2


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_a_plain_disarming_is_refused_in_the_air_and_a_forced_one_is_not(name):
    bench = Bench(name)
    bench.take_off(1.0)
    assert bench.disarm() == (REJECTED if bench.px4 else FAILED)
    assert bench.disarm(FORCED) == ACCEPTED
    bench.run(1.0)
    assert bench.height < 0.1


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_a_mode_that_it_has_not_is_refused(name):
    bench = Bench(name)
    assert bench.mode(NO_SUCH_MODE) not in (ACCEPTED, None)


@pytest.mark.parametrize("name", ["px4", "ardupilot"])
def test_a_mode_can_be_barred_with_given_words(name):
    bench = Bench(name)
    bench.pilot.failures.bar = "Mode change failed: because"
    assert bench.mode(PX4_LAND if bench.px4 else GUIDED) in (REJECTED, FAILED)
    assert "because" in bench.texts()
