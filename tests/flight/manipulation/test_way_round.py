"""The way round objects: never nearer than asked, inside the fence, straight if possible."""

from __future__ import annotations

from itertools import pairwise
from math import hypot

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kybflow.core.geometry import Vec3
from kybflow.flight.manipulation.way_round import way_round
from kybflow.world.shapes import Box

BAR: list[Vec3] = [(x, y, 1.0) for x in (-0.02, 0.02) for y in (-0.6, 0.6)]
SOLID = Box((-0.02, -0.6, 0.0), (0.02, 0.6, 2.0))


def nearest(way: list[Vec3]) -> float:
    """How near the way comes to the bar, m."""
    found = 9.0
    for a, b in pairwise(way):
        for i in range(101):
            x, y = (p + i / 100.0 * (q - p) for p, q in zip(a[:2], b[:2], strict=True))
            found = min(found, SOLID.distance((x, y, 1.0)))
    return found


def test_it_goes_round_the_nearer_end() -> None:
    start, goal = (-0.6, 0.45, 1.0), (0.6, 0.45, 1.0)
    way = way_round(BAR, 0.5, start, goal, None)
    assert way is not None
    assert way[-1] == goal
    assert max(y for _, y, _ in way) == pytest.approx(1.12, abs=0.06)
    assert nearest([start, *way]) >= 0.5 - 1e-6


def test_it_is_straight_where_nothing_is_in_the_way() -> None:
    assert way_round(BAR, 0.5, (-1.0, 0.0, 1.0), (-1.0, 2.0, 1.2), None) == ((-1.0, 2.0, 1.2),)


def test_the_fence_decides_which_way_and_whether_there_is_one() -> None:
    start, goal = (-0.6, 0.45, 1.0), (0.6, 0.45, 1.0)
    way = way_round(BAR, 0.5, start, goal, Box((-3.0, -3.0, 0.0), (3.0, 1.0, 2.0)))
    assert way is not None
    assert min(y for _, y, _ in way) < -1.0
    assert way_round(BAR, 0.5, start, goal, Box((-3.0, -1.0, 0.0), (3.0, 1.0, 2.0))) is None


@settings(max_examples=200, deadline=None)
@given(*(st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)) for _ in range(2)))
def test_between_any_two_points_outside_it_keeps_off(
    a: tuple[float, float], b: tuple[float, float]
) -> None:
    start, goal = (*a, 1.0), (*b, 1.0)
    way = way_round(BAR, 0.4, start, goal, None)
    assert way is not None
    assert way[-1] == pytest.approx(goal)
    outside = min(SOLID.distance(p) for p in (start, goal))
    if outside > 0.44:
        assert nearest([start, *way]) >= 0.4 - 1e-6
        assert len(way) < 12
    length = sum(hypot(q[0] - p[0], q[1] - p[1]) for p, q in pairwise([start, *way]))
    assert length >= hypot(b[0] - a[0], b[1] - a[1]) - 1e-6
