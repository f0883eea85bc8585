"""Motions: a leg that ends on its goal, a coasting that begins as the vehicle moves."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from part_bench import DT, SITE, at_rest, entry, estimate

from kybflow.core.geometry import ZERO, Vec3, distance, norm, sub
from kybflow.flight.motion import Coast, Dwell, Motion, Straight
from kybflow.parts import AIR, Entry

numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers)


@given(vectors, vectors)
def test_a_leg_ends_exactly_on_its_goal(start: Vec3, goal: Vec3) -> None:
    leg = Straight(start, goal, 1.0, 0.7)
    assert leg.at(leg.duration) == Motion(goal)
    assert leg.at(0.0).position == pytest.approx(start)


@given(vectors, vectors, st.floats(0.2, 5.0), st.floats(0.0, 1.0))
def test_coasting_keeps_its_deceleration_and_never_speeds_up(
    origin: Vec3, velocity: Vec3, deceleration: float, fraction: float
) -> None:
    coast = Coast(origin, velocity, deceleration)
    motion = coast.at(fraction * coast.duration)
    assert norm(motion.acceleration) <= deceleration * (1 + 1e-9)
    assert norm(motion.velocity) <= norm(velocity) * (1 + 1e-9)
    assert coast.at(coast.duration) == Motion(coast.end)


def test_coasting_begins_with_the_velocity_of_the_last_setpoint_a_tick_later() -> None:
    coast = Coast.after(entry((1.0, 2.0, 1.0), (0.5, 0.0, 0.0)).motion)
    begin = coast.at(0.0)
    assert begin.position == pytest.approx((1.0 + 0.5 * DT, 2.0, 1.0))
    assert begin.velocity == (0.5, 0.0, 0.0)


def test_a_vehicle_far_from_its_setpoint_coasts_from_its_estimate() -> None:
    known = estimate((0.0, 0.0, 1.0), (0.0, 0.4, 0.0))
    lost = Entry(0, SITE, known, at_rest((1.0, 0.0, 1.0)), 2.3, AIR)
    assert lost.motion == Motion((0.0, 0.0, 1.0), (0.0, 0.4, 0.0))


def test_the_coasting_left_over_vanishes_at_its_end() -> None:
    coast = Coast(ZERO, (1.0, 0.0, 0.0), 1.5)
    assert coast.shift(coast.duration) == Motion(ZERO)
    assert norm(sub(coast.shift(0.0).position, sub(ZERO, coast.end))) == 0.0
    assert distance(coast.end, ZERO) == pytest.approx(0.5 * coast.duration)


def test_a_plan_leaves_a_share_of_the_speed_limit_to_tracking() -> None:
    assert entry(ZERO).cruise_speed(3.0) == pytest.approx(0.95)
    assert entry(ZERO).cruise_speed(0.4) == 0.4


def test_dwelling_begins_anew_after_a_break() -> None:
    dwell = Dwell()
    seen = [dwell.reached(holds, 0.2, 0.1) for holds in (True, True, False, True, True, True)]
    assert seen == [False, False, False, False, False, True]
