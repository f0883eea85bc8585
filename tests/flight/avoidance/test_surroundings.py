"""What is not seen any more: how large it is taken to be, and where it goes."""

from __future__ import annotations

import pytest
from part_bench import AIRFRAME, at_rest, estimate

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, SeenObstacle, Tick
from kybflow.flight.avoidance.surroundings import Hazard, Nearby
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
