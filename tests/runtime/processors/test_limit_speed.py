"""limit_speed: a legal trajectory is left alone, bit for bit; a fast one is not overshot."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import DT, SITE, at_rest, entry, fly, ideal, tick

from kybflow.core.geometry import ZERO, distance, norm
from kybflow.core.signals import Setpoint, SetpointKind
from kybflow.runtime.behaviors.figure_eight import FigureEight, FigureEightParams
from kybflow.runtime.processors.limit_speed import LimitSpeed, LimitSpeedParams

START = (0.0, 0.0, 1.0)


def bend(setpoints: list[Setpoint], **params: float) -> list[Setpoint]:
    processor = LimitSpeed(LimitSpeedParams(**params), SITE)
    return [processor(s, tick((i + 1) * DT)) for i, s in enumerate(setpoints)]


def steps(setpoints: list[Setpoint]) -> list[float]:
    pairs = itertools.pairwise(setpoints)
    return [distance(a.position, b.position) / DT for a, b in pairs]


def eight(lap: float) -> list[Setpoint]:
    params = FigureEightParams(width=1.46, lap=lap)
    return [s.setpoint for s in fly(FigureEight(params, entry(START)), ideal(START)).samples]


def test_a_trajectory_within_the_limit_is_the_same_object() -> None:
    asked = eight(lap=10.0)
    bent = bend(asked, speed=0.66)
    assert all(b is a for a, b in zip(asked, bent, strict=True))


@settings(max_examples=15)
@given(st.floats(4.0, 9.0), st.floats(0.2, 1.0))
def test_it_is_never_faster_than_the_limit_and_catches_up(lap: float, speed: float) -> None:
    asked = eight(lap)
    rest = [at_rest(START)] * round(20.0 / DT)
    bent = bend(asked + rest, speed=speed)
    assert max(steps(bent)) <= speed * 1.02 + 0.03
    assert max(norm(s.velocity) for s in bent) <= speed * 1.02
    assert bent[-1] is rest[-1]


@pytest.mark.parametrize("length", [0.01, 0.1, 1.0, 5.0])
def test_a_jump_becomes_a_flight_that_does_not_overshoot(length: float) -> None:
    goal = at_rest((length, 0.0, 1.0))
    bent = bend([at_rest(START)] * 2 + [goal] * round((length + 6.0) / DT))
    assert max(s.position[0] for s in bent) <= length
    assert max(steps(bent)) <= 1.0 + 0.03
    changes = [distance(b.velocity, a.velocity) / DT for a, b in itertools.pairwise(bent)]
    assert max(changes) <= 2.0 + 0.1
    assert bent[-1] is goal


def test_its_velocity_is_the_derivative_of_its_position() -> None:
    goal = at_rest((3.0, 0.0, 1.0))
    bent = bend([at_rest(START)] * 2 + [goal] * 500)
    for a, b, c in zip(bent, bent[1:], bent[2:], strict=False):
        slope = (c.position[0] - a.position[0]) / (2.0 * DT)
        assert slope == pytest.approx(b.velocity[0], abs=0.01)


def test_after_a_pause_it_goes_on_from_what_the_tracker_follows() -> None:
    processor = LimitSpeed(LimitSpeedParams(), SITE)
    processor(at_rest(START), tick(0.0))
    later = at_rest((2.0, 0.0, 1.0))
    assert processor(later, tick(9.0, setpoint=later)) is later


def test_a_velocity_is_shortened_and_keeps_its_direction() -> None:
    processor = LimitSpeed(LimitSpeedParams(speed=1.0), SITE)
    fast = Setpoint(SetpointKind.VELOCITY, None, (3.0, 4.0, 0.0), ZERO)
    slow = fast._replace(velocity=(0.3, 0.4, 0.0))
    assert processor(slow, tick()) is slow
    bent = [processor(fast, tick((i + 1) * DT, setpoint=slow)) for i in range(500)]
    assert all(s.velocity[0] == pytest.approx(0.75 * s.velocity[1]) for s in bent)
    assert bent[-1].velocity == pytest.approx((0.6, 0.8, 0.0))


def test_from_velocities_to_positions_it_goes_on_where_the_vehicle_is_asked_to_be() -> None:
    processor = LimitSpeed(LimitSpeedParams(), SITE)
    processor(at_rest(START), tick(DT))
    moving = Setpoint(SetpointKind.VELOCITY, None, (0.4, 0.0, 0.0), ZERO)
    assert processor(moving, tick(2 * DT, setpoint=at_rest(START))) is moving
    there = at_rest((1.5, 2.0, 1.0), (0.4, 0.0, 0.0))
    assert processor(there, tick(3 * DT, setpoint=moving)) is there
