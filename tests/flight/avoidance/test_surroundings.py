"""What is not seen any more: how large it is taken to be, and where it goes; and which objects are
kept away from, and where."""

from __future__ import annotations

import pytest
from part_bench import AIRFRAME, BLOCK, DT, WITH_BLOCK, at_rest, estimate, seen_block

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, SeenObstacle, Tick
from kybflow.flight.avoidance.surroundings import Hazard, Nearby
from kybflow.world.objects import WorldObject
from kybflow.world.shapes import MovingSphere
from kybflow.world.vehicle_context import VehicleContext

BALL = MovingSphere(((1.0, 0.0, 1.0),), 0.2, 1.0)
HERE: Vec3 = (0.0, 0.0, 1.0)
GOES_AWAY: Vec3 = (1.0, 0.0, 0.0)
COMES: Vec3 = (-1.0, 0.0, 0.0)


def found(seconds: float, velocity: Vec3) -> Hazard:
    """A ball 1 m away that was seen last so long ago, with this velocity."""
    context = VehicleContext("a", AIRFRAME, ZERO, 0.0, None, 0.01, moving={"ball": BALL})
    seen = SeenObstacle(0, (1.0, 0.0, 1.0), velocity, BALL.radius, BALL.speed)
    now, known = round(seconds * NS), estimate(HERE)
    tick = Tick(now, 0.01, 0.0, known, None, at_rest(HERE), {"a": known}, moving={"ball": seen})
    [hazard] = Nearby(context).near(HERE, 0.0, tick, lambda _: 5.0)
    return hazard


@pytest.mark.parametrize(
    ("seconds", "room"), [(0.0, 0.8), (0.1, 0.7), (0.5, 0.3), (1.0, -0.2), (9.0, -0.2)]
)
def test_it_grows_by_how_far_it_can_have_gone_for_a_second(seconds: float, room: float) -> None:
    assert found(seconds, COMES).room == pytest.approx(room)


def test_that_it_goes_away_is_believed_for_a_moment_only() -> None:
    assert [found(s, GOES_AWAY).velocity for s in (0.1, 0.3, 2.0)] == [GOES_AWAY, ZERO, ZERO]
    assert [found(s, COMES).velocity for s in (0.1, 0.3, 2.0)] == [COMES, COMES, ZERO]


FLAG = WorldObject("flag", (0.0, 0.0, 0.5), (0.1, 0.1, 0.1), 0.1, on="block")
CRATE = WorldObject("crate", (-1.0, 0.2, 1.0), (0.2, 0.2, 0.2), 1.0)
EVERY = {"block": BLOCK, "flag": FLAG, "crate": CRATE}


def objects_near(
    q: float = 0.0, speed: float = 0.0, hidden: float = 0.0, touches: str = ""
) -> dict[str, tuple[float, float]]:
    """How far each object is from a point in front of the block's start, and how fast it goes
    east."""
    nearby = Nearby(WITH_BLOCK._replace(objects=EVERY), others=())
    assert not nearby.is_empty
    now, here = round(hidden * NS), (0.0, 0.2, 1.0)
    tick = Tick(
        now, DT, 0.0, estimate(here), None, None, {}, objects=seen_block(q, speed),
        touches=touches,
    )  # fmt: skip
    found: dict[str, tuple[float, float]] = {}
    for hazard in nearby.near(here, 0.0, tick, lambda _: 5.0):
        room, _ = found.get(hazard.name, (9.0, 0.0))
        found[hazard.name] = (min(room, hazard.room), hazard.velocity[0])
    return found


def test_an_object_is_where_it_was_seen_and_its_parts_with_it() -> None:
    near = objects_near(q=0.5, speed=0.2)
    assert near["block"] == pytest.approx((1.4, 0.2))  # of its plate
    assert near["flag"] == pytest.approx(((1.45**2 + 0.45**2) ** 0.5, 0.2))
    assert near["crate"] == pytest.approx((0.9, 0.0))  # at its start


def test_a_hidden_object_grows_by_its_speed_for_a_second() -> None:
    rooms = {s: objects_near(0.5, 0.2, hidden=s)["block"] for s in (0.1, 0.5, 9.0)}
    assert rooms[0.1] == pytest.approx((1.38, 0.2))
    assert rooms[0.5] == pytest.approx((1.3, 0.0))
    assert rooms[9.0] == pytest.approx((1.2, 0.0))


@pytest.mark.parametrize("touches", ["block", "flag"])
def test_what_is_meant_to_be_touched_and_what_is_joined_with_it_is_none(touches: str) -> None:
    assert objects_near(touches=touches).keys() == {"crate"}
