"""smooth: no step comes out, none is overshot, and what has none is left alone."""

from math import ceil, exp

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import DT, SITE, Sample, at_rest, entry, fly, ideal, tick, worst_mismatch

from kybflow.core.geometry import ZERO, distance, norm
from kybflow.core.signals import Setpoint, SetpointKind
from kybflow.runtime.behaviors.circle import Circle, CircleParams
from kybflow.runtime.behaviors.figure_eight import FigureEight, FigureEightParams
from kybflow.runtime.processors.smooth import Smooth, SmoothParams

START = (0.0, 0.0, 1.0)


def bend(setpoints: list[Setpoint], **params: float) -> list[Sample]:
    processor = Smooth(SmoothParams(**params), SITE)
    times = [(i + 1) * DT for i in range(len(setpoints))]
    return [Sample(t, processor(s, tick(t))) for t, s in zip(times, setpoints, strict=True)]


def moving(east: float, speed: float, count: int) -> list[Setpoint]:
    return [at_rest((east + speed * DT * i, 0.0, 1.0), (speed, 0.0, 0.0)) for i in range(count)]


def test_trajectories_without_a_step_are_the_same_objects() -> None:
    eight = FigureEight(FigureEightParams(width=1.46, lap=5.0), entry(START, (0.3, 0.0, 0.0)))
    circle = Circle(CircleParams(center=START, radius=0.7, laps=1.0), entry(START))
    for behavior in (eight, circle):
        asked = [s.setpoint for s in fly(behavior, ideal(START)).samples]
        assert all(b.setpoint is a for a, b in zip(asked, bend(asked), strict=True))


@settings(max_examples=12)
@given(st.floats(0.01, 3.0), st.floats(0.5, 4.0))
def test_a_jump_is_settled_in_time_without_overshoot_within_the_figures(
    length: float, settle: float
) -> None:
    goal, k = at_rest((length, 0.0, 1.0)), 7.5 / settle
    bent = bend([at_rest(START)] * 3 + [goal] * round(2.5 * settle / DT), settle=settle)
    east = [s.setpoint.position[0] for s in bent]
    assert max(east) <= length + 1e-9
    assert east == sorted(east)
    assert length - east[3 + ceil(settle / DT)] <= 0.0205 * length
    assert max(norm(s.setpoint.velocity) for s in bent) <= 0.272 * length * k
    assert max(norm(s.setpoint.acceleration) for s in bent) <= 0.232 * length * k * k
    assert max(norm(s.setpoint.jerk) for s in bent) <= length * k**3 * 1.001
    assert bent[-1].setpoint is goal


def test_its_fields_are_each_others_derivatives() -> None:
    bent = bend([at_rest(START)] * 3 + moving(0.5, 0.3, 400), settle=1.0)[4:]
    assert worst_mismatch(bent, "position", "velocity") < 2e-3
    assert worst_mismatch(bent, "velocity", "acceleration") < 2e-2
    assert worst_mismatch(bent, "acceleration", "jerk") < 0.5


def test_behind_a_moving_trajectory_no_lag_is_left() -> None:
    run = moving(0.0, 0.8, 1500)
    bent = bend([at_rest(START)] * 3 + run)
    assert max(distance(s.setpoint.position, START) for s in bent[:4]) < 1e-3
    assert bent[-1].setpoint is run[-1]


def test_the_error_dies_out_as_the_filter_says() -> None:
    bent = bend([at_rest(START)] * 3 + [at_rest((1.0, 0.0, 1.0))] * 300, settle=2.0)
    for i in (50, 150, 299):
        x = 7.5 / 2.0 * DT * i
        left = (1.0 + x + 0.5 * x * x) * exp(-x)
        assert 1.0 - bent[3 + i].setpoint.position[0] == pytest.approx(left, abs=1e-9)


def test_steps_of_velocity_setpoints_are_taken_out() -> None:
    fast = Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.0, 0.0), ZERO, heading=0.3)
    bent = bend([fast._replace(velocity=ZERO)] * 3 + [fast] * 1500)
    speeds = [s.setpoint.velocity[0] for s in bent]
    assert speeds[3] == 0.0
    assert speeds == sorted(speeds)
    assert worst_mismatch(bent[4:], "velocity", "acceleration") < 2e-2
    assert bent[-1].setpoint is fast
    assert {s.setpoint.heading for s in bent} == {0.3}


def test_after_a_pause_it_goes_on_from_what_the_tracker_follows() -> None:
    processor = Smooth(SmoothParams(), SITE)
    processor(at_rest(START), tick(0.0))
    followed, asked = at_rest((2.0, 0.0, 1.0)), at_rest((2.4, 0.0, 1.0))
    assert processor(asked, tick(9.0, setpoint=followed)).position == (2.0, 0.0, 1.0)


def test_another_kind_of_setpoint_goes_on_as_fast_as_the_last() -> None:
    processor = Smooth(SmoothParams(), SITE)
    last = at_rest(START, (0.5, 0.0, 0.0))
    processor(last, tick(0.0))
    slow = Setpoint(SetpointKind.VELOCITY, None, ZERO, ZERO)
    assert processor(slow, tick(DT, setpoint=last)).velocity == (0.5, 0.0, 0.0)
