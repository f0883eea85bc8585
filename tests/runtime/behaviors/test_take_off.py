"""take_off: a smooth climb from the ground it stands on, and a failure where it can't."""

import pytest
from flying import entry, fastest, fly, ideal, point_mass, worst_mismatch

from kybflow.geometry import ZERO
from kybflow.parts import GROUND
from kybflow.runtime.behaviors.take_off import TakeOff, TakeOffParams
from kybflow.signals import Done, Failed

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
