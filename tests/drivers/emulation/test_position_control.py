"""The position controller of an emulated computer learns the thrust that holds it in the air."""

from math import isclose

from plans import NANO

from kybflow.core.geometry import GRAVITY, ZERO
from kybflow.drivers.emulation.control import PositionControl, PositionTarget, Speeds

LEVEL = PositionTarget(acceleration=(0.0, 0.0, 0.0))
SPEEDS = Speeds(1.0, 1.0, 1.0)
DT = 0.002


def acceleration_after(seconds: float, *, given: float) -> float:
    """The vertical acceleration of a vehicle that is asked for none, `seconds` after take-off, with
    rotors that give the part `given` of what they should."""
    control, acceleration = PositionControl(NANO, 0.0), 0.0
    for _ in range(round(seconds / DT)):
        control.follow(LEVEL, ZERO, ZERO, 0.0, SPEEDS, DT)
        acceleration = given * control.thrust / NANO.mass - GRAVITY
        control.learn(1.0, acceleration, DT)
    return acceleration


def test_at_first_it_believes_the_airframe():
    assert isclose(acceleration_after(DT, given=0.8), -0.2 * GRAVITY, rel_tol=1e-9)


def test_rotors_that_give_less_are_driven_harder_after_some_seconds():
    assert abs(acceleration_after(5.0, given=0.75)) < 0.25


def test_rotors_that_give_more_are_driven_less():
    assert abs(acceleration_after(5.0, given=1.2)) < 0.25


def test_what_is_learnt_stays_plausible():
    control = PositionControl(NANO, 0.0)
    for _ in range(5000):
        control.thrust = 0.0
        control.learn(1.0, 0.0, DT)
    assert isclose(control.hover, 0.5 * NANO.hover_thrust)


def test_what_was_learnt_outlives_a_landing():
    control = PositionControl(NANO, 0.0)
    control.thrust = 1.2 * NANO.hover_thrust
    for _ in range(2500):
        control.learn(1.0, 0.0, DT)
    learnt = control.hover
    control.ground(0.0)
    assert control.hover == learnt > 1.15 * NANO.hover_thrust
