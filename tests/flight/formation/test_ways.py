"""Ways to a free place: straight where nobody is in the way, else round those who are."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.geometry import ZERO, Vec3, add, distance, scale, sub
from kybflow.flight.formation.frame import WayToPlace, clear_way
from kybflow.flight.motion import Motion

START, GOAL = (-2.0, 0.0, 1.0), (2.0, 0.0, 1.0)
level = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.just(1.0))


def everywhere(start: Vec3, end: Vec3) -> bool:
    return True


def nearest(points: tuple[Vec3, ...], place: Vec3) -> float:
    legs = pairwise((START, *points))
    return min(
        distance(add(a, scale(sub(b, a), i / 200)), place) for a, b in legs for i in range(201)
    )


def test_it_is_straight_past_those_who_stand_far_enough_away() -> None:
    assert clear_way(START, GOAL, [(0.0, 0.6, 1.0)], 0.5, everywhere) == (GOAL,)


def test_it_leads_over_a_corner_beside_one_who_stands_in_it() -> None:
    found = clear_way(START, GOAL, [(0.0, 0.1, 1.0)], 0.5, everywhere)
    assert found is not None
    corner, goal = found
    assert goal == GOAL
    assert corner[1] < 0.0


def test_it_leads_over_the_other_side_where_that_one_is_not_open() -> None:
    found = clear_way(START, GOAL, [(0.0, 0.1, 1.0)], 0.5, lambda _, end: end[1] >= 0.0)
    assert found is not None
    assert found[0][1] >= 0.0


def test_there_is_none_where_nothing_is_open() -> None:
    assert clear_way(START, GOAL, [(0.0, 0.0, 1.0)], 0.5, lambda _, end: end == GOAL) is None


def test_a_place_beside_the_goal_is_passed_no_nearer_than_the_goal_is() -> None:
    taken = [(2.0, 0.3, 1.0), (0.0, 0.0, 1.0)]
    found = clear_way(START, GOAL, taken, 0.5, everywhere)
    assert found is not None
    assert nearest(found, taken[0]) >= 0.299


@given(st.lists(level, min_size=1, max_size=6))
def test_whoever_stands_there_is_passed_at_that_distance(taken: list[Vec3]) -> None:
    found = clear_way(START, GOAL, taken, 0.5, everywhere)
    for place in taken if found is not None else ():
        assert nearest(found or (), place) >= min(
            0.499, distance(START, place) - 1e-3, distance(GOAL, place) - 1e-3
        )


def test_a_way_rests_in_its_corner_and_ends_in_its_place() -> None:
    way = WayToPlace(Motion(START), ((0.0, 1.0, 1.0), GOAL), 9.0, 0.5, 0.7)
    half = way.duration / 2.0
    assert way.at(half).position == pytest.approx((0.0, 1.0, 1.0), abs=1e-6)
    assert way.at(half).velocity == pytest.approx(ZERO, abs=1e-6)
    assert way.at(way.duration).position == GOAL


def test_a_straight_way_takes_as_long_as_the_longest_of_those_who_set_out() -> None:
    assert WayToPlace(Motion(START), (GOAL,), 8.0, 0.5, 0.7).duration == pytest.approx(
        2.0 * WayToPlace(Motion(START), (GOAL,), 4.0, 0.5, 0.7).duration
    )
