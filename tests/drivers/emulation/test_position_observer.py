"""The position observer of an emulated computer: what a sighting changes."""

from __future__ import annotations

import pytest

from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS
from kybflow.drivers.emulation.estimation import PositionObserver


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
        observer.feel(ZERO, dt, round(t * NS))
        observer.correct(observer.off((0.1 * t * t, 0.3 * t, 0.0), round(t * NS)), (4.0,) * 3, dt)
    assert observer.velocity == pytest.approx((0.2 * t, 0.3, 0.0), abs=0.02)
