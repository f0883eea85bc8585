"""Shapes tell the way out of them: where their distance grows fastest."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from kybflow.core.geometry import Vec3, add, norm, scale
from kybflow.world.scanned import Columns, PointCloud
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere

SHAPES: tuple[Shape, ...] = (
    Box((-0.5, -0.3, 0.0), (0.5, 0.4, 1.0)),
    Cylinder((0.2, 0.1, 0.0), 0.3, 1.5),
    Sphere((0.0, 0.0, 1.0), 0.4),
    Plane((0.0, 0.0, 0.0), (0.6, 0.8, 0.0)),
    Columns(((0.0, 0.0), (1.2, 0.1)), 0.3, 0.2, 1.4),
    PointCloud(((0.0, 0.0, 1.0), (0.9, 0.1, 1.0), (-0.3, 0.5, 0.2)), 0.3),
)
STEP = 1e-5
places = st.tuples(*[st.floats(-2.0, 2.0)] * 3)
inside = st.tuples(st.floats(-0.2, 0.4), st.floats(-0.2, 0.3), st.floats(0.7, 1.0))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
@given(place=places)
def test_the_distance_grows_as_fast_as_one_goes(shape: Shape, place: Vec3) -> None:
    outward = shape.outward(place)
    assert norm(outward) == pytest.approx(1.0)
    grown = shape.distance(add(place, scale(outward, STEP)))
    shrunk = shape.distance(add(place, scale(outward, -STEP)))
    assume(abs(grown + shrunk - 2.0 * shape.distance(place)) < 1e-8)  # no edge in between
    assert (grown - shrunk) / (2.0 * STEP) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
@given(place=inside)
def test_it_leads_out(shape: Shape, place: Vec3) -> None:
    room = shape.distance(place)
    assume(room < 0.0)
    assert shape.distance(add(place, scale(shape.outward(place), 1e-3 - room))) > 0.0


def test_at_the_centre_of_a_ball_it_is_up() -> None:
    assert Sphere((1.0, 2.0, 3.0), 0.5).outward((1.0, 2.0, 3.0)) == (0.0, 0.0, 1.0)
