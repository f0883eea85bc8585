"""The estimators of an emulated computer: what a sighting changes."""

from __future__ import annotations

from math import cos, sin, tan

import pytest

from kybflow.core.geometry import GRAVITY, ZERO, rotate
from kybflow.core.signals import NS, Imu
from kybflow.drivers.emulation.estimation import AttitudeFilter, PositionObserver


@pytest.mark.parametrize("gap", [0.25, 0.9, 3.0])
def test_an_offset_after_a_gap_is_taken_for_no_more_than_a_drift(gap):
    observer = PositionObserver()
    observer.correct((0.0, 0.0, 0.4), (4.0, 4.0, 4.0), gap)
    assert 0.35 < observer.position[2] <= 0.4
    assert 0.0 < observer.velocity[2] < 1.5 * 0.4 / gap + 1e-9


def test_sightings_teach_a_speed_and_an_acceleration():
    observer, dt = PositionObserver(), 0.02
    for step in range(1, 400):
        t = step * dt
        observer.add_imu(ZERO, dt, round(t * NS))
        observer.correct(observer.off((0.1 * t * t, 0.3 * t, 0.0), round(t * NS)), (4.0,) * 3, dt)
    assert observer.velocity == pytest.approx((0.2 * t, 0.3, 0.0), abs=0.02)


def test_what_is_seen_levels_the_attitude_of_a_vehicle_that_accelerates():
    """It is tilted and accelerates along its thrust, which says nothing about the tilt; and its
    gyroscope is off."""
    dt, tilt, off = 0.01, 0.1, 0.06
    attitude, observer = AttitudeFilter(0.0), PositionObserver()
    felt = Imu(0, dt, (0.0, 0.0, GRAVITY / cos(tilt)), (0.0, off, 0.0))
    for step in range(1, 4001):
        t = step * dt
        attitude.add_imu(felt, observer.bias)
        x, y, z = rotate(attitude.value, felt.specific_force)
        observer.add_imu((x, y, z - GRAVITY), dt, round(t * NS))
        seen = (0.5 * GRAVITY * tan(tilt) * t * t, 0.0, 0.0)
        observer.correct(observer.off(seen, round(t * NS)), (4.0,) * 3, dt)
    assert attitude.rate == pytest.approx(ZERO, abs=0.001)
    up = rotate(attitude.value, (0.0, 0.0, 1.0))
    assert up == pytest.approx((sin(tilt), 0.0, cos(tilt)), abs=0.002)
