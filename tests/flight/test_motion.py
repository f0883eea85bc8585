"""Motions: a leg that ends on its goal, a coasting that begins as the vehicle moves."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from part_bench import DT, SITE, at_rest, entry, estimate

from kybflow.core.geometry import ZERO, Vec3, distance, norm, sub
from kybflow.flight.motion import (
    MAX_SLOPE,
    Coast,
    Dwell,
    Motion,
    Pace,
    Profile,
    Straight,
    smoothstep,
)
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


def test_what_nobody_watched_is_not_dwelt() -> None:
    """The process hung for two seconds: it sees the condition hold for the first time."""
    dwell = Dwell()
    assert [dwell.reached(True, 0.3, dt) for dt in (2.0, 0.1, 0.1, 0.1)] == [False] * 3 + [True]


distances = st.floats(0.0, 100.0)
speeds = st.floats(0.01, 10.0)
accelerations = st.floats(0.05, 20.0)
fractions = st.floats(0.0, 1.0)


@given(distances, speeds, accelerations)
def test_starts_and_stops_exactly(distance: float, speed: float, acceleration: float) -> None:
    profile = Profile.within(distance, speed, acceleration)
    assert profile.at(profile.duration) == (distance, 0.0, 0.0, 0.0)
    assert profile.at(0.0)[1:] == (0.0, 0.0, 0.0)
    assert math.isfinite(profile.duration)


@given(distances, speeds, accelerations, fractions)
def test_keeps_its_limits(
    distance: float, speed: float, acceleration: float, fraction: float
) -> None:
    profile = Profile.within(distance, speed, acceleration)
    gone, v, a, _ = profile.at(fraction * profile.duration)
    assert -1e-9 <= gone <= distance + 1e-9
    assert -1e-12 <= v <= speed * (1 + 1e-9)
    assert abs(a) <= acceleration * (1 + 1e-9)


@given(distances, speeds, accelerations, fractions, fractions)
def test_never_turns_back(
    distance: float, speed: float, acceleration: float, one: float, other: float
) -> None:
    profile = Profile.within(distance, speed, acceleration)
    early, late = sorted((one, other))
    before = profile.at(early * profile.duration)[0]
    assert before <= profile.at(late * profile.duration)[0] + 1e-9 * (1.0 + distance)


@given(st.floats(0.01, 50.0), speeds, accelerations, st.floats(0.01, 0.99))
def test_each_value_is_the_derivative_of_the_one_before(
    distance: float, speed: float, acceleration: float, fraction: float
) -> None:
    profile = Profile.within(distance, speed, acceleration)
    step = 1e-4 * profile.ramp
    time = fraction * profile.duration
    before, here, after = (profile.at(time + k * step) for k in (-1, 0, 1))
    jerk = acceleration / profile.ramp
    for i, scale in ((0, profile.speed), (1, acceleration), (2, jerk)):
        slope = (after[i] - before[i]) / (2.0 * step)
        assert slope == pytest.approx(here[i + 1], abs=2e-2 * scale + 1e-6)


def test_a_short_way_has_a_lower_peak_and_no_cruise() -> None:
    profile = Profile.within(0.1, 1.0, 0.7)
    assert profile.speed == pytest.approx(math.sqrt(0.1 * 0.7 / 1.875))
    assert profile.duration == pytest.approx(2.0 * profile.ramp)


def test_a_long_way_cruises_at_the_speed_asked_for() -> None:
    profile = Profile.within(10.0, 1.0, 0.7)
    assert profile.at(0.5 * profile.duration) == pytest.approx((5.0, 1.0, 0.0, 0.0))


def test_no_way_takes_no_time() -> None:
    assert Profile.within(0.0, 1.0, 0.7).duration == 0.0


def test_an_endless_way_never_ends() -> None:
    profile = Profile.within(math.inf, 0.5, 0.7)
    assert profile.duration == math.inf
    assert profile.at(1000.0)[1:] == (0.5, 0.0, 0.0)


def test_a_ramp_longer_than_the_way_is_shortened() -> None:
    profile = Profile(2.0, 1.0, 5.0)
    assert (profile.ramp, profile.duration) == (2.0, 4.0)


def test_the_smoothstep_is_still_at_both_ends_and_covers_a_half() -> None:
    assert smoothstep(0.0) == (0.0, 0.0, 0.0, 0.0)
    assert smoothstep(1.0) == (0.5, 1.0, 0.0, 0.0)


@pytest.mark.parametrize("distance", [1e-6, 1e-3, 0.05])
def test_a_little_way_takes_a_second_and_no_jerk_to_speak_of(distance: float) -> None:
    profile = Profile.within(distance, speed=1.0, acceleration=0.7)
    assert profile.duration == pytest.approx(1.0)
    jerks = [abs(profile.at(0.001 * i)[3]) for i in range(1000)]
    assert max(jerks) <= 48.0 * distance
    assert profile.at(1.0)[0] == distance


ways = st.lists(
    st.tuples(st.floats(0.01, 10.0), st.floats(0.05, 3.0), st.floats(0.1, 3.0)), min_size=1
)


@given(ways, st.floats(0.0, 1.0))
def test_at_the_pace_of_the_slowest_all_have_covered_the_same_share_within_their_limits(
    limits: list[tuple[float, float, float]], share: float
) -> None:
    own = [Profile.within(*limit) for limit in limits]
    pace = Pace.slowest(profile.pace for profile in own)
    paced = [Profile.paced(distance, pace) for distance, _, _ in limits]

    assert pace.duration >= max(profile.duration for profile in own) - 1e-9
    covered = [p.at(share * pace.duration)[0] / p.distance for p in paced]
    assert covered == pytest.approx([covered[0]] * len(covered), abs=1e-9)
    for profile, (_, speed, acceleration) in zip(paced, limits, strict=True):
        assert profile.duration == pytest.approx(pace.duration)
        assert profile.speed <= speed * (1.0 + 1e-9)
        assert MAX_SLOPE * profile.speed / profile.ramp <= max(
            acceleration, MAX_SLOPE * profile.distance / 0.25
        ) * (1.0 + 1e-9)


def test_no_way_keeps_every_pace() -> None:
    assert Profile.paced(0.0, Pace(2.0, 1.0)).at(1.0) == (0.0, 0.0, 0.0, 0.0)
