"""The places of shapes, and who takes which: near, and the same for everybody."""

from __future__ import annotations

import random
from itertools import permutations
from math import dist, pi

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from kybflow.core.geometry import Vec3, add, wrap
from kybflow.flight.formation.places import (
    assigned,
    centroid,
    cheapest,
    closest,
    laid,
    objection,
    places_of,
    turned_by,
)

coordinates = st.floats(-3.0, 3.0).map(lambda x: round(x, 3))
points = st.tuples(coordinates, coordinates, coordinates)
angles = st.floats(-pi, pi)


@pytest.mark.parametrize(
    ("shape", "count"),
    [("line", 1), ("line", 5), ("square", 4), ("square", 16), ("triangle", 3), ("triangle", 6),
     ("tetrahedron", 4)],
)  # fmt: skip
def test_neighbouring_places_are_a_side_apart_around_the_centre(shape: str, count: int) -> None:
    places = places_of(shape, 1.3, count)
    assert objection(shape, count) is None
    assert len(places) == count
    assert centroid(places) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    if count > 1:
        assert closest(places) == pytest.approx(1.3)


def test_all_distances_in_a_tetrahedron_are_its_side() -> None:
    places = places_of("tetrahedron", 2.0, 4)
    pairs = [dist(a, b) for a in places for b in places if a is not b]
    assert pairs == pytest.approx([2.0] * len(pairs))


@pytest.mark.parametrize(("shape", "count"), [("square", 5), ("triangle", 4), ("tetrahedron", 3)])
def test_a_shape_without_places_for_so_many_says_so(shape: str, count: int) -> None:
    assert f"not for {count}" in str(objection(shape, count))


@settings(max_examples=60, deadline=None)
@given(st.lists(points, min_size=4, max_size=4, unique=True))
def test_no_other_assignment_has_shorter_squared_ways(here: list[Vec3]) -> None:
    places = places_of("square", 1.0, 4)
    taken = assigned(here, places)

    def cost(order: tuple[int, ...]) -> float:
        return sum(dist(a, places[i]) ** 2 for a, i in zip(here, order, strict=True))

    assert sorted(taken) == [0, 1, 2, 3]
    assert cost(taken) <= min(map(cost, permutations(range(4)))) + 1e-5


def test_the_cheapest_assignment_is_that_of_scipy_also_among_equal_ones() -> None:
    draw = random.Random(1)
    for _ in range(300):
        rows, most = draw.randint(1, 12), draw.choice((1, 4, 10**6))  # the fewer, the more equal
        costs = [[draw.randint(0, most) for _ in range(rows + draw.randint(0, 3))]]
        costs += [[draw.randint(0, most) for _ in costs[0]] for _ in range(rows - 1)]
        assert cheapest(costs) == tuple(linear_sum_assignment(costs)[1])


@settings(max_examples=60, deadline=None)
@given(points, angles, angles)
def test_a_formation_in_place_is_laid_where_it_is(centre: Vec3, angle: float, head: float) -> None:
    places = places_of("triangle", 1.2, 3)
    here = [add(centre, turned_by(angle, place)) for place in places]
    found = laid(tuple(here), places, head)
    goals = [add(found.centre, turned_by(head + found.turned, places[i])) for i in found.taken]
    assert all(dist(a, b) < 1e-3 for a, b in zip(here, goals, strict=True))


@settings(max_examples=40, deadline=None)
@given(st.lists(points, min_size=3, max_size=3, unique=True), points, angles)
def test_what_is_given_is_kept(here: list[Vec3], centre: Vec3, turned: float) -> None:
    places = places_of("triangle", 1.2, 3)
    found = laid(tuple(here), places, 0.3, centre, turned)
    assert found.centre == centre
    assert wrap(found.turned - turned) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.lists(points, min_size=4, max_size=4, unique=True))
def test_on_ways_of_one_duration_no_two_meet(here: list[Vec3]) -> None:
    places = places_of("square", 1.5, 4)
    apart = min(dist(a, b) for a, b in permutations(here, 2))
    assume(apart > 0.5)
    found = laid(tuple(here), places, 0.0)
    goals = [add(found.centre, turned_by(found.turned, places[i])) for i in found.taken]
    for share in (0.25, 0.5, 0.75):
        now = [
            tuple(a + share * (b - a) for a, b in zip(p, q, strict=True))
            for p, q in zip(here, goals, strict=True)
        ]
        least = min(dist(a, b) for a, b in permutations(now, 2))
        assert least > min(apart, 1.5) / 2**0.5 - 1e-2
