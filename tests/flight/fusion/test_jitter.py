"""How noisy poses are is told by themselves, however the vehicle moves."""

from __future__ import annotations

import random
from math import cos, sin

import pytest

from kybflow.core.geometry import ZERO, Vec3, from_euler, integrate
from kybflow.core.signals import NS, Pose
from kybflow.runtime.estimators._fusion_sources import Jitter

PERIOD = NS // 120


def poses(seconds: float, position: float, attitude: float) -> list[Pose]:
    """Poses of a quick circle with noise of these standard deviations, a tenth of them lost."""
    chance = random.Random(1)

    def noise(deviation: float) -> Vec3:
        return (chance.gauss(0, deviation), chance.gauss(0, deviation), chance.gauss(0, deviation))

    seen = []
    for step in range(round(seconds * 120)):
        t = step * PERIOD / NS
        x, y, z = noise(position)
        turned = integrate(from_euler(0.2 * sin(3.0 * t), 0.1, t), noise(attitude), 1.0)
        if chance.random() < 0.9:
            seen.append(Pose(step * PERIOD, (cos(2.0 * t) + x, sin(2.0 * t) + y, 1.0 + z), turned))
    return seen


@pytest.mark.parametrize(("position", "attitude"), [(0.02, 0.003), (0.0005, 0.03)])
def test_the_noise_is_found(position: float, attitude: float) -> None:
    jitter = Jitter()
    found = []
    for pose in poses(10.0, position, attitude):
        jitter.see(pose)
        found.append((jitter.position, jitter.attitude))
    late = found[200:]
    mean = [sum(variances) / len(late) for variances in zip(*late, strict=True)]
    assert mean == pytest.approx([position**2, attitude**2], rel=0.3)


def test_neither_a_quick_flight_nor_a_jump_nor_a_gap_is_noise() -> None:
    jitter = Jitter()
    most = 0.0
    for pose in poses(6.0, 0.0, 0.0):
        away = 1.0 if pose.time > 2 * NS else 0.0
        if 3 * NS < pose.time < 4 * NS:
            continue
        x, y, z = pose.position
        jitter.see(pose._replace(position=(x + away, y, z)))
        jitter.see(Pose(pose.time, ZERO, pose.attitude))  # at once again: nothing new
        most = max(most, jitter.position)
    assert most < 0.001**2
