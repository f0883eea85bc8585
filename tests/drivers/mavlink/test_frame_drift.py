"""How far an autopilot's own position is from the estimate, learnt slowly."""

from __future__ import annotations

from math import exp

import pytest

pytest.importorskip("pymavlink")

from hypothesis import given
from hypothesis import strategies as st
from scripted_autopilot import estimate

from kybflow.core.geometry import LEVEL, ZERO, add, norm, scale
from kybflow.core.signals import NS, Odometry
from kybflow.drivers.mavlink.telemetry.vision import DRIFT_TIME_S, FrameDrift

OFF = (0.06, -0.04, 0.03)
RATE = 50


def own(now, position=ZERO, velocity=ZERO):
    return Odometry(now, position, velocity, LEVEL, ZERO, 0.03)


def learn(drift, seconds, off=OFF, begin=0):
    """Hear for so long of an autopilot that stands `off` from the estimate; the time after it."""
    for tick in range(round(seconds * RATE)):
        now = begin + tick * NS // RATE
        drift.learn(estimate(now, off), own(now), now)
    return begin + round(seconds * NS)


def test_it_is_learnt_with_its_time_constant():
    drift = FrameDrift()
    learn(drift, DRIFT_TIME_S)
    assert drift.anchor.offset == pytest.approx(scale(OFF, 1.0 - exp(-1.0)), rel=0.02)
    learn(drift, 10.0 * DRIFT_TIME_S)
    assert drift.anchor.offset == pytest.approx(OFF, rel=1e-3)
    assert drift.anchor.heading == 0.0


def test_a_set_point_for_the_world_is_sent_where_its_own_frame_has_it():
    drift = FrameDrift()
    learn(drift, 10.0)
    assert drift.anchor.from_world(OFF) == pytest.approx(ZERO, abs=1e-4)


@given(st.floats(-2.0, 2.0), st.integers(-20, 20))
def test_what_was_true_at_another_time_is_compared_at_that_time(speed, ms):
    drift, velocity = FrameDrift(), (speed, 0.0, 0.0)
    for tick in range(20):
        now = tick * NS // RATE
        then = now - ms * NS // 1000
        place = scale(velocity, now / NS)
        drift.learn(estimate(now, place), own(then, scale(velocity, then / NS), velocity), now)
    assert norm(drift.anchor.offset) < 1e-6


def test_what_is_far_off_is_no_drift():
    drift = FrameDrift()
    learn(drift, 5.0, (0.8, 0.0, 0.0))
    assert drift.anchor.offset == ZERO
    learn(drift, 5.0, (0.4, 0.0, 0.0), begin=5 * NS)
    assert drift.anchor.offset == pytest.approx((0.4, 0.0, 0.0), abs=0.01)


def test_an_old_or_unheard_position_teaches_nothing():
    drift = FrameDrift()
    now = learn(drift, 10.0)
    known = drift.anchor
    for tick in range(RATE):
        drift.learn(estimate(now, (0.3, 0.0, 0.0)), own(now - NS), now + tick * NS // RATE)
        drift.learn(estimate(now, (0.3, 0.0, 0.0)), None, now + tick * NS // RATE)
    assert drift.anchor == known


@given(st.floats(0.02, 60.0))
def test_after_a_gap_it_does_not_leap(gap):
    drift = FrameDrift()
    drift.learn(estimate(0, OFF), own(0), 0)
    now = round(gap * NS)
    drift.learn(estimate(now, OFF), own(now), now)
    assert norm(drift.anchor.offset) <= 0.5 * norm(OFF) + 1e-9


@given(st.lists(st.tuples(*(st.floats(-0.28, 0.28),) * 3), min_size=1, max_size=100))
def test_it_is_never_more_than_what_was_seen(offs):
    drift = FrameDrift()
    for tick, off in enumerate(offs):
        now = tick * NS // RATE
        drift.learn(estimate(now, add(off, (1.0, 0.0, 0.0))), own(now, (1.0, 0.0, 0.0)), now)
    for axis, learnt in enumerate(drift.anchor.offset):
        seen = [off[axis] for off in offs]
        assert min(0.0, *seen) - 1e-9 <= learnt <= max(0.0, *seen) + 1e-9
