"""take_off: a smooth climb from the ground it stands on, and a failure where it can't."""

from math import cos, exp

import pytest
from hypothesis import given
from hypothesis import strategies as st
from part_bench import (
    DT,
    Body,
    Flown,
    entry,
    estimate,
    fastest,
    fly,
    ideal,
    point_mass,
    tick,
    worst_mismatch,
)

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import Done, Failed, Setpoint
from kybflow.parts import GROUND
from kybflow.runtime.behaviors.take_off import TakeOff, TakeOffParams

TABLE = (1.0, 2.0, 0.7)


def test_it_climbs_to_its_height_above_the_ground_it_stands_on() -> None:
    flown = fly(TakeOff(TakeOffParams(height=1.2), entry(TABLE, flight=GROUND)), ideal(TABLE))
    assert isinstance(flown.end, Done)
    assert flown.end.setpoint.position == pytest.approx((1.0, 2.0, 1.9))
    assert flown.end.setpoint.velocity == ZERO
    assert flown.samples[0].setpoint.velocity == pytest.approx(ZERO, abs=1e-6)
    assert fastest(flown.samples) == pytest.approx(0.3)


def test_each_field_is_the_derivative_of_the_one_before() -> None:
    flown = fly(TakeOff(TakeOffParams(height=1.0), entry(TABLE, flight=GROUND)), ideal(TABLE))
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-4
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 1e-3
    assert worst_mismatch(flown.samples, "acceleration", "jerk") < 2e-2


def test_a_real_vehicle_gets_there_too() -> None:
    behavior = TakeOff(TakeOffParams(height=1.0), entry(ZERO, flight=GROUND))
    flown = fly(behavior, point_mass(ZERO, ground=0.0))
    assert isinstance(flown.end, Done)


def test_one_that_does_not_lift_is_never_asked_for_more_than_it_can_follow_and_fails() -> None:
    behavior = TakeOff(TakeOffParams(height=1.0), entry(TABLE, flight=GROUND))
    flown = fly(behavior, lambda setpoint: (TABLE, ZERO))
    assert flown.end == Failed(flown.end.setpoint, "climbed 0.00 m of 1 m")
    assert max(s.setpoint.position[2] for s in flown.samples) < 0.7 + 0.35
    assert flown.duration < 15.0


@given(st.floats(0.11, 2.0))
def test_it_goes_on_from_where_a_vehicle_is_that_was_lifted(lifted: float) -> None:
    behavior = TakeOff(TakeOffParams(height=1.0), entry(TABLE, flight=GROUND))
    output = behavior.update(tick(0.0, estimate((1.0, 2.0, 0.7 + lifted))))
    assert isinstance(output, Setpoint)
    assert output.position is not None
    asked = output.position[2] - 0.7
    assert min(lifted - 0.1, 1.0) <= asked + 1e-9
    assert asked <= min(lifted - 0.1 + 0.01, 1.0)


def test_one_that_is_a_little_ahead_changes_nothing() -> None:
    behavior = TakeOff(TakeOffParams(height=1.0), entry(TABLE, flight=GROUND))
    output = behavior.update(tick(0.0, estimate((1.0, 2.0, 0.79))))
    assert isinstance(output, Setpoint)
    assert output.position == pytest.approx(TABLE, abs=1e-6)


def test_one_that_was_lifted_is_there_sooner_and_is_never_asked_down() -> None:
    def lifted(setpoint: Setpoint | None) -> tuple[Vec3, Vec3]:
        position = TABLE if setpoint is None or setpoint.position is None else setpoint.position
        return (1.0, 2.0, max(position[2], 1.2)), ZERO

    def climb(body: Body) -> Flown:
        return fly(TakeOff(TakeOffParams(height=1.0), entry(TABLE, flight=GROUND)), body)

    sooner, usual = climb(lifted), climb(ideal(TABLE))
    assert isinstance(sooner.end, Done)
    heights = [s.setpoint.position[2] for s in sooner.samples]
    assert heights == sorted(heights)
    assert heights[-1] == pytest.approx(1.7)
    assert usual.duration - sooner.duration > 1.0


def test_one_that_passes_its_height_is_there_only_once_it_has_come_back() -> None:
    """It overshoots by 15 cm and swings back within 3 s, as an autopilot does that comes late."""
    heights = [0.15 * cos(1.2 * DT * i) * exp(-0.8 * DT * i) for i in range(9999)]
    over, passed = iter(heights), []

    def swinging(setpoint: Setpoint | None) -> tuple[Vec3, Vec3]:
        place = TABLE if setpoint is None or setpoint.position is None else setpoint.position
        if place[2] < 1.7 - 1e-6:
            return place, ZERO
        passed.append(next(over))
        return (1.0, 2.0, 1.7 + passed[-1]), ZERO

    flown = fly(TakeOff(TakeOffParams(height=1.0), entry(TABLE, flight=GROUND)), swinging)
    assert isinstance(flown.end, Done)
    assert abs(passed[-1]) <= 0.1
    assert abs(passed[-1] - passed[-2]) / DT < 0.07
