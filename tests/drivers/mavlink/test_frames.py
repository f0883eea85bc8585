"""ENU and FLU against NED and FRD, and where an autopilot's own frame lies in the world."""

from __future__ import annotations

from math import cos, pi, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core import geometry as g
from kybflow.drivers.mavlink.protocol import frames as f

angles = st.floats(-3.1, 3.1)
numbers = st.floats(-50.0, 50.0)
vectors = st.tuples(numbers, numbers, numbers)
quaternions = st.builds(g.from_euler, angles, st.floats(-1.4, 1.4), angles)
anchors = st.builds(f.Anchor, vectors, angles)


def near(values, tolerance=1e-7):
    return pytest.approx(values, abs=tolerance)


def same_turn(a, b):
    return abs(sum(x * y for x, y in zip(a, b, strict=True))) == pytest.approx(1.0, abs=1e-9)


@given(vectors)
def test_vectors_come_back(v):
    assert v == f.from_ned(f.to_ned(v))
    assert v == f.from_frd(f.to_frd(v))


@given(quaternions)
def test_attitudes_come_back(q):
    assert near(q) == f.attitude_from_ned(f.attitude_to_ned(q))


@given(angles)
def test_headings_come_back(heading):
    assert near(heading) == f.heading_from_ned(f.heading_to_ned(heading))


@given(quaternions, vectors)
def test_to_turn_a_vector_and_to_convert_it_commute(q, v):
    turned = g.rotate(f.attitude_to_ned(q), f.to_frd(v))
    assert near(f.to_ned(g.rotate(q, v)), 1e-6) == turned


@given(quaternions)
def test_the_heading_of_a_converted_attitude_is_the_converted_heading(q):
    yaw = g.to_euler(f.attitude_to_ned(q))[2]
    assert near(0.0) == g.wrap(yaw - f.heading_to_ned(g.heading_of(q)))


@given(quaternions, vectors)
def test_body_rates_turn_both_attitudes_alike(q, rate):
    flown = f.attitude_to_ned(g.integrate(q, rate, 0.01))
    assert same_turn(flown, g.integrate(f.attitude_to_ned(q), f.to_frd(rate), 0.01))


def test_east_is_the_second_axis_and_north_the_first():
    assert f.to_ned((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert f.to_frd((1.0, 2.0, 3.0)) == (1.0, -2.0, -3.0)


def test_who_faces_east_has_heading_0_here_and_90_degrees_there():
    assert near(pi / 2) == f.heading_to_ned(0.0)
    assert near(g.from_heading(pi / 2)) == f.attitude_to_ned(g.LEVEL)


def test_who_faces_north_has_heading_90_degrees_here_and_0_there():
    assert near(0.0) == f.heading_to_ned(pi / 2)
    assert same_turn(g.LEVEL, f.attitude_to_ned(g.from_heading(pi / 2)))


def test_a_nose_that_rises_pitches_up_there_and_down_here():
    roll, pitch, yaw = g.to_euler(f.attitude_to_ned(g.from_euler(0.1, -0.2, 0.0)))
    assert near((0.1, 0.2, pi / 2)) == (roll, pitch, yaw)


@given(quaternions, angles)
def test_a_tilt_at_another_heading_is_the_same_tilt(q, heading):
    turned = f.with_heading(q, heading)
    assert near(g.tilt_of(q), 1e-5) == g.tilt_of(turned)
    assert near(0.0) == g.wrap(heading - g.heading_of(turned))


@given(anchors, vectors, angles, quaternions)
def test_an_anchor_leads_there_and_back(anchor, v, heading, q):
    assert near(v) == anchor.from_world(anchor.to_world(v))
    assert near(v) == anchor.unturned(anchor.turned(v))
    assert near(heading) == anchor.heading_from_world(g.wrap(heading + anchor.heading))
    assert near(q) == anchor.attitude_from_world(anchor.attitude_to_world(q))


@given(anchors, quaternions, vectors)
def test_an_anchor_turns_attitudes_as_it_turns_velocities(anchor, q, v):
    turned = g.rotate(anchor.attitude_to_world(q), v)
    assert near(anchor.turned(g.rotate(q, v)), 1e-6) == turned


@given(vectors, angles, vectors, angles)
def test_an_anchor_joins_two_places(there, heading_there, here, heading_here):
    anchor = f.Anchor.joining(there, heading_there, here, heading_here)
    assert near(here) == anchor.to_world(there)
    assert near(0.0) == g.wrap(anchor.heading_from_world(heading_here) - heading_there)


def test_an_anchor_by_hand():
    anchor = f.Anchor((1.0, 2.0, 0.5), pi / 2)
    assert near((1.0, 3.0, 0.5)) == anchor.to_world((1.0, 0.0, 0.0))
    assert near((0.0, 1.0, 0.0)) == anchor.turned((1.0, 0.0, 0.0))
    assert near(0.0) == anchor.heading_from_world(pi / 2)


tangents = [
    f.Tangent.on_ellipsoid(47.4, 8.5, 500.0),
    f.Tangent.on_sphere(-35.36, 149.165, 584.0, 6_378_100.0),
    f.Tangent.on_ellipsoid(0.0, 179.9999999, 0.0),
]


@pytest.mark.parametrize("tangent", tangents)
@given(v=vectors)
def test_places_on_earth_come_back(tangent, v):
    assert near(v, 1e-5) == tangent.local(*tangent.place(v))


def test_a_degree_of_a_sphere_is_its_radius_times_a_degree():
    tangent = f.Tangent.on_sphere(60.0, 10.0, 0.0, 6_378_100.0)
    arc = 6_378_100.0 * radians(1e-5)
    assert near((0.5 * arc, arc, 7.0), 1e-6) == tangent.local(60.00001, 10.00001, 7.0)


def test_a_degree_of_the_ellipsoid_is_as_published():
    tangent = f.Tangent.on_ellipsoid(45.0, 0.0, 0.0)
    assert pytest.approx(111_132, abs=1.0) == tangent.north
    assert pytest.approx(78_847, abs=1.0) == tangent.east


def test_lean_is_the_cosine_of_the_tilt():
    assert near(cos(0.3)) == f.lean(g.from_euler(0.3, 0.0, 1.0))
    assert f.lean(g.from_euler(pi, 0.0, 0.0)) == 0.1
