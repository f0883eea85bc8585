"""Rotations against their definitions."""

from math import acos, cos, isclose, pi, sin

from hypothesis import given
from hypothesis import strategies as st

from kybflow.core import geometry as g

angles = st.floats(-3.1, 3.1)
small = st.floats(-1.4, 1.4)
numbers = st.floats(-10.0, 10.0)
vectors = st.tuples(numbers, numbers, numbers)
quaternions = st.builds(g.from_euler, angles, small, angles)


def near(a, b, tolerance=1e-9):
    return all(isclose(x, y, abs_tol=tolerance) for x, y in zip(a, b, strict=True))


def same_rotation(a, b):
    return near(a, b, 1e-7) or near(a, tuple(-x for x in b), 1e-7)


@given(quaternions, vectors)
def test_turning_there_and_back_is_nothing(q, v):
    assert near(v, g.rotate(g.conjugate(q), g.rotate(q, v)), 1e-8)


@given(quaternions, vectors)
def test_a_rotation_is_the_conjugation_by_its_quaternion(q, v):
    product = g.multiply(g.multiply(q, (0.0, *v)), g.conjugate(q))
    assert near(product[1:], g.rotate(q, v), 1e-8)


@given(quaternions, quaternions, vectors)
def test_a_product_turns_first_by_its_second_factor(a, b, v):
    assert near(g.rotate(a, g.rotate(b, v)), g.rotate(g.multiply(a, b), v), 1e-7)


@given(angles, small, angles)
def test_euler_angles_come_back(roll, pitch, yaw):
    assert near((roll, pitch, yaw), g.to_euler(g.from_euler(roll, pitch, yaw)), 1e-6)


def test_a_quarter_turn_left_takes_east_to_north():
    q = g.from_heading(pi / 2)
    assert near((0.0, 1.0, 0.0), g.rotate(q, (1.0, 0.0, 0.0)))
    assert isclose(pi / 2, g.heading_of(q))


def test_positive_pitch_lowers_the_nose_and_positive_roll_the_right_side():
    assert g.rotate(g.from_euler(0.0, 0.1, 0.0), (1.0, 0.0, 0.0))[2] < 0.0
    assert g.rotate(g.from_euler(0.1, 0.0, 0.0), (0.0, -1.0, 0.0))[2] < 0.0


@given(quaternions)
def test_body_z_and_tilt_are_where_thrust_points(q):
    up = g.rotate(q, (0.0, 0.0, 1.0))
    assert near(up, g.body_z(q))
    assert isclose(acos(max(-1.0, min(1.0, up[2]))), g.tilt_of(q), abs_tol=1e-6)


@given(numbers, numbers, st.floats(0.1, 10.0), angles)
def test_thrust_points_as_asked_and_the_heading_is_kept(x, y, z, heading):
    q = g.from_thrust_direction((x, y, z), heading)
    n = g.norm((x, y, z))
    assert near((x / n, y / n, z / n), g.body_z(q), 1e-7)
    left = g.rotate(q, (0.0, 1.0, 0.0))
    assert isclose(0.0, left[0] * cos(heading) + left[1] * sin(heading), abs_tol=1e-7)


@given(quaternions)
def test_axes_make_the_rotation_that_they_are(q):
    axes = [g.rotate(q, axis) for axis in ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0))]
    assert same_rotation(q, g.from_axes(*axes))


def test_integrating_a_rate_turns_by_rate_times_time():
    q = g.LEVEL
    for _ in range(1000):
        q = g.integrate(q, (0.0, 0.0, 1.0), 0.001)
    assert isclose(1.0, g.heading_of(q), abs_tol=1e-6)


@given(st.floats(-1000.0, 1000.0))
def test_wrapped_angles_are_the_same_angle(angle):
    wrapped = g.wrap(angle)
    assert -pi <= wrapped <= pi
    assert isclose(sin(angle), sin(wrapped), abs_tol=1e-9)


@given(vectors, vectors)
def test_the_least_distance_is_that_of_the_nearest_point_on_the_way(before, after):
    least = g.least_distance(before, after)
    way = g.sub(after, before)
    along = [g.norm(g.add(before, g.scale(way, i / 100))) for i in range(101)]
    assert least <= min(along) + 1e-9
    assert min(along) <= least + g.norm(way) / 200 + 1e-9
