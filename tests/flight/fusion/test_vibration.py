"""The noise of an IMU, measured from its own samples, and the averages of a vehicle at rest."""

from __future__ import annotations

import random
from math import sin

import pytest

from kybflow.core.geometry import GRAVITY, ZERO, Vec3
from kybflow.core.signals import NS, Imu
from kybflow.flight.fusion.covariance import ImuNoise, Vibration
from kybflow.flight.fusion.filter import Standstill

DECLARED = ImuNoise(0.005, 0.0002, 0.0005, 0.00002)
DT = 0.004


def shaken(force: float, turn: float) -> Vibration:
    """By noise of these standard deviations, in an agile flight of five seconds."""
    chance, vibration = random.Random(1), Vibration(DECLARED)

    def noisy(value: Vec3, deviation: float) -> Vec3:
        x, y, z = (part + chance.gauss(0.0, deviation) for part in value)
        return x, y, z

    for step in range(1250):
        t = step * DT
        moved, turned = (5.0 * sin(6.0 * t), 0.0, 9.81), (0.0, 3.0 * sin(8.0 * t), 1.0)
        vibration.add_imu(noisy(moved, force), noisy(turned, turn), DT)
    return vibration


def test_what_is_declared_holds_while_samples_are_as_quiet() -> None:
    assert shaken(0.07, 0.0025).noise == DECLARED


def test_what_rotors_shake_is_found() -> None:
    noise = shaken(0.7, 0.015).noise
    assert noise.velocity == pytest.approx(0.7 * DT**0.5, rel=0.15)
    assert noise.attitude == pytest.approx(0.015 * DT**0.5, rel=0.15)
    assert noise[2:] == DECLARED[2:]


@pytest.mark.parametrize("again", [0, -NS // 500])
def test_a_sample_that_is_not_newer_does_not_count(again: int) -> None:
    still = Standstill()
    for step in range(300):
        time = step * NS // 200
        still.add_imu(Imu(time, 0.005, (0.0, 0.0, GRAVITY), ZERO))
        still.add_imu(Imu(time + again, 0.005, (0.05, 0.0, GRAVITY), ZERO))
    assert still.holds(NS)
    assert still._force[0] == 0.0
