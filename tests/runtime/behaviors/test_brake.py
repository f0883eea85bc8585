"""brake: a bounded stop, done when the vehicle has stopped too."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import DT, entry, fly, hardest, ideal, worst_mismatch

from kybflow.core.geometry import ZERO, Vec3, distance, norm
from kybflow.core.signals import Done
from kybflow.parts import MOVING
from kybflow.runtime.behaviors.brake import Brake, BrakeParams

START = (0.0, 0.0, 1.0)
speeds = st.floats(-2.0, 2.0)


@settings(max_examples=20)
@given(st.tuples(speeds, speeds, speeds))
def test_it_stops_within_its_deceleration_and_length(velocity: Vec3) -> None:
    flown = fly(Brake(BrakeParams(), entry(START, velocity)), ideal(START), seconds=10.0)
    assert isinstance(flown.end, Done)
    assert flown.end.setpoint.velocity == ZERO
    assert hardest(flown.samples) <= 2.0 + 1e-9
    assert worst_mismatch(flown.samples, "position", "velocity") < 3e-3
    speed = norm(velocity)
    length = speed * (DT + max(0.5, 15 / 8 * speed / 2.0) / 2)
    assert distance(START, flown.end.setpoint.position) == pytest.approx(length, abs=1e-5)


def test_at_rest_it_is_done_at_once() -> None:
    flown = fly(Brake(BrakeParams(), entry(START)), ideal(START))
    assert flown.duration == 0.0


def test_it_waits_for_a_vehicle_that_still_moves_but_not_for_ever() -> None:
    body = lambda setpoint: (START, (0.3, 0.0, 0.0))  # noqa: E731
    flown = fly(Brake(BrakeParams(patience=2.0), entry(START)), body)
    assert isinstance(flown.end, Done)
    assert flown.duration == pytest.approx(2.0, abs=0.01)


def test_without_a_setpoint_it_stops_from_the_estimate() -> None:
    begun = entry(START, (0.0, 0.0, -0.5), flight=MOVING)
    first = Brake(BrakeParams(), begun)
    flown = fly(first, ideal(START, (0.0, 0.0, -0.5)))
    assert flown.samples[0].setpoint.position == START
    assert flown.samples[0].setpoint.velocity == (0.0, 0.0, -0.5)
