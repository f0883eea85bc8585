"""fly_to: stops at the goal whatever the distance, within its limits."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import (
    AIRFRAME,
    DT,
    entry,
    estimate,
    fastest,
    fly,
    hardest,
    ideal,
    tick,
    worst_mismatch,
)

from kybflow.core.geometry import ZERO, Vec3, from_heading, norm
from kybflow.core.signals import Done, Failed, Setpoint
from kybflow.flight.motion import Pace
from kybflow.parts import Footprint
from kybflow.runtime.behaviors.fly_to import FlyTo, FlyToParams

START = (0.0, 0.0, 1.0)
numbers = st.floats(-3.0, 3.0)
points = st.tuples(numbers, numbers, numbers)


@pytest.mark.thorough
@settings(max_examples=40)
@given(points, st.floats(0.2, 2.0), st.floats(0.3, 2.0))
def test_it_stops_at_its_goal_within_its_limits(
    goal: Vec3, speed: float, acceleration: float
) -> None:
    params = FlyToParams(position=goal, speed=speed, acceleration=acceleration)
    flown = fly(FlyTo(params, entry(START)), ideal(START))
    assert isinstance(flown.end, Done)
    assert flown.end.setpoint[1:5] == (goal, ZERO, ZERO, ZERO)
    assert fastest(flown.samples) <= min(speed, 0.95 * AIRFRAME.speed) + 1e-9
    assert hardest(flown.samples) <= acceleration + 1e-9


@pytest.mark.parametrize("length", [0.0, 1e-9, 1e-3, 0.05, 0.5, 2.0, 6.0])
def test_no_distance_is_too_short(length: float) -> None:
    flown = fly(FlyTo(FlyToParams(position=(length, 0.0, 1.0)), entry(START)), ideal(START))
    assert isinstance(flown.end, Done)
    assert max(s.setpoint.position[0] for s in flown.samples) <= length


@settings(max_examples=20)
@given(points, st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.just(0.0)))
def test_entered_in_motion_it_has_no_step(goal: Vec3, velocity: Vec3) -> None:
    flown = fly(FlyTo(FlyToParams(position=goal), entry(START, velocity)), ideal(START))
    assert flown.samples[0].setpoint.velocity == pytest.approx(velocity, abs=1e-5)
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 3e-2
    assert isinstance(flown.end, Done)
    assert flown.end.setpoint.position == goal
    assert fastest(flown.samples) <= max(norm(velocity), 0.95) * 1.01


def test_two_metres_aside_take_less_than_five_seconds_and_stay_under_the_limit() -> None:
    flown = fly(FlyTo(FlyToParams(position=(2.0, 0.0, 1.0)), entry(START)), ideal(START))
    assert flown.duration < 5.0
    assert fastest(flown.samples) < 0.9


def test_it_turns_to_its_heading_by_the_shorter_way() -> None:
    params = FlyToParams(position=START, heading=math.radians(-170.0))
    begun = entry(START)
    turned = begun._replace(setpoint=begun.setpoint._replace(heading=math.radians(170.0)))
    flown = fly(FlyTo(params, turned), ideal(START))
    headings = [s.setpoint.heading for s in flown.samples]
    rates = [s.setpoint.heading_rate for s in flown.samples]
    assert headings[-1] == pytest.approx(math.radians(190.0))
    assert min(headings) == pytest.approx(math.radians(170.0))
    slopes = [(b - a) / (2 * DT) for a, b in zip(headings, headings[2:], strict=False)]
    assert slopes == pytest.approx(rates[1:-1], abs=1e-3)


def test_a_vehicle_that_does_not_arrive_fails_with_the_distance() -> None:
    params = FlyToParams(position=(1.0, 0.0, 1.0), patience=1.0)
    flown = fly(FlyTo(params, entry(START)), lambda setpoint: ((0.9, 0.0, 1.0), ZERO))
    assert flown.end == Failed(flown.end.setpoint, "still 0.100 m from the goal")


def test_its_footprint_is_the_straight_line() -> None:
    print_ = FlyTo.footprint(FlyToParams(position=(1.0, 0.0, 1.0)), START)
    way = (START, (1.0, 0.0, 1.0))
    goals = ((way[-1], 0.02),)
    assert print_ == Footprint(way, 1.0, way[-1], duration=print_.duration, goals=goals)


def facing(degrees: float):
    """A vehicle at the goal that looks there, whatever it is asked for."""
    attitude = from_heading(math.radians(degrees))

    def seen(behavior: FlyTo, seconds: float) -> Setpoint | Done | Failed:
        output = None
        for i in range(round(seconds / DT)):
            known = estimate(START)._replace(attitude=attitude)
            output = behavior.update(tick(i * DT, known))
            if isinstance(output, Done | Failed):
                break
        return output

    return seen


def test_with_a_heading_tolerance_it_is_there_when_it_looks_there_too() -> None:
    params = FlyToParams(position=START, heading=0.5, heading_tolerance=0.1, patience=1.0)
    assert isinstance(facing(math.degrees(0.45))(FlyTo(params, entry(START)), 5.0), Done)
    failed = facing(0.0)(FlyTo(params, entry(START)), 5.0)
    assert isinstance(failed, Failed)
    assert failed.reason == "still 0.000 m from the goal and 28.6 deg from the heading"
    any_heading = FlyToParams(position=START, heading=0.5)
    assert isinstance(facing(0.0)(FlyTo(any_heading, entry(START)), 5.0), Done)


@settings(max_examples=20)
@given(points, st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.just(0.0)))
def test_it_keeps_another_pace_from_its_second_update_on(goal: Vec3, velocity: Vec3) -> None:
    behavior = FlyTo(FlyToParams(position=goal), entry(START, velocity))
    assert behavior.pace is not None
    pace = Pace(behavior.pace.cruise + 4.0, behavior.pace.ramp + 1.0)
    behavior.keep(pace)

    flown = fly(behavior, ideal(START))

    assert isinstance(flown.end, Done)
    assert flown.end.setpoint.position == goal
    assert len(flown.samples) * DT == pytest.approx(pace.duration + 0.3, abs=0.05)
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3
