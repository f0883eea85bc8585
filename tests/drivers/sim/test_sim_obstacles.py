"""Obstacles are bodies in the simulator, and whoever runs into one, or another vehicle, is told."""

from __future__ import annotations

import random

import pytest
from sim_worlds import FRAME, PERIOD, QUIET, STOPPED, in_flight, push, seat, thrust, touches, world

from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS
from kybflow.drivers.sim import Sim
from kybflow.parts import Seat
from kybflow.parts.link import Touch
from kybflow.world.scanned import Columns, PointCloud
from kybflow.world.shapes import Box, Cylinder, Plane, Sphere
from kybflow.world.vehicle_context import VehicleContext

SHAPES = {
    "box": Box((0.5, -0.5, 0.0), (1.0, 0.5, 3.0)),
    "pillar": Cylinder((0.8, 0.0, 0.0), 0.3, 3.0),
    "ball": Sphere((0.8, 0.0, 1.0), 0.3),
    "wall": Plane((0.5, 0.0, 0.0), (-1.0, 0.0, 0.0)),
    "map": Columns(tuple((0.6, 0.05 * y) for y in range(-6, 7)), 0.04, 0.0, 2.0),
    "scan": PointCloud(
        tuple((0.6, 0.05 * y, 0.05 * z) for y in range(-6, 7) for z in range(10, 31)), 0.06
    ),
}


def flown_east(**obstacles):
    """A vehicle at 1 m that flies east at 1 m/s: how far it comes, and what it ran into."""
    session = Sim.open(
        [Seat(VehicleContext("a", FRAME, ZERO, 0.0, None, 0.004, None, obstacles), QUIET)],
        random.Random(1),
    )
    session.data.qpos[2], session.data.qvel[0] = 1.0, 1.0
    met, now = touches(session.links["a"]), 0
    for _ in range(200):
        session.links["a"].send(thrust(FRAME.mass * 9.81), now)
        now += PERIOD
        session.advance(now)
    return session.links["a"].truth().position[0], met


@pytest.mark.parametrize("name", SHAPES)
def test_an_obstacle_stops_a_vehicle_and_is_named(name):
    reached, met = flown_east(**{name: SHAPES[name]})
    assert reached < 0.45
    assert met == [Touch(name, carries=False)]


def test_without_an_obstacle_it_flies_past_and_meets_nothing():
    reached, met = flown_east()
    assert reached > 0.6
    assert met == []


def test_an_obstacle_stands_where_the_mission_says():
    reached, met = flown_east(far=Box((0.5, 2.0, 0.0), (1.0, 3.0, 3.0)))
    assert reached > 0.6
    assert met == []


def test_two_vehicles_that_meet_are_told_once_each():
    session = world(seat(), seat("b", (0.0, 0.45, 0.0)))
    session.data.qpos[[2, 9]] = 1.0
    session.data.qvel[1] = 1.5
    a, b = touches(session.links["a"]), touches(session.links["b"])
    for now in range(PERIOD, NS // 5, PERIOD):
        session.advance(now)
    assert (a, b) == ([Touch("b", carries=False)], [Touch("a", carries=False)])


def test_what_a_vehicle_stands_on_carries_it_and_is_told_once():
    session = world(seat(), seat("b", (1.0, 0.0, 0.6)))
    a, b = touches(session.links["a"]), touches(session.links["b"])
    push(session, session.links["b"], 1.0, thrust(8.0))
    assert (a, b) == ([Touch("the floor", carries=True)], [Touch("a stand", carries=True)])


def test_one_that_comes_back_to_the_floor_touches_it_again():
    session, link, now = in_flight()
    met = touches(link)
    push(session, link, 2.0, STOPPED, now)
    assert met == [Touch("the floor", carries=True)]
