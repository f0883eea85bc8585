"""limit_acceleration: leaves a legal trajectory alone; bends a hard one and catches up."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import DT, SITE, at_rest, entry, fly, ideal, tick

from kybflow.core.geometry import ZERO, distance, norm
from kybflow.core.signals import Setpoint, SetpointKind
from kybflow.runtime.behaviors.figure_eight import FigureEight, FigureEightParams
from kybflow.runtime.behaviors.fly_to import FlyTo, FlyToParams
from kybflow.runtime.processors.limit_acceleration import (
    LimitAcceleration,
    LimitAccelerationParams,
)

START = (0.0, 0.0, 1.0)


def bend(setpoints: list[Setpoint], limit: float = 3.0) -> list[Setpoint]:
    processor = LimitAcceleration(LimitAccelerationParams(acceleration=limit), SITE)
    return [processor(s, tick((i + 1) * DT)) for i, s in enumerate(setpoints)]


def changes(setpoints: list[Setpoint]) -> list[float]:
    pairs = itertools.pairwise(setpoints)
    return [distance(a.velocity, b.velocity) / DT for a, b in pairs]


def test_trajectories_within_the_limit_are_the_same_objects() -> None:
    eight = FigureEight(FigureEightParams(width=1.46, lap=10.0, laps=2.0), entry(START))
    leg = FlyTo(FlyToParams(position=(2.0, 0.0, 1.0)), entry(START, (0.0, 0.8, 0.0)))
    for behavior in (eight, leg):
        asked = [s.setpoint for s in fly(behavior, ideal(START)).samples]
        assert all(b is a for a, b in zip(asked, bend(asked), strict=True))


@settings(max_examples=20)
@given(st.floats(0.001, 4.0), st.floats(0.5, 5.0))
def test_a_jump_is_flown_within_the_limit_and_without_overshoot(
    length: float, limit: float
) -> None:
    goal = at_rest((length, 0.0, 1.0))
    bent = bend([at_rest(START)] * 2 + [goal] * round(15.0 / DT), limit)
    assert max(changes(bent)) <= limit * (1 + 1e-6) + 0.1
    assert max(s.position[0] for s in bent) <= length + 1e-9
    assert bent[-1] is goal


def test_a_step_of_velocity_is_slewed_and_caught_up_with() -> None:
    run = [at_rest((0.8 * DT * i, 0.0, 1.0), (0.8, 0.0, 0.0)) for i in range(2500)]
    bent = bend([at_rest(START)] * 2 + run, limit=2.0)
    assert max(changes(bent)) <= 2.0 + 0.1
    assert bent[-1] is run[-1]


def test_its_fields_are_each_others_derivatives_while_it_is_behind() -> None:
    goal = at_rest((2.0, 0.0, 1.0))
    bent = bend([at_rest(START)] * 2 + [goal] * 600)
    for a, b in itertools.pairwise(bent):
        moved, changed, bent_by = (
            0.5 * (x + y) * DT
            for x, y in zip(
                (a.velocity[0], a.acceleration[0], a.jerk[0]),
                (b.velocity[0], b.acceleration[0], b.jerk[0]),
                strict=True,
            )
        )
        assert b.position[0] - a.position[0] == pytest.approx(moved, abs=1e-6)
        assert b.velocity[0] - a.velocity[0] == pytest.approx(changed, abs=1e-3)
        assert b.acceleration[0] - a.acceleration[0] == pytest.approx(bent_by, abs=0.1)


def test_a_stated_acceleration_above_the_limit_is_not_passed_on() -> None:
    hard = at_rest(START)._replace(acceleration=(9.0, 0.0, 0.0))
    assert all(norm(s.acceleration) <= 3.0 + 1e-9 for s in bend([at_rest(START)] + [hard] * 50))


def test_the_change_of_a_velocity_is_limited() -> None:
    fast = Setpoint(SetpointKind.VELOCITY, None, (1.0, 0.0, 0.0), ZERO)
    rest = fast._replace(velocity=ZERO)
    bent = bend([rest] + [fast] * 400)
    assert max(changes(bent)) <= 3.0 + 1e-9
    assert bent[-1] is fast


def test_from_velocities_to_positions_it_goes_on_where_the_vehicle_is_asked_to_be() -> None:
    processor = LimitAcceleration(LimitAccelerationParams(), SITE)
    moving = Setpoint(SetpointKind.VELOCITY, None, (0.4, 0.0, 0.0), ZERO)
    for i in range(200):
        processor(moving, tick((i + 1) * DT, setpoint=moving if i else at_rest(START)))
    there = at_rest((1.5, 2.0, 1.0), (0.4, 0.0, 0.0))
    assert processor(there, tick(201 * DT, setpoint=moving)) is there


def test_a_velocity_that_follows_a_position_begins_as_fast_as_that() -> None:
    processor = LimitAcceleration(LimitAccelerationParams(), SITE)
    last = at_rest(START, (0.4, 0.0, 0.0))
    processor(last, tick(DT))
    rest = Setpoint(SetpointKind.VELOCITY, None, ZERO, ZERO)
    bent = processor(rest, tick(2 * DT, setpoint=last))
    assert 0.4 - 3.0 * DT < bent.velocity[0] < 0.4


def test_a_new_behavior_begins_where_a_processor_behind_it_kept_the_vehicle() -> None:
    processor = LimitAcceleration(LimitAccelerationParams(acceleration=1.0), SITE)
    kept = at_rest(START)
    for i in range(1, 400):
        processor(at_rest((1.0, 0.0, 1.0)), tick(i * DT)._replace(setpoint=kept))
    begun = tick(400 * DT)._replace(setpoint=kept, elapsed=0.0)
    assert processor(kept, begun) is kept
