"""Where a vehicle can come down without landing on another."""

from __future__ import annotations

from dataclasses import replace
from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st
from part_bench import BLOCK, SITE, estimate, seen_block

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Estimate
from kybflow.flight.landing_place import place_beside, what_is_below
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere
from kybflow.world.vehicle_context import VehicleContext

CONTEXT = SITE._replace(objects={})
HERE = (0.0, 0.0, 1.2)
NEEDED = CONTEXT.airframe.diameter + 0.15


def fleet(**others: Vec3) -> dict[str, Estimate | None]:
    own = {CONTEXT.vehicle: estimate(HERE), "unknown": None}
    return own | {name: estimate(position) for name, position in others.items()}


def beside(context: VehicleContext, fleet: dict[str, Estimate | None], here: Vec3 = HERE):
    below = what_is_below(context, here, fleet)
    return place_beside(context, here, fleet, 0.0 if below is None else below.away)


@pytest.mark.parametrize(
    ("others", "below"),
    [
        ({}, None),
        ({"b": (0.1, 0.0, 0.0)}, "b"),
        ({"b": (0.0, NEEDED + 0.01, 0.0)}, None),
        ({"b": (0.1, 0.0, 1.3)}, None),
        ({"b": (0.2, 0.0, 0.0), "c": (0.1, 0.1, 0.5)}, "c"),
    ],
)
def test_who_is_below(others: dict[str, Vec3], below: str | None) -> None:
    found = what_is_below(CONTEXT, HERE, fleet(**others))
    assert (found and found.words) == (below and f"`{below}`")


def test_the_place_beside_is_away_from_the_one_below() -> None:
    place = beside(CONTEXT, fleet(b=(0.1, 0.0, 0.4)))
    assert place == pytest.approx((-0.25, 0.0, 1.2))


heights = st.floats(0.0, 1.1)
near = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), heights)


@given(st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), heights), st.lists(near, max_size=5))
def test_nobody_is_below_the_place_and_nobody_comes_nearer_on_the_way(
    below: Vec3, rest: list[Vec3]
) -> None:
    others = {"b": below, **{f"c{i}": at for i, at in enumerate(rest)}}
    place = beside(CONTEXT, fleet(**others))
    if place is None:
        return
    assert what_is_below(CONTEXT, place, fleet(**others)) is None
    for x, y, z in others.values():
        assert hypot(place[0] - x, place[1] - y) >= NEEDED
        now = distance(HERE, (x, y, z))
        for i in range(9):
            s = i / 8
            assert distance((s * place[0], s * place[1], 1.2), (x, y, z)) >= min(NEEDED, now) - 1e-9


def test_the_place_is_inside_the_fence_and_clear_of_obstacles() -> None:
    fence = Box((-0.4, -3.0, 0.0), (3.0, 3.0, 2.0))
    wall = Box((0.5, -3.0, 0.0), (0.6, 3.0, 2.0))
    context = CONTEXT._replace(fence=fence, obstacles={"wall": wall})
    x, y, _ = beside(context, fleet(b=(0.0, 0.1, 0.0))) or HERE
    keep = 0.5 * context.airframe.diameter + 0.2
    assert -0.4 + keep <= x <= 0.5 - keep
    assert y <= 0.1 - NEEDED


def test_in_a_cage_with_no_room_there_is_none() -> None:
    context = CONTEXT._replace(fence=Box((-0.5, -0.5, 0.0), (0.5, 0.5, 2.0)))
    assert beside(context, fleet(b=(0.0, 0.0, 0.0))) is None


TABLE = Box((-0.5, -0.5, 0.0), (0.5, 0.5, 0.6))


@pytest.mark.parametrize(
    ("shape", "at", "is_edge"),
    [
        (TABLE, (0.5, 0.0, 1.2), True),
        (TABLE, (0.7, 0.0, 1.2), True),
        (TABLE, (0.5, 0.5, 0.65), True),
        (TABLE, (0.0, 0.0, 1.2), False),
        (TABLE, (0.2, -0.2, 0.65), False),
        (TABLE, (0.8, 0.0, 1.2), False),
        (TABLE, (0.7, 0.0, 0.4), False),
        (Box((-0.5, -0.5, -0.1), (0.5, 0.5, 0.02)), (0.5, 0.0, 1.2), False),
        (Cylinder((0.0, 0.0, 0.0), 0.05, 0.8), (0.1, 0.0, 1.2), True),
        (Sphere((0.0, 0.0, 0.3), 0.3), (0.0, 0.0, 1.2), True),
        (Plane((0.0, 0.0, 0.5), (0.0, 0.0, 1.0)), (0.0, 0.0, 1.2), False),
        (Plane((0.2, 0.0, 0.0), (-1.0, 0.0, 0.0)), (0.0, 0.0, 1.2), False),
    ],
)
def test_an_edge_below_is_one_that_does_not_carry_all_of_it(
    shape: Shape, at: Vec3, is_edge: bool
) -> None:
    context = CONTEXT._replace(start=(-2.0, 0.0, 0.0), obstacles={"thing": shape})
    below = what_is_below(context, at, {})
    assert (below is not None) is is_edge
    if below is not None:
        assert (below.words, below.is_fixed) == ("an edge of `thing`", True)


def test_two_tables_side_by_side_have_no_edge_between_them() -> None:
    other = Box((0.5, -0.5, 0.0), (1.5, 0.5, 0.62))
    context = CONTEXT._replace(start=(-2.0, 0.0, 0.0), obstacles={"one": TABLE, "two": other})
    assert what_is_below(context, (0.5, 0.0, 1.2), {}) is None


def test_where_it_stood_at_its_start_there_is_no_edge() -> None:
    context = CONTEXT._replace(start=(0.5, 0.0, 0.65), obstacles={"table": TABLE})
    assert what_is_below(context, (0.55, 0.0, 1.2), {}) is None


@pytest.mark.parametrize("height", [1.2, 0.7])
@given(st.floats(-0.75, 0.75), st.floats(-0.75, 0.75))
def test_a_place_beside_an_edge_is_free_of_edges(height: float, x: float, y: float) -> None:
    context = CONTEXT._replace(start=(-2.0, 0.0, 0.0), obstacles={"table": TABLE})
    here = (x, y, height)
    if what_is_below(context, here, {}) is None:
        return
    place = beside(context, {}, here)
    assert place is not None
    assert what_is_below(context, place, {}) is None
    assert TABLE.distance((*place[:2], 0.3)) >= 0.5 * context.airframe.diameter + 0.2
    assert distance(place, here) < 1.3


@pytest.mark.parametrize("q", [0.0, 0.4])
def test_it_comes_down_beside_an_object_where_it_was_seen(q: float) -> None:
    (x, y, z), seen = BLOCK.at, seen_block(q)
    here, site = (x - 0.3 + q, y, z), SITE._replace(objects={"block": BLOCK})
    assert what_is_below(site, (x - 0.5 + q, y, z), {}, seen) is None
    below = what_is_below(site, here, {}, seen)
    assert below is not None
    assert below.words == "the object `block`"
    place = place_beside(site, here, {}, below.away, seen)
    assert place is not None
    assert place[0] < here[0]
    assert what_is_below(site, place, {}, seen) is None
    bumper = site._replace(airframe=replace(site.airframe, bumper=0.5))
    assert what_is_below(bumper, (x - 0.5 + q, y, z), {}, seen) is not None
