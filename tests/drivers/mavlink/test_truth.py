"""The truth of a firmware's own simulator, where the mission says, and a parcel that falls."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, sin, sqrt
from types import MappingProxyType

import pytest

pytest.importorskip("pymavlink")

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink
from sim_worlds import FRAME

from kybflow.core import geometry as g
from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS
from kybflow.drivers.mavlink.protocol.frames import Tangent, attitude_to_ned, to_frd, to_ned
from kybflow.drivers.mavlink.telemetry.truth import MAX_EXTRAPOLATION_S, POSITION_STEP, GroundTruth
from kybflow.world.vehicle_context import LEGS, Parcel, VehicleContext

RADIUS = 6_378_100.0
EARTH = Tangent.on_sphere(-35.3632621, 149.1652374, 584.0, RADIUS)
PARCEL = Parcel(mass=0.2, size=0.06)


def context(start=ZERO, heading=0.0, payload=None):
    return VehicleContext("a", FRAME, start, heading, None, 0.004, None, MappingProxyType({}),
                payload=payload)  # fmt: skip


def sim_state(place=ZERO, heading=0.0, velocity=ZERO, rates=ZERO, earth=EARTH):
    """What ArduPilot's simulator says, of a state in ENU and FLU."""
    latitude, longitude, height = earth.place(place)
    q = attitude_to_ned(g.from_heading(heading))
    return mavlink.MAVLink_sim_state_message(
        *q, 0, 0, 0, 0, 0, 0, *to_frd(rates), latitude, longitude, height, 0, 0, *to_ned(velocity),
        round(latitude * 1e7), round(longitude * 1e7),
    )  # fmt: skip


def hil_state(place=ZERO, heading=0.0, velocity=ZERO, earth=EARTH):
    """What PX4's says."""
    latitude, longitude, height = earth.place(place)
    q = attitude_to_ned(g.from_heading(heading))
    speed = [round(100 * v) for v in to_ned(velocity)]
    return mavlink.MAVLink_hil_state_quaternion_message(
        0, q, 0.1, -0.2, -0.3, round(latitude * 1e7), round(longitude * 1e7),
        round(height * 1e3), *speed, 0, 0, 0, 0, 0,
    )  # fmt: skip


def standing(where, sphere=RADIUS, **facts):
    truth = GroundTruth(where, sphere)
    truth.handle(sim_state(**facts), 0, on_ground=True)
    return truth


def test_it_begins_where_the_mission_says():
    truth = standing(context((1.0, 2.0, 0.0), 0.5), heading=-1.0)
    known = truth.truth(0)
    assert pytest.approx((1.0, 2.0, 0.0), abs=1e-9) == known.position
    assert pytest.approx(g.from_heading(0.5)) == known.attitude
    assert known.payload is None


def test_from_then_on_its_world_is_the_missions_moved_and_turned():
    truth = standing(context((1.0, 2.0, 0.0), pi / 2))
    there = sim_state((3.0, 1.0, 2.0), 0.2, velocity=(0.5, 0.0, -0.1), rates=(0.1, 0.2, 0.3))
    truth.handle(there, NS, on_ground=False)
    known = truth.truth(NS)
    assert pytest.approx((0.0, 5.0, 2.0), abs=0.012) == known.position
    assert pytest.approx((0.0, 0.5, -0.1)) == known.velocity
    assert pytest.approx(pi / 2 + 0.2) == g.heading_of(known.attitude)
    assert pytest.approx((0.1, 0.2, 0.3)) == known.angular_velocity


def test_that_of_px4_is_in_whole_centimetres_and_on_the_ellipsoid():
    earth = Tangent.on_ellipsoid(47.3977419, 8.5455939, 488.0)
    truth = GroundTruth(context(), None)
    truth.handle(hil_state(earth=earth), 0, on_ground=True)
    moving = hil_state((2.0, -3.0, 1.5), velocity=(0.5, 0, 0), earth=earth)
    truth.handle(moving, NS, on_ground=False)
    known = truth.truth(NS)
    assert pytest.approx((2.0, -3.0, 1.5), abs=0.012) == known.position
    assert pytest.approx((0.5, 0.0, 0.0)) == known.velocity
    assert pytest.approx((0.1, 0.2, 0.3)) == known.angular_velocity


swings = st.tuples(st.floats(-1.0, 1.0), st.floats(0.3, 3.0))
"""How far each axis swings, metres, and how fast, rad/s."""


def swinging(axes, time):
    """Place and velocity."""
    place = tuple(size * (1.0 - cos(rate * time)) for size, rate in axes)
    return place, tuple(size * rate * sin(rate * time) for size, rate in axes)


@given(st.tuples(swings, swings, swings), st.sampled_from((20, 50, 100)))
def test_a_place_in_steps_of_a_centimetre_is_followed_within_seven_millimetres(axes, rate):
    truth = standing(context())
    for number in range(1, 3 * rate):
        place, velocity = swinging(axes, number / rate)
        now = number * NS // rate
        truth.handle(sim_state(place, velocity=velocity), now, on_ground=False)
        assert truth.truth(now).position == pytest.approx(place, abs=0.007)


def test_what_is_followed_moves_as_smoothly_as_the_vehicle():
    truth, places = standing(context()), []
    for number in range(1, 500):
        now = number * NS // 50
        moved = sim_state((0.1 * now / NS, 0.0, 0.0), velocity=(0.1, 0.0, 0.0))
        truth.handle(moved, now, on_ground=False)
        places.append(truth.truth(now).position[0])
    steps = [50 * (after - before) for before, after in pairwise(places)]
    assert steps == pytest.approx([0.1] * len(steps), abs=0.025)


def test_a_jump_is_followed_at_once():
    truth = standing(context())
    for number in range(1, 20):
        place = ZERO if number < 10 else (1.0, -1.0, 1.0)
        now = number * NS // 50
        truth.handle(sim_state(place), now, on_ground=False)
        assert truth.truth(now).position == pytest.approx(place, abs=POSITION_STEP + 0.006)


def test_after_silence_it_is_where_it_says():
    truth = standing(context())
    now = round((MAX_EXTRAPOLATION_S + 0.1) * NS)
    truth.handle(sim_state((0.02, 0.0, 0.0)), now, on_ground=False)
    assert truth.truth(now).position == pytest.approx((0.02, 0.0, 0.0), abs=0.006)


def test_there_is_no_truth_before_it_was_seen_on_the_ground():
    truth = GroundTruth(context(), RADIUS)
    truth.handle(mavlink.MAVLink_system_time_message(0, 0), 0, on_ground=True)
    truth.handle(sim_state(), 0, on_ground=False)
    assert truth.truth(0) is None
    truth.release(0)
    truth.load()
    assert truth.truth(0) is None


def test_between_messages_it_goes_on_as_it_moved_and_after_them_there_is_none():
    truth = standing(context())
    truth.handle(sim_state(velocity=(1.0, 0.0, 0.0), rates=(0.0, 0.0, 1.0)), NS, on_ground=False)
    known = truth.truth(NS + NS // 20)
    assert pytest.approx((0.05, 0.0, 0.0)) == known.position
    assert pytest.approx(0.05, abs=1e-4) == g.heading_of(known.attitude)
    assert pytest.approx((0.2, 0.0, 0.0)) == truth.truth(NS + NS // 5).position
    assert truth.truth(NS + NS // 5 + 1) is None
    truth.handle(sim_state((3.0, 0.0, 0.0)), 9 * NS, on_ground=False)
    assert pytest.approx((3.0, 0.0, 0.0), abs=0.012) == truth.truth(9 * NS).position


def test_on_board_the_parcel_hangs_level_with_the_legs():
    truth = standing(context((1.0, 0.0, 0.0), payload=PARCEL))
    assert pytest.approx((1.0, 0.0, -0.02)) == truth.truth(0).payload
    assert pytest.approx(0.5 * PARCEL.size - LEGS) == truth.truth(0).payload[2]


def test_released_it_falls_with_the_velocity_it_had_and_rests_on_the_floor():
    truth = standing(context(payload=PARCEL))
    truth.handle(sim_state((0.0, 0.0, 2.0), velocity=(0.5, 0.0, 0.1)), NS, on_ground=False)
    truth.release(NS)
    x, y, z = truth.truth(NS + NS // 5).payload
    height = EARTH.local(*EARTH.place((0.0, 0.0, 2.0)))[2]
    assert pytest.approx((0.1, 0.0), abs=0.012) == (x, y)
    assert pytest.approx(height - 0.02 + 0.1 * 0.2 - 0.5 * 9.81 * 0.2**2, abs=1e-6) == z
    truth.handle(sim_state((0.0, 0.0, 2.0)), 9 * NS, on_ground=False)
    falls = (0.1 + sqrt(0.01 + 2 * 9.81 * height)) / 9.81
    assert pytest.approx((0.5 * falls, 0.0, -0.02), abs=0.012) == truth.truth(9 * NS).payload
    rests = truth.truth(9 * NS).payload
    truth.handle(sim_state((1.0, 0.0, 2.0)), 11 * NS, on_ground=False)
    assert truth.truth(11 * NS).payload == rests


def test_a_turning_vehicle_lends_its_parcel_the_speed_of_its_place():
    truth = standing(context(payload=PARCEL))
    truth.handle(sim_state((0, 0, 2.0), rates=(0.0, 2.0, 0.0)), NS, on_ground=False)
    truth.release(NS)
    truth.handle(sim_state((0, 0, 2.0)), NS + NS // 2, on_ground=False)
    assert pytest.approx(-0.02 * 2.0 * 0.5, abs=0.012) == truth.truth(NS + NS // 2).payload[0]


def test_it_is_let_go_once_and_may_be_put_on_board_again():
    truth = standing(context(payload=PARCEL))
    truth.handle(sim_state((0, 0, 2.0)), NS, on_ground=False)
    truth.release(NS)
    truth.release(2 * NS)
    truth.handle(sim_state((0, 0, 2.0)), 2 * NS, on_ground=False)
    assert pytest.approx(-0.02) == truth.truth(2 * NS).payload[2]
    truth.load()
    assert pytest.approx(1.98, abs=1e-3) == truth.truth(2 * NS).payload[2]


def test_a_parcel_that_was_never_on_board_lies_where_the_vehicle_stood():
    left = Parcel(mass=0.2, size=0.06, aboard=False)
    truth = standing(context(payload=left))
    assert pytest.approx((0.0, 0.0, -0.02)) == truth.truth(0).payload
    truth.handle(sim_state((3.0, 0, 2.0)), NS, on_ground=False)
    truth.release(NS)
    assert pytest.approx((0.0, 0.0, -0.02)) == truth.truth(NS).payload
