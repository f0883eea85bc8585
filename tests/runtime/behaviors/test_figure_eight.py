"""figure_eight: the paper's curve, exact derivatives, rest at both ends."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import entry, fastest, fly, ideal, worst_mismatch

from kybflow.core.geometry import ZERO
from kybflow.core.signals import Done
from kybflow.runtime.behaviors.figure_eight import FigureEight, FigureEightParams

START = (0.2, -1.0, 1.0)


def _fly(**params: float):
    behavior = FigureEight(
        FigureEightParams(**{"width": 1.46, "lap": 10.0, **params}), entry(START)
    )
    return fly(behavior, ideal(START))


def test_it_is_the_curve_and_the_speed_of_the_paper() -> None:
    flown = _fly(laps=2.0)
    east = [s.setpoint.position[0] - START[0] for s in flown.samples]
    north = [s.setpoint.position[1] - START[1] for s in flown.samples]
    assert (min(east), max(east)) == pytest.approx((-0.73, 0.73), abs=1e-4)
    assert (min(north), max(north)) == pytest.approx((-0.365, 0.365), abs=1e-4)
    assert fastest(flown.samples) == pytest.approx(0.65, abs=0.005)
    for x, y in zip(east, north, strict=True):
        assert y * y == pytest.approx(x * x * (1.0 - (x / 0.73) ** 2), abs=1e-9)


def test_it_starts_and_ends_at_rest_where_it_was_entered() -> None:
    flown = _fly(laps=2.0)
    assert isinstance(flown.end, Done)
    assert flown.samples[0].setpoint[1:5] == (START, ZERO, ZERO, ZERO)
    assert flown.end.setpoint.position == pytest.approx(START)
    assert flown.end.setpoint.velocity == pytest.approx(ZERO)
    assert flown.duration == pytest.approx(2 * 10.0 + 2.0, abs=0.01)


@settings(max_examples=15)
@given(
    st.floats(0.5, 3.0),
    st.floats(7.0, 15.0),
    st.floats(0.5, 4.0),
    st.floats(-math.pi, math.pi),
    st.floats(0.3, 2.0),
)
def test_each_field_is_the_derivative_of_the_one_before(
    width: float, lap: float, ramp: float, rotation: float, height: float
) -> None:
    flown = _fly(width=width, lap=lap, ramp=ramp, rotation=rotation, height=height)
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 1e-2
    assert worst_mismatch(flown.samples, "acceleration", "jerk") < 1.5


def test_it_turns_with_its_rotation() -> None:
    flown = _fly(rotation=math.pi / 2)
    north = [s.setpoint.position[1] - START[1] for s in flown.samples]
    assert max(north) == pytest.approx(0.73, abs=1e-4)


def test_its_footprint_bounds_what_it_flies() -> None:
    params = FigureEightParams(width=1.46, lap=10.0, rotation=0.3)
    footprint = FigureEight.footprint(params, START)
    flown = _fly(rotation=0.3)
    for axis in (0, 1):
        flown_axis = [s.setpoint.position[axis] for s in flown.samples]
        bounds = [p[axis] for p in footprint.points]
        assert min(bounds) <= min(flown_axis)
        assert max(flown_axis) <= max(bounds)
    assert footprint.speed == pytest.approx(fastest(flown.samples), rel=1e-3)
    assert footprint.exit == pytest.approx(START)
    sharpest = max(math.hypot(*s.setpoint.acceleration[:2]) for s in flown.samples)
    assert footprint.acceleration == pytest.approx(sharpest, rel=1e-2)


def test_its_footprint_ends_where_a_part_of_a_loop_does() -> None:
    params = FigureEightParams(width=1.46, lap=10.0, laps=0.25)
    assert FigureEight.footprint(params, START).exit == pytest.approx(
        _fly(laps=0.25).end.setpoint.position, abs=1e-3
    )


def test_entered_in_motion_it_has_no_step() -> None:
    behavior = FigureEight(FigureEightParams(width=1.46, lap=10.0), entry(START, (0.0, 0.5, 0.0)))
    flown = fly(behavior, ideal(START))
    assert flown.samples[0].setpoint.velocity == pytest.approx((0.0, 0.5, 0.0))
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3


@pytest.mark.parametrize(("laps", "told"), [(0.9, []), (1.0, [1.0]), (3.0, [1.0, 2.0, 3.0])])
def test_each_loop_is_told(laps: float, told: list[float]) -> None:
    flown = _fly(laps=laps)
    assert flown.told == tuple(("lap_completed", lap) for lap in told)
    assert isinstance(flown.end, Done)
