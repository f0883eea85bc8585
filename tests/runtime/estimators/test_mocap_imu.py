"""The body of motion capture is levelled by what the accelerometer feels, in flight, and the
velocity is right while something pushes."""

from __future__ import annotations

import random
from math import cos, degrees, radians, sin

import pytest
from figure_eight_flight import DT, SITE

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    conjugate,
    from_euler,
    from_thrust_direction,
    integrate,
    multiply,
    rotate_back,
    tilt_of,
)
from kybflow.core.signals import NS, Estimate, Imu, Pose
from kybflow.runtime.estimators._mocap_imu import (
    LARGEST_ANGLE,
    LARGEST_OFFSET,
    ImuSums,
    StampOffset,
)
from kybflow.runtime.estimators.mocap import Mocap, MocapParams

RADIUS, RATE = 0.7, 1.2


def motion(t: float) -> tuple[Vec3, Quat, Vec3]:
    """Position, attitude and specific force (body) of a circle whose nose turns."""
    c, s = RADIUS * cos(RATE * t), RADIUS * sin(RATE * t)
    force = (-RATE * RATE * c, -RATE * RATE * s, GRAVITY)
    attitude = from_thrust_direction(force, 0.5 * t)
    return (c, s, 1.0), attitude, rotate_back(attitude, force)


def tilt_error(
    turned: Quat, seconds: float, bias: Vec3 = ZERO, dt: float = DT, **params: float
) -> float:
    """How far the estimate's z is off the vehicle's after a flight whose poses are of a body that
    is `turned` against the vehicle, degrees."""
    estimator, estimate = Mocap(MocapParams(**params), SITE), None
    attitude = LEVEL
    for step in range(1, round(seconds / dt) + 1):
        now = round(step * dt * NS)
        place, attitude, (fx, fy, fz) = motion(step * dt)
        felt = Imu(now, dt, (fx + bias[0], fy + bias[1], fz + bias[2]), ZERO)
        seen = [Pose(now, place, multiply(attitude, turned))] if step % 2 else []
        estimate = estimator.update((felt, *seen), now)
    assert isinstance(estimate, Estimate)
    return degrees(tilt_of(multiply(conjugate(attitude), estimate.attitude)))


def test_an_imu_of_a_hundred_samples_a_second_is_used() -> None:
    turned = from_euler(radians(1.5), radians(-1.0), 0.0)
    assert tilt_error(turned, 12.0, dt=0.01) < 0.15


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_the_angle_about_the_level_axes_is_found(heading: float) -> None:
    turned = from_euler(radians(1.5), radians(-1.0), radians(heading))
    assert tilt_error(turned, 12.0, levelling=0.0) == pytest.approx(1.8, abs=0.1)
    assert tilt_error(turned, 3.0) < 0.5
    assert tilt_error(turned, 12.0) < 0.15


def test_what_the_accelerometer_is_wrong_by_is_taken_for_an_angle() -> None:
    assert tilt_error(LEVEL, 12.0, bias=(0.05, 0.0, 0.0)) == pytest.approx(0.3, abs=0.1)


def test_an_accelerometer_that_is_far_off_turns_nothing_further_than_a_lab_is_wrong() -> None:
    assert tilt_error(LEVEL, 12.0, bias=(1.5, 0.0, 0.0)) == pytest.approx(
        degrees(LARGEST_ANGLE), abs=0.2
    )
    assert tilt_error(LEVEL, 12.0, bias=(0.0, 0.0, 6.0)) < 0.1


@pytest.mark.parametrize("push", [0.5, -0.3])
def test_the_velocity_knows_of_a_push(push: float) -> None:
    """A vehicle leans against a wind and stays where it is."""
    leaning = from_thrust_direction((-push, 0.0, GRAVITY), 0.0)
    speeds = []
    for levelling in (5.0, 0.0):
        estimator, estimate = Mocap(MocapParams(levelling=levelling), SITE), None
        for step in range(1, 500):
            now = round(step * DT * NS)
            felt = Imu(now, DT, rotate_back(leaning, (0.0, 0.0, GRAVITY)), ZERO)
            seen = [Pose(now, ZERO, leaning)] if step % 2 else []
            estimate = estimator.update((felt, *seen), now)
        assert estimate is not None
        speeds.append(estimate.velocity[0])
    assert speeds == [pytest.approx(0.0, abs=0.002), pytest.approx(-0.06 * push, abs=0.01)]


def test_without_an_imu_the_pose_is_taken_as_it_is() -> None:
    estimator, turned = Mocap(MocapParams(), SITE), from_euler(0.02, 0.01, 0.0)
    estimate = None
    for step in range(1, 600):
        now = round(step * DT * NS)
        estimate = estimator.update((Pose(now, ZERO, turned),), now)
    assert estimate is not None
    assert estimate.attitude == pytest.approx(turned, abs=1e-6)


def test_an_imu_that_is_heard_now_and_then_tells_nothing() -> None:
    estimator, turned = Mocap(MocapParams(), SITE), from_euler(0.02, 0.01, 0.0)
    estimate = None
    for step in range(1, 600):
        now = round(step * DT * NS)
        felt = [Imu(now, 0.04, (0.0, 0.0, GRAVITY), (0.2, 0.0, 0.0))] if step % 10 == 0 else []
        estimate = estimator.update((*felt, Pose(now, ZERO, turned)), now)
    assert estimate is not None
    assert estimate.attitude == pytest.approx(turned, abs=1e-6)


def test_after_a_gap_in_the_poses_what_was_felt_meanwhile_does_not_count() -> None:
    estimator = Mocap(MocapParams(), SITE)
    estimate = None
    for step in range(1, 2000):
        now = round(step * DT * NS)
        lost = step % 200 < 100
        felt = Imu(now, DT, (3.0 if lost else 0.0, 0.0, GRAVITY), ZERO)
        estimate = estimator.update((felt,) if lost else (felt, Pose(now, ZERO, LEVEL)), now)
    assert estimate is not None
    assert degrees(tilt_of(estimate.attitude)) < 0.1


SAMPLE = 0.001
TICK = 4
TURNED = from_euler(0.02, -0.03, 0.02)


def rates(t: float) -> Vec3:
    return (0.2 * sin(2.0 * t), 0.15 * cos(3.1 * t), 0.1 * sin(0.7 * t))


def found(
    offset: float, seconds: float = 20.0, still: bool = False, noise: float = 0.1, gap: float = 0.0
) -> float:
    """What is found of an offset, seconds. Poses are 8 ms old, every 8 ms. gap: poses are lost for
    so long in the middle, and the vehicle is another one afterwards."""
    chance, sums = random.Random(1), ImuSums(0.0)
    clock = StampOffset(20.0, sums)
    truth: list[Quat] = [LEVEL]
    mean = ZERO
    for step in range(1, round(seconds / SAMPLE)):
        now = round(step * SAMPLE * NS)
        w = ZERO if still else rates((step - 0.5) * SAMPLE)
        truth.append(integrate(truth[-1], w, SAMPLE))
        mean = tuple(a + b / TICK for a, b in zip(mean, w, strict=True))  # type: ignore[assignment]
        if step % TICK:
            continue
        drift = tuple(a + 0.003 for a in mean)
        sums.take(Imu(now, TICK * SAMPLE, (0.0, 0.0, 9.81), drift))  # type: ignore[arg-type]
        mean = ZERO
        if step % 8 or step < 100 or 0.0 < step * SAMPLE - 0.5 * seconds < gap:
            continue
        x, y, z = (chance.gauss(0.0, radians(noise)) for _ in range(3))
        seen = integrate(multiply(truth[step - 8 - round(offset / SAMPLE)], TURNED), (x, y, z), 1.0)
        if gap and step * SAMPLE > 0.5 * seconds:
            seen = multiply(from_euler(0.0, 0.0, 1.0), seen)
        clock.look(now - round(8 * SAMPLE * NS), seen)
    return clock.seconds


@pytest.mark.parametrize("offset", [-0.005, 0.0, 0.002, 0.008])
def test_it_is_found_to_a_millisecond_whatever_the_body_is_turned_by(offset: float) -> None:
    assert found(offset) == pytest.approx(offset, abs=0.001)


def test_who_never_turns_tells_nothing() -> None:
    assert found(0.008, still=True) == pytest.approx(0.0, abs=0.0005)


def test_it_is_never_more_than_a_clock_may_be_off() -> None:
    assert found(0.06, noise=0.0) == pytest.approx(LARGEST_OFFSET)


def test_a_gap_and_another_heading_after_it_are_no_offset() -> None:
    assert found(0.005, gap=0.6) == pytest.approx(0.005, abs=0.001)
