"""How late poses are stamped is found from the gyroscope."""

from __future__ import annotations

import random
from math import cos, radians, sin

import pytest

from kybflow.core.geometry import LEVEL, ZERO, Quat, Vec3, from_euler, integrate, multiply
from kybflow.core.signals import NS, Imu
from kybflow.runtime.estimators._mocap_imu import LARGEST_OFFSET, ImuSums, StampOffset

DT = 0.001
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
    for step in range(1, round(seconds / DT)):
        now = round(step * DT * NS)
        w = ZERO if still else rates((step - 0.5) * DT)
        truth.append(integrate(truth[-1], w, DT))
        mean = tuple(a + b / TICK for a, b in zip(mean, w, strict=True))  # type: ignore[assignment]
        if step % TICK:
            continue
        drift = tuple(a + 0.003 for a in mean)
        sums.take(Imu(now, TICK * DT, (0.0, 0.0, 9.81), drift))  # type: ignore[arg-type]
        mean = ZERO
        if step % 8 or step < 100 or 0.0 < step * DT - 0.5 * seconds < gap:
            continue
        x, y, z = (chance.gauss(0.0, radians(noise)) for _ in range(3))
        seen = integrate(multiply(truth[step - 8 - round(offset / DT)], TURNED), (x, y, z), 1.0)
        if gap and step * DT > 0.5 * seconds:
            seen = multiply(from_euler(0.0, 0.0, 1.0), seen)
        clock.look(now - round(8 * DT * NS), seen)
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
