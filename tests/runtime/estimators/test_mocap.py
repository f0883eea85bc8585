"""The mocap estimator: right at any rate, with any gap, whatever the order of its poses."""

from __future__ import annotations

import random
import statistics
from itertools import accumulate
from math import cos, nan, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, add, from_euler, heading_of
from kybflow.core.signals import NS, Battery, Estimate, Pose
from kybflow.runtime.estimators.mocap import Mocap, MocapParams
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05)
PLACE = VehicleContext("a", FRAME, ZERO, 0.0, None, 0.004)


def mocap(**params):
    return Mocap(MocapParams(**params), PLACE)


def ns(seconds):
    return round(seconds * NS)


def fed(estimator, stamps, pose_at, latency=0.0):
    """The estimate after the poses of `stamps`, each given when it arrives."""
    estimate = None
    for stamp in stamps:
        pose = Pose(ns(stamp), *pose_at(stamp))
        estimate = estimator.update((pose,), ns(stamp + latency))
    return estimate


def every(rate, seconds):
    return [n / rate for n in range(round(rate * seconds))]


def circling(t, radius=0.7, rate=1.0):
    """A coordinated circle: the slope of body z gives the centripetal acceleration."""
    slope = radius * rate * rate / GRAVITY
    roll, pitch = slope * sin(rate * t), -slope * cos(rate * t)
    return (radius * cos(rate * t), radius * sin(rate * t), 1.0), from_euler(roll, pitch, 0.0)


def test_it_needs_poses_and_tells_nothing_before_it_has_enough():
    assert frozenset({Pose}) == Mocap.needs
    estimator = mocap(samples=5)
    told = [estimator.update((Pose(ns(t), ZERO, LEVEL),), ns(t)) for t in every(120, 0.05)]
    assert [estimate is None for estimate in told] == [True] * 4 + [False] * 2


@pytest.mark.parametrize(
    "lost", [((nan, 0.0, 0.0), LEVEL), (ZERO, (0.0, 0.0, 0.0, 0.0)), (ZERO, (nan, 0.0, 0.0, 0.0))]
)
def test_a_pose_of_a_lost_body_is_dropped(lost):
    def seen(t):
        return lost if t > 0.4 else circling(t)

    estimate = fed(mocap(), every(120, 0.5), seen)
    assert estimate.age == pytest.approx(0.1, abs=0.02)
    assert estimate.position == pytest.approx(circling(0.5)[0], abs=0.02)


def test_a_battery_report_is_none_of_its_business():
    assert mocap().update((Battery(0, 1.0, 16.0),), 0) is None


@pytest.mark.thorough
@given(
    rate=st.floats(30.0, 300.0),
    velocity=st.tuples(*[st.floats(-2.0, 2.0)] * 3),
    latency=st.floats(0.0, 0.05),
)
def test_a_constant_velocity_is_found_and_the_latency_made_up_for(rate, velocity, latency):
    def pose_at(t):
        return tuple(v * t for v in velocity), LEVEL

    stamps = every(rate, 2.0)
    estimate = fed(mocap(), stamps, pose_at, latency)
    assert estimate.velocity == pytest.approx(velocity, abs=1e-3)
    assert estimate.position == pytest.approx(pose_at(stamps[-1] + latency)[0], abs=1e-3)
    assert estimate.age == pytest.approx(latency, abs=1e-8)


@given(st.integers(0, 10_000))
def test_irregular_stamps_do_not_matter(seed):
    generator = random.Random(seed)
    stamps = list(accumulate(generator.uniform(0.002, 0.08) for _ in range(100)))
    estimate = fed(mocap(), stamps, lambda t: ((t, -2.0 * t, 0.5), LEVEL))
    assert estimate.velocity == pytest.approx((1.0, -2.0, 0.0), abs=1e-3)


def test_an_accelerating_vehicle_is_followed_without_lag():
    stamps = every(120, 6.0)
    estimate = fed(mocap(), stamps, circling, latency=0.010)
    t = stamps[-1] + 0.010
    assert estimate.velocity == pytest.approx((-0.7 * sin(t), 0.7 * cos(t), 0.0), abs=0.005)
    assert estimate.position == pytest.approx(circling(t)[0], abs=0.002)


def test_body_rates_come_from_the_attitude():
    estimate = fed(mocap(), every(120, 2.0), lambda t: (ZERO, from_euler(0.0, 0.0, 0.8 * t)))
    assert estimate.angular_velocity == pytest.approx((0.0, 0.0, 0.8), abs=0.002)
    assert heading_of(estimate.attitude) == pytest.approx(0.8 * (2.0 - 1 / 120), abs=0.002)


def test_a_quaternion_that_flips_its_sign_is_the_same_attitude():
    def flipping(t):
        position, (w, x, y, z) = circling(t)
        return position, (w, x, y, z) if round(t * 120) % 3 else (-w, -x, -y, -z)

    stamps = every(120, 2.0)
    steady, flipped = fed(mocap(), stamps, circling), fed(mocap(), stamps, flipping)
    assert flipped.angular_velocity == pytest.approx(steady.angular_velocity, abs=1e-9)
    assert flipped.velocity == pytest.approx(steady.velocity, abs=1e-9)


@given(st.integers(0, 10_000))
def test_duplicates_and_poses_out_of_order_are_dropped(seed):
    generator = random.Random(seed)
    stamps = every(120, 1.0)
    clean = fed(mocap(), stamps, circling)
    muddled = []
    for n, stamp in enumerate(stamps):
        muddled.append(stamp)
        if generator.random() < 0.3:
            muddled.append(stamps[generator.randint(0, n)])
    estimator = mocap()
    for stamp in muddled:
        dirty = estimator.update((Pose(ns(stamp), *circling(stamp)),), ns(stamps[-1]))
    assert dirty.position == pytest.approx(clean.position)
    assert dirty.velocity == pytest.approx(clean.velocity)


def test_between_poses_it_predicts_and_tells_its_age():
    estimator = mocap()
    fed(estimator, every(100, 1.0), lambda t: ((t, 0.0, 0.0), LEVEL))
    estimate = estimator.update((), ns(0.99 + 0.2))
    assert estimate.age == pytest.approx(0.2)
    assert estimate.position[0] == pytest.approx(1.19, abs=1e-3)
    assert estimate.time == ns(1.19)


def test_after_a_long_gap_it_starts_again_instead_of_inventing_a_speed():
    estimator = mocap(gap=0.5)
    fed(estimator, every(120, 1.0), lambda t: (ZERO, LEVEL))
    assert estimator.update((Pose(ns(3.0), (0.3, 0.0, 0.0), LEVEL),), ns(3.0)) is None
    estimate = fed(
        estimator, [3.0 + t for t in every(120, 0.1)], lambda t: ((0.3, 0.0, 0.0), LEVEL)
    )
    assert estimate.velocity == ZERO
    assert estimate.position == pytest.approx((0.3, 0.0, 0.0))


def test_the_spread_tells_the_noise():
    def spread(noise):
        generator = random.Random(4)

        def pose_at(t):
            return tuple(generator.gauss(0.0, noise) for _ in range(3)), LEVEL

        return fed(mocap(), every(120, 3.0), pose_at).spread

    assert spread(0.002) == pytest.approx(0.002, rel=0.4)
    assert spread(0.002) == pytest.approx(10.0 * spread(0.0002), rel=0.01)
    assert spread(0.02) == pytest.approx(0.02, rel=0.4)


def test_the_noise_of_half_a_millimetre_stays_under_a_centimetre_a_second():
    generator = random.Random(2)
    estimator, speeds = mocap(), []
    for stamp in every(120, 20.0):
        noisy = tuple(generator.gauss(0.0, 0.0005) for _ in range(3))
        estimate = estimator.update((Pose(ns(stamp), noisy, LEVEL),), ns(stamp))
        if estimate is not None:
            speeds.append(estimate.velocity[0])
    assert statistics.pstdev(speeds) < 0.01


def shaken(noise, seed=0, pull=0.0):
    """(errors of the velocity east, errors upward) of a vehicle that after two seconds begins to
    sink with `pull` m/s^2."""
    generator = random.Random(seed)
    estimator, east, upward = mocap(), [], []
    for stamp in every(120, 3.0):
        since = max(stamp - 2.0, 0.0)
        x, y, z = (generator.gauss(0.0, noise) for _ in range(3))
        pose = Pose(ns(stamp), (x, y, z - 0.5 * pull * since * since), LEVEL)
        estimate = estimator.update((pose,), ns(stamp))
        if estimate is not None and stamp > 1.0:
            east.append(estimate.velocity[0])
            upward.append(estimate.velocity[2] + pull * since)
    return east, upward


def test_noise_of_two_centimetres_shakes_the_level_velocity_little():
    east, upward = ([e for seed in range(5) for e in shaken(0.02, seed)[i]] for i in range(2))
    assert statistics.pstdev(east) < 0.025
    assert statistics.pstdev(upward) < 0.08


@pytest.mark.parametrize("noise", [0.0005, 0.02])
def test_a_fall_is_known_soon_however_noisy_the_poses_are(noise):
    """The lag of the velocity is 2 / wn, wn no less than half the bandwidth."""
    falls = [shaken(noise, seed, pull=2.0)[1] for seed in range(10)]
    late = statistics.mean(error for fall in falls for error in fall[-30:])
    assert late < 2.0 * 2.0 / (pi * 5.0) + 0.03


def test_its_derivative_has_the_gain_of_the_second_order_filter():
    """|H(jw)| / w = wn^2 / (wn^2 + w^2) for TeleKyb's H at w = wn: one half, where the attitude
    tells nothing."""
    wn = 2 * pi * 2.0
    estimator, peak = mocap(velocity_bandwidth=2.0), 0.0
    for stamp in every(400, 6.0):
        pose = Pose(ns(stamp), (0.0, 0.0, 0.001 * sin(wn * stamp)), LEVEL)
        estimate = estimator.update((pose,), ns(stamp))
        if estimate is not None and stamp > 4.0:
            peak = max(peak, abs(estimate.velocity[2]))
    assert peak / (0.001 * wn) == pytest.approx(0.5, abs=0.02)


def jumping(when, where, turn=0.0):
    """Standing at 1 m, and elsewhere in the times of `when`."""

    def pose_at(t):
        away = any(begin <= t < end for begin, end in when)
        attitude = from_euler(0.0, 0.0, turn if away else 0.0)
        return (add((0.0, 0.0, 1.0), where) if away else (0.0, 0.0, 1.0)), attitude

    return pose_at


@pytest.mark.parametrize(
    ("where", "turn"),
    [((2.0, 0.0, 0.0), 0.0), ((0.0, 0.4, 0.0), 0.0), (ZERO, pi)],
    ids=["body", "reflection", "turned"],
)
def test_a_pose_that_no_flight_explains_only_makes_the_estimate_older(where, turn):
    pose_at = jumping([(1.0, 9.0)], where, turn)
    estimate = fed(mocap(), every(120, 1.3), pose_at)
    assert estimate.position == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)
    assert estimate.velocity == pytest.approx(ZERO, abs=1e-6)
    assert estimate.age == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("length", [0.2, 1.5, 30.0])
def test_the_vehicles_own_body_is_taken_again_when_it_comes_back(length):
    pose_at = jumping([(1.0, 1.0 + length)], (0.8, 0.0, 0.0))
    stamps = [t for t in every(120, 1.1 + length) if t < 18.0 or t > 1.0 + length]
    estimate = fed(mocap(), stamps, pose_at)
    assert estimate.position == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)
    assert estimate.age == pytest.approx(0.0, abs=1e-6)


def test_another_body_is_not_taken_while_another_estimate_is_flown_on():
    estimator = mocap(settled=5.0)
    pose_at = jumping([(1.0, 99.0)], (2.0, 0.0, 0.0))
    for stamp in every(50, 60.0):
        estimate = estimator.update((Pose(ns(stamp), *pose_at(stamp)),), ns(stamp))
        flown = Estimate(ns(stamp), (0.0, 0.0, 1.0), ZERO, LEVEL, ZERO, "inertial", 0.0, 0.2)
        estimator.anchor(flown)
    assert estimate.position == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)


def test_what_is_flown_on_tells_which_poses_may_be_taken_again():
    """The vehicle moved 0.6 m unseen, and dead reckoning knows it within its spread."""
    estimator = mocap()
    fed(estimator, every(120, 1.0), jumping([], ZERO))
    now, velocity = ns(3.0), (0.3, 0.0, 0.0)
    flown = Estimate(now, (0.5, 0.0, 1.0), velocity, LEVEL, ZERO, "inertial", 0.0, 0.05)
    estimator.anchor(flown)
    seen = Pose(now, (0.6, 0.0, 1.0), LEVEL)
    estimates = [
        estimator.update((seen._replace(time=now + n * ns(0.008)),), now + n * ns(0.008))
        for n in range(6)
    ]
    assert estimates[-1].position == pytest.approx((0.6, 0.0, 1.0), abs=0.02)
    assert fed(mocap(), every(120, 1.0), jumping([], ZERO)) is not None


def test_a_vehicle_that_was_carried_is_found_again_after_a_while():
    pose_at = jumping([(1.0, 99.0)], (2.0, 1.0, 0.0))
    before = fed(mocap(settled=5.0), every(50, 5.9), pose_at)
    assert before.position == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)
    after = fed(mocap(settled=5.0), every(50, 6.5), pose_at)
    assert after.position == pytest.approx((2.0, 1.0, 1.0), abs=1e-6)
    assert after.age == pytest.approx(0.0, abs=1e-6)


def test_poses_that_jump_about_are_not_a_vehicle_that_was_carried():
    def pose_at(t):
        return ((1.0 + t % 0.5, 0.0, 1.0) if t > 1.0 else (0.0, 0.0, 1.0)), LEVEL

    estimate = fed(mocap(settled=2.0), every(50, 20.0), pose_at)
    assert estimate.position == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)


def test_a_wrong_first_pose_keeps_nobody_out():
    pose_at = jumping([(0.0, 0.015)], (3.0, 0.0, 0.0))
    estimate = fed(mocap(), every(120, 0.2), pose_at)
    assert estimate.position == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)


@pytest.mark.parametrize("rate", [30, 120])
@pytest.mark.parametrize("noise", [0.0005, 0.02])
def test_the_hardest_flight_and_noise_pass(rate, noise):
    """1 m/s and back with 4 m/s^2, seen with up to 2 cm of noise."""
    generator = random.Random(5)

    def pose_at(t):
        x, y, z = 0.25 * sin(4.0 * t), 0.25 * cos(4.0 * t), 1.0
        nx, ny, nz = (generator.gauss(0.0, noise) for _ in range(3))
        return (x + nx, y + ny, z + nz), from_euler(-0.4 * cos(4.0 * t), 0.4 * sin(4.0 * t), 0.0)

    estimator, ages = mocap(), []
    for stamp in every(rate, 20.0):
        estimate = estimator.update((Pose(ns(stamp), *pose_at(stamp)),), ns(stamp))
        if estimate is not None:
            ages.append(estimate.age)
    assert sum(age > 0.0 for age in ages) < 0.01 * len(ages)
