"""circle: led in from anywhere, round at the radius, stopped where it began."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from part_bench import entry, fastest, fly, ideal, worst_mismatch

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, Vec3, distance
from kybflow.core.signals import Done
from kybflow.runtime.behaviors.circle import Circle, CircleParams

CENTER = (0.5, 0.0, 1.2)
numbers = st.floats(-2.0, 2.0)


def _circle(start: Vec3, **params: float) -> Circle:
    return Circle(CircleParams(center=CENTER, radius=0.8, **params), entry(start))


@pytest.mark.thorough
@settings(max_examples=8)
@given(st.tuples(numbers, numbers, st.floats(0.5, 2.0)))
def test_it_keeps_its_radius_and_has_no_step_from_wherever_it_starts(start: Vec3) -> None:
    flown = fly(_circle(start, laps=1.0), ideal(start))
    assert isinstance(flown.end, Done)
    assert flown.samples[0].setpoint.position == start
    assert worst_mismatch(flown.samples, "position", "velocity") < 1e-3
    assert worst_mismatch(flown.samples, "velocity", "acceleration") < 3e-3
    assert worst_mismatch(flown.samples, "acceleration", "jerk") < 0.5
    last = flown.samples[len(flown.samples) - 500 :]
    assert [distance(s.setpoint.position, CENTER) for s in last] == pytest.approx([0.8] * 500)
    assert fastest(flown.samples) <= 0.5 + 1e-9


def test_whole_laps_end_where_they_began() -> None:
    flown = fly(_circle((1.3, 0.0, 1.2), laps=2.0), ideal(ZERO))
    assert flown.end.setpoint.position == pytest.approx((1.3, 0.0, 1.2))
    assert flown.end.setpoint.velocity == pytest.approx(ZERO)


@pytest.mark.parametrize(("speed", "north"), [(0.5, 1.0), (-0.5, -1.0)])
def test_the_sign_of_the_speed_is_its_sense(speed: float, north: float) -> None:
    flown = fly(_circle((1.3, 0.0, 1.2), speed=speed), ideal(ZERO), seconds=2.0)
    assert math.copysign(1.0, flown.samples[-1].setpoint.position[1]) == north


@pytest.mark.thorough
def test_without_laps_it_never_ends() -> None:
    assert fly(_circle((1.3, 0.0, 1.2)), ideal(ZERO), seconds=60.0).end is None


def test_from_its_centre_it_starts_ahead() -> None:
    flown = fly(_circle(CENTER, laps=1.0), ideal(CENTER))
    assert flown.end.setpoint.position == pytest.approx((1.3, 0.0, 1.2))


def test_a_circle_too_tight_for_the_tilt_limit_is_refused() -> None:
    tight = CircleParams(center=CENTER, radius=0.1, speed=0.9)
    with pytest.raises(Refused, match=r"needs 8.10 m/s\^2, the tilt limit allows 3.57"):
        Circle(tight, entry(CENTER))


def test_a_circle_without_speed_is_refused() -> None:
    with pytest.raises(Refused):
        _circle(CENTER, speed=0.0)


@pytest.mark.parametrize("speed", [0.5, -0.5])
def test_its_footprint_says_where_its_laps_end(speed: float) -> None:
    start = (1.5, 0.4, 1.0)
    params = CircleParams(center=CENTER, radius=0.8, speed=speed, laps=1.3)
    footprint = Circle.footprint(params, start)
    flown = fly(_circle(start, speed=speed, laps=1.3), ideal(start))
    assert footprint.exit == pytest.approx(flown.end.setpoint.position, abs=1e-3)
    steady = flown.samples[len(flown.samples) * 2 // 3].setpoint.acceleration
    assert footprint.acceleration == pytest.approx(math.hypot(*steady[:2]))


def test_from_its_centre_it_cannot_tell_where_its_laps_end() -> None:
    params = CircleParams(center=CENTER, radius=0.8, laps=1.0)
    assert Circle.footprint(params, CENTER).exit is None


def test_each_lap_is_told_the_last_one_with_the_end() -> None:
    flown = fly(_circle((1.3, 0.0, 1.2), laps=2.5), ideal(ZERO))
    assert flown.told == (("lap_completed", 1.0), ("lap_completed", 2.0))
    whole = fly(_circle((1.3, 0.0, 1.2), laps=3.0), ideal(ZERO))
    assert [lap for _, lap in whole.told] == [1.0, 2.0, 3.0]
    assert isinstance(whole.end, Done)
    endless = fly(_circle((1.3, 0.0, 1.2), speed=-0.8), ideal(ZERO), seconds=20.0)
    assert [lap for _, lap in endless.told] == [1.0, 2.0, 3.0]
