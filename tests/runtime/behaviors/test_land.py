"""land: down to the ground wherever it is, noticed there and nowhere else."""

import random

import pytest
from flying import DT, entry, fly, point_mass, tick
from hypothesis import given, settings
from hypothesis import strategies as st

from kybflow.geometry import ZERO, distance
from kybflow.parts import GROUND, MOVING
from kybflow.runtime.behaviors.land import Land, LandParams
from kybflow.signals import Done, Setpoint, SetpointKind

IDLE = Setpoint(SetpointKind.IDLE)
START = (0.3, 0.4, 1.5)


@settings(max_examples=12)
@given(st.floats(-2.0, 1.2))
def test_it_comes_down_whatever_the_height_of_the_ground(ground: float) -> None:
    body = point_mass(START, ground)
    flown = fly(Land(LandParams(), entry(START)), body)
    assert flown.end == Done(IDLE)
    position, _ = body(None)
    assert position[2] == ground


def test_it_descends_fast_and_then_slowly() -> None:
    flown = fly(Land(LandParams(), entry(START)), point_mass(START, ground=0.0))
    high = [s.setpoint.velocity[2] for s in flown.moving if s.setpoint.position[2] > 0.8]
    low = [s.setpoint.velocity[2] for s in flown.moving if s.setpoint.position[2] < 0.39]
    assert min(high) == pytest.approx(-0.5)
    assert low == pytest.approx([-0.2] * len(low), abs=0.02)


def test_it_notices_the_ground_soon_and_asks_for_little_more() -> None:
    body = point_mass(START, ground=0.0)
    heights: list[float] = []

    def watched(setpoint: Setpoint | None):
        position, velocity = body(setpoint)
        heights.append(position[2])
        return position, velocity

    flown = fly(Land(LandParams(), entry(START)), watched)
    touched = next(i for i, z in enumerate(heights) if z == 0.0) * DT
    assert flown.duration - touched < 1.5
    assert min(s.setpoint.position[2] for s in flown.moving) >= -0.3


@pytest.mark.parametrize("push", [1.0, 3.0])
def test_an_updraught_is_no_ground(push: float) -> None:
    body = point_mass(START, ground=0.0, push=(0.0, 0.0, push))
    lowest = [9.9]

    def watched(setpoint: Setpoint | None):
        position, velocity = body(setpoint)
        lowest[0] = min(lowest[0], position[2])
        return position, velocity

    flown = fly(Land(LandParams(), entry(START)), watched)
    assert flown.end == Done(IDLE)
    assert lowest[0] == 0.0


def test_noise_in_the_height_does_not_hide_the_ground() -> None:
    generator = random.Random(1)
    body = point_mass(START, ground=0.0)

    def noisy(setpoint: Setpoint | None):
        (x, y, z), (vx, vy, vz) = body(setpoint)
        return (x, y, z + generator.gauss(0.0, 0.003)), (vx, vy, vz + generator.gauss(0.0, 0.2))

    flown = fly(Land(LandParams(), entry(START)), noisy, seconds=20.0)
    assert flown.end == Done(IDLE)


def test_on_the_ground_it_is_done_at_once() -> None:
    assert Land(LandParams(), entry(ZERO, flight=GROUND)).update(tick()) == Done(IDLE)


def test_a_lost_setpoint_in_the_air_is_no_ground() -> None:
    body = point_mass(START, ground=0.0)
    flown = fly(Land(LandParams(), entry(START, flight=MOVING)), body)
    assert flown.duration > 3.0
    assert body(None)[0][2] == 0.0


def test_it_sheds_the_velocity_of_entry_and_stays_where_that_ends() -> None:
    behavior = Land(LandParams(), entry(START, (0.6, 0.0, 0.0)))
    flown = fly(behavior, point_mass(START, ground=0.0))
    first, last = flown.moving[0].setpoint, flown.moving[-1].setpoint
    assert first.velocity[:2] == (0.6, 0.0)
    assert last.velocity[:2] == (0.0, 0.0)
    assert distance(last.position, (last.position[0], START[1], last.position[2])) == 0.0


def test_a_descent_that_was_broken_off_goes_on_as_fast_as_it_was() -> None:
    behavior = Land(LandParams(), entry(START, (0.0, 0.0, -0.4)))
    first = fly(behavior, point_mass(START, ground=0.0)).moving[0].setpoint
    assert first.velocity[2] == pytest.approx(-0.4, abs=0.01)
