"""The averages of a vehicle at rest."""

from __future__ import annotations

import pytest

from kybflow.core.geometry import GRAVITY, ZERO
from kybflow.core.signals import NS, Imu
from kybflow.flight.fusion.filter import Standstill


@pytest.mark.parametrize("again", [0, -NS // 500])
def test_a_sample_that_is_not_newer_does_not_count(again: int) -> None:
    still = Standstill()
    for step in range(300):
        time = step * NS // 200
        still.add_imu(Imu(time, 0.005, (0.0, 0.0, GRAVITY), ZERO))
        still.add_imu(Imu(time + again, 0.005, (0.05, 0.0, GRAVITY), ZERO))
    assert still.holds(NS)
    assert still._force[0] == 0.0
