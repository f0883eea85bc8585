"""An emulated autopilot arms, climbs, follows setpoints and lands, over a raw wire."""

from __future__ import annotations

import pytest

mavlink = pytest.importorskip("pymavlink.dialects.v20.all", reason="pymavlink is not installed")

from dataclasses import replace  # noqa: E402
from math import pi  # noqa: E402

from autopilot_bench import (  # noqa: E402
    BRAKE,
    GUIDED,
    LAND,
    LOITER,
    PLAIN,
    POSITION,
    PX4_HOLD,
    PX4_LAND,
    PX4_TAKE_OFF,
    VELOCITY,
    Bench,
)
from framing import ACCEPTED, FAILED  # noqa: E402
from sim_worlds import FRAME  # noqa: E402

from kybflow.core.geometry import from_euler, heading_of, norm, tilt_of  # noqa: E402
from kybflow.drivers.emulated_autopilot.state import PilotSticks  # noqa: E402
from kybflow.drivers.mavlink.protocol.frames import attitude_to_ned  # noqa: E402
from kybflow.drivers.sim import SimParams  # noqa: E402

thorough = pytest.mark.thorough
BOTH = pytest.mark.parametrize("name", ["px4", "ardupilot"])
PX4_QUICKLY = pytest.mark.parametrize("name", ["px4", pytest.param("ardupilot", marks=thorough)])
ARDUPILOT_QUICKLY = pytest.mark.parametrize(
    "name", [pytest.param("px4", marks=thorough), "ardupilot"]
)


def landing(bench):
    """Ask for the mode that lands, and wait until it is disarmed."""
    bench.wanted = None
    assert bench.mode(PX4_LAND if bench.px4 else LAND) == ACCEPTED
    return bench.run(20.0, lambda: not bench.pilot.state.armed)


@pytest.mark.thorough
@BOTH
def test_it_arms_climbs_follows_positions_and_velocities_and_lands(name):
    bench = Bench(name).take_off(1.0)
    bench.wanted = lambda: bench.go(1.0, 0.5, 1.5)
    bench.run(6.0)
    assert bench.truth.position == pytest.approx((1.0, 0.5, 1.5), abs=0.05)
    bench.wanted = lambda: bench.go(-0.5, 0.3, 0.1, mask=VELOCITY)
    bench.run(3.0)
    assert bench.truth.velocity == pytest.approx((-0.5, 0.3, 0.1), abs=0.05)
    assert landing(bench)
    assert bench.height == pytest.approx(0.0, abs=0.01)
    assert bench.last("EXTENDED_SYS_STATE" if bench.px4 else "HEARTBEAT") is not None


@ARDUPILOT_QUICKLY
def test_the_same_seed_gives_the_same_flight(name):
    flights = []
    for _ in range(2):
        bench = Bench(name, params=SimParams(), seed=3).take_off(1.0)
        flights.append(bench.truth)
    assert flights[0] == flights[1]


@PX4_QUICKLY
def test_it_flies_with_an_imu_that_is_noisy_and_biased_on_a_model_that_is_wrong(name):
    bench = Bench(name, params=SimParams(gust=0.3), seed=5).take_off(1.0)
    bench.wanted = lambda: bench.go(1.0, 1.0, 1.0)
    bench.run(6.0)
    assert bench.truth.position == pytest.approx((1.0, 1.0, 1.0), abs=0.15)


@ARDUPILOT_QUICKLY
def test_heading_goes_by_neds_yaw(name):
    bench = Bench(name).take_off(1.0)
    bench.wanted = lambda: bench.go(0.0, 0.0, 1.0, yaw=0.0)
    bench.run(8.0)
    assert heading_of(bench.truth.attitude) == pytest.approx(pi / 2, abs=0.05)


@PX4_QUICKLY
def test_an_attitude_and_a_thrust_are_followed(name):
    bench = Bench(name).take_off(2.0)
    turn = attitude_to_ned(from_euler(0.1, 0.0, 0.0))
    hover = FRAME.hover_thrust / FRAME.max_thrust
    bench.wanted = lambda: mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, 7, turn, 0, 0, 0, hover
    )
    bench.run(0.8)
    assert tilt_of(bench.truth.attitude) == pytest.approx(0.1, abs=0.03)
    assert bench.truth.velocity[1] < -0.2
    assert abs(bench.truth.velocity[2]) < 0.4


def test_an_attitude_ends_ardupilots_take_off_even_on_the_ground():
    """As in ArduCopter, `ModeGuided::set_angle` and `angle_control_run`."""
    bench = Bench("ardupilot").take_off(1.0)
    assert bench.mode(LAND) == ACCEPTED
    assert bench.run(20.0, lambda: not bench.pilot.state.armed)
    assert bench.mode(GUIDED) == ACCEPTED
    assert bench.arm() == ACCEPTED
    assert bench.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 2.0) == ACCEPTED
    level = attitude_to_ned(from_euler(0.0, 0.0, 0.0))
    thrust = 1.2 * FRAME.hover_thrust / FRAME.max_thrust
    bench.wanted = lambda: mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, 7, level, 0, 0, 0, thrust
    )
    bench.run(2.0)
    assert bench.pilot.state.climb_to is None
    assert bench.truth.velocity[2] > 1.0


def test_body_rates_turn_it():
    bench = Bench("px4").take_off(2.0)
    hover = FRAME.hover_thrust / FRAME.max_thrust
    bench.wanted = lambda: mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, 128, [1, 0, 0, 0], 0, 0, -0.5, hover
    )
    before = heading_of(bench.truth.attitude)
    bench.run(1.0)
    assert heading_of(bench.truth.attitude) - before == pytest.approx(0.5, abs=0.15)


def test_ardupilot_takes_thrust_for_a_climb_rate_unless_it_is_told_otherwise():
    bench = Bench("ardupilot").take_off(1.0)
    bench.say(mavlink.MAVLink_param_set_message(1, 1, b"GUID_OPTIONS", 0.0, 9))
    level = attitude_to_ned(from_euler(0.0, 0.0, 0.0))
    bench.wanted = lambda: mavlink.MAVLink_set_attitude_target_message(
        0, 1, 1, 7, level, 0, 0, 0, 0.6
    )
    bench.run(2.0)
    assert bench.truth.velocity[2] == pytest.approx(0.5, abs=0.1)


@ARDUPILOT_QUICKLY
def test_it_flies_on_its_own_gps(name):
    bench = Bench(name, outside=False, is_prepared=False, params=SimParams(), seed=2)
    bench.run(12.0)
    if bench.px4:
        assert bench.arm() == ACCEPTED
        takes = mavlink.MAV_CMD_NAV_TAKEOFF
        assert bench.command(takes, 0, 0, 0, 0, 0, 0, float("nan")) == ACCEPTED
        assert bench.run(15.0, lambda: bench.height > 2.2)
        assert bench.run(5.0, lambda: bench.pilot.state.mode == PX4_HOLD)
    else:
        bench.say(mavlink.MAVLink_param_set_message(1, 1, b"FS_THR_ENABLE", 0.0, 9))
        assert bench.mode(GUIDED) == ACCEPTED
        assert bench.arm() == ACCEPTED, bench.texts()
        assert bench.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 2.0) == ACCEPTED
        assert bench.run(15.0, lambda: bench.height > 1.8)
    bench.run(5.0)
    x, y, _ = bench.truth.position
    assert norm((x, y, 0.0)) < 1.5
    assert landing(bench)


def test_ardupilot_leaves_the_ground_by_its_take_off_alone():
    bench = Bench("ardupilot")
    bench.set_origin()
    bench.run(1.5)
    assert bench.mode(GUIDED) == ACCEPTED
    takes_off = (mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 1.0)
    assert bench.command(*takes_off) == FAILED, "not armed"
    assert bench.arm() == ACCEPTED
    bench.wanted = lambda: bench.go(0.0, 0.0, 1.0)
    bench.run(3.0)
    assert bench.height < 0.01
    assert bench.command(*takes_off) == ACCEPTED
    bench.run(5.0)
    assert bench.command(*takes_off) == FAILED, "it flies"


@pytest.mark.parametrize("first", ["arm", pytest.param("mode", marks=thorough)])
def test_px4_takes_off_by_its_mode_armed_before_or_after(first):
    bench = Bench("px4", outside=False, is_prepared=False, params=SimParams(), seed=2)
    bench.run(12.0)
    asked = [bench.arm, lambda: bench.mode(PX4_TAKE_OFF)]
    for ask in asked if first == "arm" else reversed(asked):
        assert ask() == ACCEPTED
    assert bench.run(15.0, lambda: bench.height > 2.2)
    assert bench.run(5.0, lambda: bench.pilot.state.mode == PX4_HOLD)


@ARDUPILOT_QUICKLY
def test_it_holds_where_it_is_in_its_holding_mode(name):
    bench = Bench(name).take_off(1.0)
    bench.wanted = lambda: bench.go(0.5, 0.0, 0.0, mask=VELOCITY)
    bench.run(2.0)
    assert bench.mode(PX4_HOLD if bench.px4 else BRAKE) == ACCEPTED
    bench.run(3.0)
    before = bench.truth.position
    bench.run(3.0)
    assert bench.truth.position == pytest.approx(before, abs=0.03)


@ARDUPILOT_QUICKLY
def test_on_the_floor_a_landing_follows_no_position_any_more(name):
    """After one that drifts it would slide over the floor for seconds, and tip over."""
    bench = Bench(name).take_off(1.0)

    def is_down():
        if bench.height < 0.3:
            bench.shift = (bench.shift[0] - 0.0032, 0.0, 0.0)
        return not bench.pilot.state.armed

    bench.wanted = None
    assert bench.mode(PX4_LAND if bench.px4 else LAND) == ACCEPTED
    assert bench.run(20.0, is_down)
    assert abs(bench.truth.position[0]) < 0.35


@BOTH
def test_a_landing_that_begins_in_a_climb_holds_its_place_on_the_way_down(name):
    """What only stops climbing has touched nothing; level, it would go with the wind."""
    bench = Bench(name, params=replace(PLAIN, wind=(2.0, 0.0, 0.0))).take_off(1.0)
    bench.wanted = lambda: bench.go(0.0, 0.0, 2.0, mask=VELOCITY)
    bench.run(1.5)
    x, _, _ = bench.truth.position
    assert landing(bench)
    assert abs(bench.truth.position[0] - x) < 0.3


def test_loiter_sinks_without_its_pilot_but_holds_if_it_never_had_one():
    bench = Bench("ardupilot").take_off(2.5)
    assert bench.mode(LOITER) == ACCEPTED
    bench.run(2.0)
    assert bench.truth.position == pytest.approx((0.0, 0.0, 2.5), abs=0.1)
    bench.pilot.state.sticks = PilotSticks(bench.now, 0.0, 0.0, 0.0, 0.5)
    bench.run(2.2)
    assert bench.truth.velocity[2] < -1.0


@PX4_QUICKLY
def test_a_position_without_yaw_is_followed_too(name):
    bench = Bench(name).take_off(1.0)
    bench.wanted = lambda: bench.go(0.5, 0.0, 1.0, mask=POSITION)
    bench.run(4.0)
    assert bench.truth.position == pytest.approx((0.5, 0.0, 1.0), abs=0.05)
