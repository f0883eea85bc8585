"""The position controller of an emulated computer learns the thrust that holds it in the air."""

from math import isclose

import pytest
from plans import NANO

from kybflow.core.geometry import GRAVITY, ZERO, body_z
from kybflow.drivers.emulation.control import PositionControl, PositionTarget, Speeds

LEVEL = PositionTarget(acceleration=(0.0, 0.0, 0.0))
SPEEDS = Speeds(1.0, 1.0, 1.0)
DT = 0.002


def acceleration_after(
    seconds: float, *, given: float, control: PositionControl | None = None
) -> float:
    """The vertical acceleration of a vehicle that is asked for none, after `seconds` in the air,
    with rotors that give the part `given` of what they should; after its take-off, unless with a
    `control` that has flown."""
    control, acceleration = control or PositionControl(NANO, 0.0), 0.0
    for _ in range(round(seconds / DT)):
        control.follow(LEVEL, ZERO, ZERO, 0.0, SPEEDS, DT)
        acceleration = given * control.thrust / NANO.mass - GRAVITY
        control.learn(1.0, acceleration, True, DT)
    return acceleration


def test_at_first_it_believes_the_airframe():
    assert isclose(acceleration_after(DT, given=0.8), -0.2 * GRAVITY, rel_tol=1e-9)


@pytest.mark.parametrize("given", [0.75, 1.2])
def test_rotors_that_give_less_or_more_are_driven_accordingly_after_some_seconds(given: float):
    assert abs(acceleration_after(5.0, given=given)) < 0.25


@pytest.mark.parametrize("given", [0.6, 1.5], ids=["a load", "without a load"])
def test_what_is_suddenly_another_is_learnt_within_a_second(given: float):
    control = PositionControl(NANO, 0.0)
    acceleration_after(20.0, given=1.0, control=control)
    left = acceleration_after(1.0, given=given, control=control)
    assert abs(left) < 0.2 * abs(1.0 - given) * GRAVITY


def test_a_floor_that_carries_it_is_not_learnt_so_soon():
    control = PositionControl(NANO, 0.0)
    acceleration_after(20.0, given=1.0, control=control)
    control.thrust = 0.5 * NANO.hover_thrust
    for _ in range(round(1.0 / DT)):
        control.learn(1.0, 0.0, False, DT)
    assert control.hover > 0.9 * NANO.hover_thrust


def test_no_integral_grows_while_the_tilt_is_at_its_bound():
    """A gust that it can't fly against for five seconds leaves nothing for later."""
    control, still = PositionControl(NANO, 0.0), PositionTarget(velocity=ZERO)
    for _ in range(round(5.0 / DT)):
        control.follow(still, ZERO, (6.0, 0.0, 0.0), 0.0, SPEEDS, DT)
    leaning = body_z(control.follow(still, ZERO, ZERO, 0.0, SPEEDS, DT).attitude)
    assert abs(leaning[0]) < 0.01


def test_what_is_learnt_stays_plausible():
    control = PositionControl(NANO, 0.0)
    for _ in range(5000):
        control.thrust = 0.0
        control.learn(1.0, 0.0, False, DT)
    assert isclose(control.hover, 0.5 * NANO.hover_thrust)


def test_what_was_learnt_outlives_a_landing():
    control = PositionControl(NANO, 0.0)
    control.thrust = 1.2 * NANO.hover_thrust
    for _ in range(2500):
        control.learn(1.0, 0.0, False, DT)
    learnt = control.hover
    control.ground(0.0)
    assert control.hover == learnt > 1.15 * NANO.hover_thrust


def test_what_no_target_controls_any_more_is_level():
    """A vehicle that has lost its position doesn't go on by what it had learnt against the wind."""
    control = PositionControl(NANO, 0.0)
    hold = PositionTarget((1.0, 0.0, None), (0.0, 0.0, None))
    for _ in range(round(2.0 / DT)):
        control.follow(hold, ZERO, ZERO, 0.0, SPEEDS, DT)
    free = PositionTarget(velocity=(None, None, 0.0))
    command = control.follow(free, ZERO, ZERO, 0.0, SPEEDS, DT)
    assert body_z(command.attitude)[2] == pytest.approx(1.0)
