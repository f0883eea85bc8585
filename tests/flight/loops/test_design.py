"""Gains that follow from the loop that answers them."""

from __future__ import annotations

from dataclasses import replace
from math import cos, radians, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plans import NANO

from kybflow.drivers.sim import Sim, SimParams
from kybflow.flight.geometric_law import GeometricParams, outer_loop
from kybflow.flight.loops.margins import Margins, margins
from kybflow.flight.loops.position_loop import (
    FASTEST,
    LEAST,
    PLANNED,
    OuterLoop,
    Stiffness,
    designed,
    holds,
    horizontal,
    margins_of,
    on_board,
    quickest_observer,
    shaped,
    stiffness,
    vertical,
)
from kybflow.world.vehicle_context import Airframe, InnerLoop, attitude_loop

MK = Airframe(
    mass=1.05, diameter=0.5, inertia=(0.011, 0.011, 0.02), thrust=6.0, rotor_time=0.05, drag=0.25
)  # fmt: skip
AS_PX4 = replace(MK, rotor_time=0.025, attitude_gain=6.5, rate_gain=18.0)
LAW = OuterLoop(*FASTEST, 2.0, 0.25, 0.004)
LAB = SimParams(calm=False)


def with_gains(gains: tuple[float, float, float], law: OuterLoop = LAW) -> OuterLoop:
    k, d, i = gains
    return law._replace(proportional=k, derivative=d, integral=i)


def inner(**facts) -> InnerLoop:
    return Sim.inner_loop(replace(LAB, **facts), MK)


@pytest.mark.parametrize("frame", [MK, NANO])
def test_on_a_fast_loop_they_are_the_fastest(frame: Airframe) -> None:
    assert designed(LAW, Sim.inner_loop(SimParams(calm=True), frame)) == FASTEST == (16.0, 9.0, 8.0)


@pytest.mark.parametrize("frame", [MK, NANO])
def test_in_a_lab_they_stay_near_them(frame: Airframe) -> None:
    k, d, i = designed(LAW, Sim.inner_loop(LAB, frame))
    assert 9.0 <= k <= 16.0
    assert (d, i) == pytest.approx((2.25 * k**0.5, k / 2.0))


def test_on_a_loop_as_slow_as_px4s_they_are_lower_and_hold() -> None:
    slow = Sim.inner_loop(LAB, AS_PX4)
    assert not holds(margins_of(LAW, slow), LEAST), "the fastest would oscillate"
    gains = designed(LAW, slow)
    assert 4.0 <= gains[0] <= 9.0
    assert holds(margins_of(with_gains(gains), slow), PLANNED)


@given(
    st.floats(0.01, 0.06), st.none() | st.floats(4.0, 20.0), st.floats(0.0, 0.05),
    st.floats(0.005, 0.06), st.sampled_from([50, 100, 250]),
)  # fmt: skip
@settings(max_examples=40)
def test_what_is_designed_holds_and_a_tenth_more_does_not(rotor, attitude, late, age, rate):
    loop = attitude_loop(rotor, attitude, None)
    here = InnerLoop(loop, rotor, 50.0, 0.006, late, age)
    law = LAW._replace(period=1.0 / rate)
    gains = designed(law, here)
    frequency = gains[0] ** 0.5
    if frequency > 1.0:
        assert holds(margins_of(with_gains(gains, law), here), PLANNED)
    if frequency < 4.0:
        faster = shaped(frequency + 0.1)
        assert not holds(margins_of(with_gains(faster, law), here), PLANNED)


@pytest.mark.parametrize("late", ["command_latency", "mocap_latency", "dead_time"])
def test_what_comes_later_gets_lower_gains(late: str) -> None:
    seconds = [0.01, 0.02, 0.04]
    gains = [designed(LAW, inner(**{late: s}))[0] for s in seconds]
    assert gains == sorted(gains, reverse=True)
    assert gains[0] > gains[-1]


def test_a_delay_of_commands_is_what_the_delay_margin_says() -> None:
    """The least delay margin, on top of the commands' delay, leaves no phase."""
    before = margins_of(LAW, inner())
    late = inner(command_latency=LAB.command_latency + 0.98 * before.delay)
    after = margins_of(LAW, late)
    assert 0.0 < after.delay < 0.1 * before.delay
    gone = inner(command_latency=LAB.command_latency + 1.02 * before.delay)
    assert not holds(margins_of(LAW, gone), LEAST)


def test_an_observer_may_be_as_quick_as_the_margins_allow() -> None:
    late = inner(command_latency=0.04)
    law = with_gains(designed(LAW, late))
    quickest = quickest_observer(law._replace(observer=20.0), late)
    assert 2.0 < quickest < 20.0
    assert holds(margins_of(law._replace(observer=quickest), late), PLANNED)
    assert not holds(margins_of(law._replace(observer=quickest + 0.1), late), PLANNED)
    assert quickest_observer(LAW, inner(mocap_latency=0.1)) == 0.0, "none mends these gains"


def test_gains_that_are_given_stay() -> None:
    slow = Sim.inner_loop(LAB, AS_PX4)
    given = GeometricParams(proportional=20.0, derivative=10.0, integral=1.0)
    assert outer_loop(given, MK, slow, 0.004)[:3] == (20.0, 10.0, 1.0)
    part = outer_loop(GeometricParams(integral=1.0), AS_PX4, slow, 0.004)
    free = outer_loop(GeometricParams(), AS_PX4, slow, 0.004)
    assert part[:3] == (free.proportional, free.derivative, 1.0)


def test_without_a_declared_loop_they_are_the_fastest() -> None:
    assert outer_loop(GeometricParams(), MK, None, 0.004)[:3] == FASTEST


SOFT, STIFF, UP = 5.0, 14.0, 8.0


def with_matrix(matrix) -> OuterLoop:
    return LAW._replace(stiffness=stiffness(matrix))


def test_a_matrix_leaves_the_smallest_margins_of_its_directions() -> None:
    apart = ((SOFT, 0.0, 0.0), (0.0, STIFF, 0.0), (0.0, 0.0, UP))
    soft, stiff, up = (LAW._replace(proportional=k) for k in (SOFT, STIFF, UP))
    ways = (horizontal(soft, inner()), horizontal(stiff, inner()), vertical(up, inner()))
    found = [margins(way) for way in ways]
    assert margins_of(with_matrix(apart), inner()) == tuple(map(min, *found))
    assert len(set(found)) == 3


@given(st.floats(-3.2, 3.2))
@settings(max_examples=10)
def test_they_are_the_same_however_it_is_turned_about_the_vertical(angle: float) -> None:
    mean, half = 0.5 * (SOFT + STIFF), 0.5 * (STIFF - SOFT)
    c, s = half * cos(2.0 * angle), half * sin(2.0 * angle)
    turned = ((mean + c, s, 0.0), (s, mean - c, 0.0), (0.0, 0.0, UP))
    assert stiffness(turned).level == pytest.approx((SOFT, STIFF))
    apart = LAW._replace(stiffness=Stiffness((SOFT, STIFF), (UP,)))
    assert margins_of(with_matrix(turned), inner()) == pytest.approx(margins_of(apart, inner()))


def test_the_same_gain_in_every_direction_leaves_the_margins_of_that_gain() -> None:
    alike = ((SOFT, 0.0, 0.0), (0.0, SOFT, 0.0), (0.0, 0.0, SOFT))
    assert margins_of(with_matrix(alike), inner()) == margins_of(
        LAW._replace(proportional=SOFT), inner()
    )


def test_a_matrix_that_couples_the_height_says_so() -> None:
    found = stiffness(((9.0, 0.0, 2.0), (0.0, 9.0, 0.0), (2.0, 0.0, 9.0)))
    assert found.is_coupled
    assert found.level == found.up == pytest.approx((7.0, 9.0, 11.0))


def test_the_design_is_the_same_whatever_matrix_is_written() -> None:
    weak = with_matrix(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    assert designed(weak, inner()) == designed(LAW, inner())


@pytest.mark.parametrize("rotor_time", [0.003, 0.005, 0.008, 0.012, 0.02, 0.03, 0.06])
def test_the_loop_of_an_airframe_without_gains_suits_the_lab(rotor_time: float) -> None:
    """However fast its rotors are: its gyroscope and its dead time stay as slow."""
    frame = replace(MK, rotor_time=rotor_time)
    inner = Sim.inner_loop(LAB, frame)
    assert holds(margins(on_board(LAW, inner)), Margins(2.0, radians(30.0), 0.005))
    assert holds(margins_of(outer_loop(GeometricParams(), frame, inner, 0.008), inner), PLANNED)
