"""Moving obstacles: where they are, how fast they go, and that nobody sees them any more."""

import pytest
from part_bench import SITE

from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS, Event, SeenObstacle, Tick
from kybflow.flight.avoidance.surroundings import Nearby
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.moving_obstacles import MovingObstacles
from kybflow.world.shapes import MovingSphere
from kybflow.world.vehicle_context import VehicleContext

BALL = MovingSphere(((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0)), 0.1, 0.5)
STEP = NS // 100


def test_it_goes_there_and_back() -> None:
    assert BALL.at(0.0) == (0.0, 0.0, 1.0)
    assert BALL.at(3.0) == pytest.approx((1.0, 0.5, 1.0))
    assert BALL.at(5.0) == pytest.approx((1.0, 0.5, 1.0))
    assert BALL.at(8.0) == pytest.approx((0.0, 0.0, 1.0))
    assert MovingSphere(((1.0, 2.0, 3.0),), 0.1, 0.5).at(7.0) == (1.0, 2.0, 3.0)


def test_its_velocity_is_that_of_late() -> None:
    moving = MovingObstacles({"ball": BALL}, Events())
    for i in range(100):
        moving.step(i * STEP)
    seen = moving.seen["ball"]
    assert seen.position == pytest.approx((0.495, 0.0, 1.0))
    assert seen.velocity == pytest.approx((0.5, 0.0, 0.0))


def test_one_that_is_not_seen_is_told_and_found_again() -> None:
    told: list[Event] = []
    events = Events((told.append,))
    seen = {"now": True}
    moving = MovingObstacles(
        {"ball": BALL}, events, lambda name, now: BALL.at(now / NS) if seen["now"] else None
    )
    for i in range(300):
        seen["now"] = not 100 <= i < 200
        moving.step(i * STEP)
    assert [event.name for event in told] == ["obstacle_lost", "obstacle_found"]
    assert told[0].fields == {"obstacle": "ball", "reason": "not seen for 0.5 s"}


def room(unseen: float) -> float:
    context: VehicleContext = SITE._replace(moving={"ball": BALL})
    seen = SeenObstacle(0, (1.0, 0.0, 1.0), ZERO, 0.1, 0.5)
    tick = Tick(round(unseen * NS), 0.01, 0.0, None, None, None, {}, moving={"ball": seen})
    [hazard] = Nearby(context).near((0.0, 0.0, 1.0), 0.0, tick, lambda speed: 5.0)
    return hazard.room


def test_one_that_is_not_seen_grows_by_how_far_it_can_have_gone_for_a_second() -> None:
    assert room(0.0) == pytest.approx(0.9)
    assert room(0.4) == pytest.approx(0.7)
    assert room(1.0) == room(9.0) == pytest.approx(0.4)
