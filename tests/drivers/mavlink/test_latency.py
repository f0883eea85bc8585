"""Setpoints ahead of their time."""

from __future__ import annotations

import pytest

pytest.importorskip("pymavlink")

from hypothesis import given
from hypothesis import strategies as st
from scripted_autopilot import RESTING, at

from kybflow.core.geometry import ZERO
from kybflow.core.signals import CommandKind, Setpoint, SetpointKind
from kybflow.drivers.mavlink.control.setpoints import Latency, compensated

vectors = st.tuples(*(st.floats(-3.0, 3.0),) * 3)
times = st.floats(0.0, 1.0)
STOPPED = Setpoint(SetpointKind.POSITION, (1.0, 2.0, 3.0), ZERO, ZERO, ZERO, 0.5)


def sent(setpoint, time, kind=CommandKind.POSITION):
    return compensated(at(ZERO)._replace(setpoint=setpoint, kind=kind), Latency(time, 0.3)).setpoint


def on_cubic(p, v, a, j, t):
    """A point of a motion with constant jerk, by the book."""
    place = tuple(
        p0 + v0 * t + a0 * t**2 / 2 + j0 * t**3 / 6
        for p0, v0, a0, j0 in zip(p, v, a, j, strict=True)
    )
    speed = tuple(v0 + a0 * t + j0 * t**2 / 2 for v0, a0, j0 in zip(v, a, j, strict=True))
    return place, speed, tuple(a0 + j0 * t for a0, j0 in zip(a, j, strict=True))


@given(vectors, vectors, vectors, vectors, times)
def test_it_is_the_set_point_of_that_much_later(p, v, a, j, time):
    ahead = sent(Setpoint(SetpointKind.POSITION, p, v, a, j, 0.5, 0.2), time)
    place, speed, acceleration = on_cubic(p, v, a, j, time)
    assert pytest.approx(place, abs=1e-9) == ahead.position
    assert pytest.approx(speed, abs=1e-9) == ahead.velocity
    assert pytest.approx(acceleration, abs=1e-9) == ahead.acceleration
    assert (ahead.jerk, ahead.heading, ahead.heading_rate) == (j, 0.5, 0.2)


@given(times)
def test_one_that_rests_stays_where_it_is(time):
    assert sent(STOPPED, time) == STOPPED


def test_without_a_jerk_its_acceleration_lasts():
    moving = STOPPED._replace(velocity=(1.0, 0.0, 0.0), acceleration=(0.0, 2.0, 0.0), jerk=None)
    ahead = sent(moving, 0.5)
    assert ahead.position == pytest.approx((1.5, 2.25, 3.0))
    assert ahead.velocity == pytest.approx((1.0, 1.0, 0.0))
    assert ahead.acceleration == (0.0, 2.0, 0.0)


def test_one_of_velocity_has_no_place_to_move():
    speed = Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    ahead = sent(speed, 0.2, CommandKind.VELOCITY)
    assert ahead.position is None
    assert ahead.velocity == pytest.approx((1.1, 0.0, 0.0))


def test_what_says_not_how_it_moves_is_sent_as_it_is():
    for command in (RESTING, at((1.0, 2.0, 3.0))):
        assert compensated(command, Latency(0.3, 0.3)) is command


def test_an_acceleration_alone_comes_later_by_a_time_of_its_own():
    pushed = Setpoint(SetpointKind.ACCELERATION, None, None, (0.5, 0.0, 0.1), (1.0, -2.0, 0.0))
    ahead = sent(pushed, 0.7, CommandKind.ACCELERATION)
    assert ahead.acceleration == pytest.approx((0.8, -0.6, 0.1))
    assert ahead == pushed._replace(acceleration=ahead.acceleration)


def test_an_acceleration_without_a_jerk_lasts():
    pushed = Setpoint(SetpointKind.ACCELERATION, None, None, (0.5, 0.0, 0.1))
    assert sent(pushed, 0.7, CommandKind.ACCELERATION) == pushed
