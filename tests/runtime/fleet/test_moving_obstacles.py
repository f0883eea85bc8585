"""Moving obstacles: where they are, how fast they go, and that nobody sees them any more."""

from itertools import pairwise

import pytest
from part_bench import SITE

from kybflow.core.geometry import ZERO, norm, scale, sub
from kybflow.core.signals import NS, Event, SeenObstacle, Tick
from kybflow.flight.avoidance.surroundings import Nearby
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.moving_obstacles import MovingObstacles
from kybflow.world.shapes import MovingSphere
from kybflow.world.vehicle_context import VehicleContext

BALL = MovingSphere(((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0)), 0.1, 0.5)
STEP = NS // 100


def test_it_goes_there_and_back_and_stops_at_each_point() -> None:
    ramp = 0.5 / 1.5
    leg = 1.0 / 0.5 + ramp
    assert BALL.at(0.0) == (0.0, 0.0, 1.0)
    assert BALL.at(0.5 * leg) == pytest.approx((0.5, 0.0, 1.0))
    assert BALL.at(leg) == pytest.approx((1.0, 0.0, 1.0))
    assert BALL.at(1.5 * leg) == pytest.approx((1.0, 0.5, 1.0))
    assert BALL.at(2.5 * leg) == pytest.approx((1.0, 0.5, 1.0))
    assert BALL.at(4.0 * leg) == pytest.approx((0.0, 0.0, 1.0), abs=1e-9)
    assert MovingSphere(((1.0, 2.0, 3.0),), 0.1, 0.5).at(7.0) == (1.0, 2.0, 3.0)


def test_it_is_no_faster_than_told_and_never_jolts() -> None:
    places = [BALL.at(0.01 * i) for i in range(2000)]
    speeds = [scale(sub(b, a), 100.0) for a, b in pairwise(places)]
    assert max(norm(v) for v in speeds) == pytest.approx(0.5, abs=1e-6)
    assert max(norm(sub(b, a)) for a, b in pairwise(speeds)) < 0.0151


def test_its_velocity_is_that_of_late() -> None:
    moving = MovingObstacles({"ball": BALL}, Events())
    for i in range(100):
        moving.step(i * STEP)
    seen = moving.seen["ball"]
    assert seen.position == pytest.approx(BALL.at(0.99))
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
