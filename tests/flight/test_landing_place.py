"""Where a vehicle can come down without landing on another."""

from __future__ import annotations

from math import hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st
from part_bench import SITE as CONTEXT
from part_bench import estimate

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import Estimate
from kybflow.flight.landing_place import place_beside, vehicle_below
from kybflow.world.shapes import Box

HERE = (0.0, 0.0, 1.2)
NEEDED = CONTEXT.airframe.diameter + 0.15


def fleet(**others: Vec3) -> dict[str, Estimate | None]:
    own = {CONTEXT.vehicle: estimate(HERE), "unknown": None}
    return own | {name: estimate(position) for name, position in others.items()}


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
    assert below == vehicle_below(CONTEXT, HERE, fleet(**others))


def test_the_place_beside_is_away_from_the_one_below() -> None:
    place = place_beside(CONTEXT, HERE, fleet(b=(0.1, 0.0, 0.4)), "b")
    assert place == pytest.approx((-0.25, 0.0, 1.2))


heights = st.floats(0.0, 1.1)
near = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), heights)


@given(st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), heights), st.lists(near, max_size=5))
def test_nobody_is_below_the_place_and_nobody_comes_nearer_on_the_way(
    below: Vec3, rest: list[Vec3]
) -> None:
    others = {"b": below, **{f"c{i}": at for i, at in enumerate(rest)}}
    place = place_beside(CONTEXT, HERE, fleet(**others), "b")
    if place is None:
        return
    assert vehicle_below(CONTEXT, place, fleet(**others)) is None
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
    x, y, _ = place_beside(context, HERE, fleet(b=(0.0, 0.1, 0.0)), "b") or HERE
    keep = 0.5 * context.airframe.diameter + 0.2
    assert -0.4 + keep <= x <= 0.5 - keep
    assert y <= 0.1 - NEEDED


def test_in_a_cage_with_no_room_there_is_none() -> None:
    context = CONTEXT._replace(fence=Box((-0.5, -0.5, 0.0), (0.5, 0.5, 2.0)))
    assert place_beside(context, HERE, fleet(b=(0.0, 0.0, 0.0)), "b") is None
