"""Going round an object: to the front of a surface behind it, off the object all the way."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest
from part_bench import BLOCK, DT, SITE, entry, estimate, seen_block

from kybflow.core.geometry import Vec3, distance
from kybflow.core.signals import NO_OBJECTS, NS, Done, Failed, SeenObjects, Setpoint, Tick
from kybflow.runtime.behaviors.go_round import GoRound, GoRoundParams
from kybflow.world.objects import Placement, distance_to
from kybflow.world.shapes import Box

REACH = 0.12
CONTEXT = SITE._replace(
    airframe=replace(SITE.airframe, bumper=REACH), objects={"block": BLOCK}, fence=None
)
BEHIND: Vec3 = (BLOCK.at[0] + 0.8, BLOCK.at[1], 1.0)
PARAMS = GoRoundParams(surface="block.back", keep=0.2)


def tick(time: float, position: Vec3, seen: SeenObjects) -> Tick:
    now = round(time * NS)
    return Tick(now, DT, time, estimate(position, now=now), None, None, {}, objects=seen)


def flown(behavior: GoRound, moved_by: float = 0.0) -> tuple[list[Vec3], Done | Failed]:
    """Follow the setpoints exactly until it ends. moved_by: how far somebody moves the block after
    two seconds."""
    position, places, last = BEHIND, list[Vec3](), None
    for i in range(round(60.0 / DT)):
        q = moved_by if i * DT > 2.0 else 0.0
        seen = seen_block(q, 0.0, round(i * DT * NS))
        out = behavior.update(tick(i * DT, position, seen)._replace(setpoint=last))
        if isinstance(out, Done | Failed):
            return places, out
        assert isinstance(out, Setpoint)
        assert out.position is not None
        position, last = out.position, out
        places.append(position)
    raise AssertionError("it never ends")


def test_it_ends_in_front_of_the_surface_and_keeps_off_all_the_way() -> None:
    places, out = flown(GoRound(PARAMS, entry(BEHIND, context=CONTEXT)))
    assert isinstance(out, Done)
    here = Placement(BLOCK.at, (1.0, 0.0, 0.0, 0.0))
    level = ((x, y, BLOCK.at[2]) for x, y, _ in places)
    assert min(distance_to(BLOCK, here, p) for p in level) > REACH + 0.2 - 1e-6
    assert places[-1][0] < BLOCK.at[0]
    assert out.setpoint.heading == pytest.approx(0.0)
    assert max(distance(a, b) for a, b in pairwise(places)) <= PARAMS.speed * DT + 1e-9


def test_it_plans_anew_if_the_object_is_moved() -> None:
    moved, _ = flown(GoRound(PARAMS, entry(BEHIND, context=CONTEXT)), moved_by=-0.4)
    still, _ = flown(GoRound(PARAMS, entry(BEHIND, context=CONTEXT)))
    assert moved[-1] == pytest.approx((still[-1][0] - 0.4, *still[-1][1:]))
    assert max(distance(a, b) for a, b in pairwise(moved)) <= 1.2 * PARAMS.speed * DT


def test_it_fails_where_the_object_is_not_seen_or_the_fence_leaves_no_way() -> None:
    unseen = GoRound(PARAMS, entry(BEHIND, context=CONTEXT)).update(tick(0.0, BEHIND, NO_OBJECTS))
    assert isinstance(unseen, Failed)
    assert unseen.reason == "`block` has not been seen"
    x, y, _ = BLOCK.at
    alley = CONTEXT._replace(fence=Box((x - 2.0, y - 0.3, 0.0), (x + 2.0, y + 0.3, 2.0)))
    out = GoRound(PARAMS, entry(BEHIND, context=alley)).update(tick(0.0, BEHIND, seen_block()))
    assert isinstance(out, Failed)
    assert out.reason == "the fence leaves no way round the object"
