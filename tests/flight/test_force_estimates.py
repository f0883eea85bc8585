"""What pushes a vehicle, as its accelerometer tells it."""

from __future__ import annotations

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.geometry import GRAVITY, ZERO, Vec3, from_euler, rotate_back
from kybflow.core.signals import NS, Estimate, Imu, Time
from kybflow.flight.force_estimates import (
    MAX_PUSH,
    SHAKING_RATE,
    WASHOUT_TIME_S,
    DisturbanceObserver,
)
from kybflow.world.vehicle_context import Airframe

FRAME = Airframe(
    mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05, drag=0.25
)  # fmt: skip
DT = 0.004
TILTED = from_euler(0.2, -0.1, 0.7)


def observed(
    seconds: float,
    push: Vec3 = ZERO,
    velocity: Vec3 = ZERO,
    given: float = GRAVITY,
    bias: Vec3 = ZERO,
    heard: float = inf,
    observer: DisturbanceObserver | None = None,
    turning: Vec3 = ZERO,
) -> DisturbanceObserver:
    """An observer after so many seconds of a push (world) at a tilt, with a bandwidth of 2 Hz.
    heard: seconds until the IMU falls silent."""
    observer = observer or DisturbanceObserver(FRAME)
    vx, vy, _ = rotate_back(TILTED, velocity)
    px, py, pz = rotate_back(TILTED, push)
    felt = (px - 0.25 * vx + bias[0], py - 0.25 * vy + bias[1], pz + given + bias[2])
    for step in range(1, round(seconds / DT) + 1):
        now: Time = round(step * DT * NS)
        last = min(now, round(min(heard, 1e6) * NS))
        estimate = Estimate(now, ZERO, velocity, TILTED, turning, "mocap", 0.0, 0.0)
        observer.update(Imu(last, DT, felt, ZERO), estimate, given, 2.0, DT)
    return observer


def test_a_push_is_found_in_a_tenth_of_a_second_whatever_the_tilt_and_the_speed() -> None:
    push = (0.4, -0.2, 0.3)
    assert observed(0.25, push).acceleration == pytest.approx(push, abs=0.05)
    assert observed(0.08, push, velocity=(1.0, 0.5, 0.2)).acceleration == pytest.approx(
        (0.25, -0.125, 0.19), abs=0.02
    )


def test_while_the_vehicle_swings_it_learns_slowly_but_a_turn_of_its_nose_is_no_swing() -> None:
    still = observed(0.04, (0.4, 0.0, 0.0)).acceleration[0]
    swinging = observed(0.04, (0.4, 0.0, 0.0), turning=(0.0, SHAKING_RATE, 0.0)).acceleration[0]
    assert swinging == pytest.approx(0.5 * still, rel=0.15)
    assert observed(0.04, (0.4, 0.0, 0.0), turning=(0.0, 0.0, 2.0)).acceleration[0] == still


def test_thrust_and_drag_that_are_known_of_are_no_push() -> None:
    assert observed(2.0, velocity=(1.0, -2.0, 0.0)).acceleration == pytest.approx(ZERO, abs=1e-9)
    climbing = observed(1.0, given=GRAVITY + 2.0)
    assert climbing.acceleration == pytest.approx(ZERO, abs=0.15)


def test_what_lasts_stays_in_the_estimate_but_upwards() -> None:
    x, y, z = observed(4.0 * WASHOUT_TIME_S, (0.2, -0.1, 0.15)).acceleration
    assert (x, y) == pytest.approx((0.2, -0.1), abs=0.01)
    assert z == pytest.approx(0.0, abs=0.01)


def test_without_an_imu_and_on_the_ground_nothing_pushes() -> None:
    assert observed(0.5, (1.0, 0.0, 0.0), heard=0.3).acceleration == ZERO
    resting = observed(0.5, (1.0, 0.0, 0.0))
    resting.rest()
    assert resting.acceleration == ZERO


@given(st.tuples(*[st.floats(-100.0, 100.0)] * 3), st.tuples(*[st.floats(-20.0, 20.0)] * 3))
def test_it_is_bounded(push: Vec3, velocity: Vec3) -> None:
    assert max(map(abs, observed(0.2, push, velocity).acceleration)) <= MAX_PUSH
