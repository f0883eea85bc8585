"""Distances between paths and obstacles."""

from __future__ import annotations

from itertools import pairwise
from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.dsl.checks.obstacles import nearest, path_of
from kybflow.parts import Footprint
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere

SHAPES: tuple[Shape, ...] = (
    Box((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0)),
    Cylinder((0.5, 0.0, 0.0), 0.3, 2.0),
    Sphere((0.0, 0.5, 1.0), 0.4),
    Plane((2.0, 0.0, 0.0), (-1.0, 0.0, 0.0)),
)
points = st.tuples(*(st.floats(-3.0, 3.0) for _ in range(3)))


def test_a_line_past_a_pole_is_nearest_in_its_middle() -> None:
    pole = Cylinder((1.0, 0.5, 0.0), 0.1, 2.0)
    room, point = nearest(((0.0, 0.0, 1.0), (2.0, 0.0, 1.0)), pole, 1.0)
    assert room == pytest.approx(0.4)
    assert point == pytest.approx((1.0, 0.0, 1.0), abs=1e-6)


def test_a_line_through_a_ball_is_inside() -> None:
    path = ((0.0, 0.0, 1.0), (4.0, 0.0, 1.0))
    assert nearest(path, Sphere((2.0, 0.0, 1.0), 0.5), 0.2)[0] == pytest.approx(-0.5)


@given(st.lists(points, min_size=2, max_size=4), st.sampled_from(SHAPES), st.floats(0.0, 1.0))
def test_no_point_of_the_path_is_nearer(path, shape, part) -> None:
    room = nearest(tuple(path), shape, 1.0)[0]
    for a, b in pairwise(path):
        point = tuple(p + part * (q - p) for p, q in zip(a, b, strict=True))
        assert min(shape.distance(point), 1.0) >= min(room, 1.0) - 1e-6


def test_two_points_are_a_path_and_more_are_bounds() -> None:
    ends = ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0))
    assert path_of(Footprint(ends, 1.0, None)) == ends
    assert path_of(Footprint((*ends, (0.0, 1.0, 1.0)), 1.0, None)) == ()
    assert path_of(Footprint((), 1.0, None, path=ends)) == ends


@pytest.mark.parametrize("name", ["circle", "figure_eight"])
def test_a_path_stays_within_its_bounds(name: str) -> None:
    from kybflow.parts.catalog import load_catalog

    spec = load_catalog().get("behaviors", name)
    own = {
        "circle": {"center": (1.0, 0.0, 1.0), "radius": 0.8, "laps": 0.5},
        "figure_eight": {"width": 1.6, "lap": 10.0},
    }[name]
    footprint = spec.cls.footprint(spec.params(**own), (0.0, 0.5, 1.0))
    for axis in range(3):
        low, high = (end(p[axis] for p in footprint.points) for end in (min, max))
        assert all(low - 1e-9 <= p[axis] <= high + 1e-9 for p in footprint.path)
    chords = pairwise(footprint.path[1:])
    longest = max(hypot(a[0] - b[0], a[1] - b[1]) for a, b in chords)
    assert longest < 0.12
    assert len(footprint.path) > 2
