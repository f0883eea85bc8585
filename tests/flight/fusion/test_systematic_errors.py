"""What measurements have in common is not averaged away, and is learnt where something tells it."""

from __future__ import annotations

import random
from math import sqrt

import numpy
import pytest

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, from_euler
from kybflow.core.signals import NS, Imu
from kybflow.flight.fusion.covariance import STATES, WANDERERS, ImuNoise, Nominal, predicted
from kybflow.flight.fusion.filter import Unknown, begun
from kybflow.flight.fusion.replay import Fix, Replay

QUIET = ImuNoise(0.005, 0.0002, 0.0, 0.0)
UNKNOWN = Unknown(0.05, 0.004, 0.2)
NOISE = numpy.diag([0.002**2] * 3 + [0.003**2] * 3)
PLACE, TURN = 0.01, 0.02
"""What a constant does to poses: along x, metres, and about the body's y, radians."""


def slopes() -> numpy.ndarray:
    """Of what the map does, a little, and of two constants."""
    found = numpy.zeros((6, WANDERERS + 2))
    found[:, :WANDERERS] = 0.001 * numpy.eye(6)
    found[0, -2], found[4, -1] = PLACE, TURN
    return found


def standing(seconds: float) -> tuple[Replay, int]:
    """The filter of a body that stands level at the origin and whose poses, ten a second, are
    PLACE and 1.5 TURN off; and how many of these were refused."""
    chance = random.Random(2)
    replay = Replay(QUIET, 0.001, 0.5, NS)
    count = 0
    for step in range(1, round(250 * seconds)):
        now = step * NS // 250
        replay.add_imu(Imu(now, 0.004, (0.0, 0.0, GRAVITY), ZERO))
        if step % 25 == 0:
            x, y, z = (chance.gauss(0.0, 0.002) for _ in range(3))
            fix = Fix(now, (PLACE + x, y, z), from_euler(0.0, 1.5 * TURN, 0.0), NOISE, slopes())
            if replay.state is None:
                replay.begin(begun(fix, UNKNOWN, LEVEL, ZERO))
            else:
                replay.add(fix)
                count += replay.state.missed is not None and replay.state.missed.time == now
    return replay, count


def test_no_number_of_poses_takes_a_common_error_out_of_the_spread() -> None:
    replay, refused = standing(20.0)
    assert replay.state is not None
    assert replay.state.deviation > 0.95 * PLACE
    assert replay.state.nominal.position[0] == pytest.approx(PLACE, abs=0.005)
    assert refused == 0


def test_gravity_tells_how_the_camera_is_turned_on_the_body() -> None:
    """1.5 standard deviations, within what the accelerometer's own bias may feign."""
    replay, _ = standing(10.0)
    state = replay.state
    assert state is not None
    spread = sqrt(float(state.covariance[-1, -1]))
    assert spread < 0.35
    assert abs(state.systematic[-1] - 1.5) < 3.0 * spread
    _, _, y, _ = state.nominal.attitude
    assert abs(2.0 * y) < 0.01


def test_what_the_map_does_is_forgotten_on_the_way_to_other_tags() -> None:
    begin = begun(Fix(0, ZERO, LEVEL, NOISE, slopes()), UNKNOWN, LEVEL, ZERO)
    known = begin.covariance.copy()
    known[STATES:] *= 0.1
    known[:, STATES:] *= 0.1
    there = Nominal(NS, ZERO)
    for kept, variance in ((1.0, 0.01), (0.5, 0.7525), (0.0, 1.0)):
        after = predicted(known, Nominal(0, ZERO), there, QUIET.variances(), kept)
        assert after.diagonal()[STATES : STATES + WANDERERS] == pytest.approx(variance)
        assert after.diagonal()[STATES + WANDERERS :] == pytest.approx(0.01)
        assert (numpy.linalg.eigvalsh(after) > -1e-9).all()
