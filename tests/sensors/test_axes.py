"""A tracker's units and axes to the world's."""

from __future__ import annotations

from math import inf, nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.geometry import LEVEL, Quat, Vec3, from_axes, heading_of, rotate, tilt_of
from kybflow.sensors._stream import to_world

HALF = 0.5**0.5
angles = st.floats(-pi, pi)


def world(position: Vec3, attitude: Quat, units: str, axes: str) -> tuple[Vec3, Quat]:
    pose = to_world(position, attitude, units, axes)  # type: ignore[arg-type]
    assert pose is not None
    return pose


@pytest.mark.parametrize(
    ("units", "axes", "expected"),
    [
        ("m", "z_up", (1000.0, 2000.0, 3000.0)),
        ("mm", "z_up", (1.0, 2.0, 3.0)),
        ("mm", "y_up", (1.0, -3.0, 2.0)),
    ],
)
def test_positions(units: str, axes: str, expected: Vec3) -> None:
    position, attitude = world((1000.0, 2000.0, 3000.0), LEVEL, units, axes)
    assert position == pytest.approx(expected)
    assert attitude == LEVEL


def test_a_turn_about_the_axis_that_points_up_is_a_heading() -> None:
    _, turned = world((0.0, 0.0, 0.0), (HALF, 0.0, HALF, 0.0), "m", "y_up")
    assert heading_of(turned) == pytest.approx(pi / 2)
    assert tilt_of(turned) == pytest.approx(0.0, abs=1e-6)


@given(angles, angles)
def test_what_is_fixed_to_the_body_goes_with_it(a: float, b: float) -> None:
    """A point on the body, converted, is where the converted pose puts it."""
    from kybflow.core.geometry import from_euler

    tracked, on_body = from_euler(a, b / 2, a - b), (0.1, 0.2, 0.3)
    point, _ = world(rotate(tracked, on_body), LEVEL, "m", "y_up")
    same, _ = world(on_body, LEVEL, "m", "y_up")
    _, attitude = world((0.0, 0.0, 0.0), tracked, "m", "y_up")
    assert rotate(attitude, same) == pytest.approx(point)


def test_it_is_the_quarter_turn_that_the_axes_say() -> None:
    quarter = from_axes((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        assert world(axis, LEVEL, "m", "y_up")[0] == pytest.approx(rotate(quarter, axis))


def test_the_attitude_is_made_a_rotation() -> None:
    assert world((0.0, 0.0, 0.0), (0.95, 0.0, 0.0, 0.0), "m", "z_up")[1] == LEVEL


@pytest.mark.parametrize(
    ("position", "attitude"),
    [
        ((nan, 0.0, 0.0), LEVEL),
        ((0.0, inf, 0.0), LEVEL),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (nan, 0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (inf, 0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (1e200, 1e200, 0.0, 0.0)),
    ],
)
def test_a_lost_body_is_no_pose(position: Vec3, attitude: Quat) -> None:
    assert to_world(position, attitude, "m", "z_up") is None
