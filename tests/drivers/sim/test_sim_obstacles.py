"""Obstacles are bodies in the simulator, and whoever runs into one, or another vehicle, is told."""

from __future__ import annotations

import random

import pytest
from sim_worlds import FRAME, PERIOD, QUIET, push, seat, thrust, world

from kybflow.core.geometry import ZERO
from kybflow.core.signals import NS
from kybflow.drivers.sim import Sim
from kybflow.parts import Seat
from kybflow.world.shapes import Box, Cylinder, Plane, Sphere
from kybflow.world.vehicle_context import VehicleContext

SHAPES = {
    "box": Box((0.5, -0.5, 0.0), (1.0, 0.5, 3.0)),
    "pillar": Cylinder((0.8, 0.0, 0.0), 0.3, 3.0),
    "ball": Sphere((0.8, 0.0, 1.0), 0.3),
    "wall": Plane((0.5, 0.0, 0.0), (-1.0, 0.0, 0.0)),
}


def flown_east(**obstacles):
    """A vehicle at 1 m that flies east at 1 m/s: how far it comes, and what it ran into."""
    session = Sim.open(
        [Seat(VehicleContext("a", FRAME, ZERO, 0.0, None, 0.004, None, obstacles), QUIET)],
        random.Random(1),
    )
    session.data.qpos[2], session.data.qvel[0] = 1.0, 1.0
    met, now = [], 0
    for _ in range(200):
        session.links["a"].send(thrust(FRAME.mass * 9.81), now)
        now += PERIOD
        session.advance(now)
        met += session.links["a"].collisions()
    return session.links["a"].truth().position[0], met


@pytest.mark.parametrize("name", SHAPES)
def test_an_obstacle_stops_a_vehicle_and_is_named(name):
    reached, met = flown_east(**{name: SHAPES[name]})
    assert reached < 0.45
    assert met == [name]


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
    for now in range(PERIOD, NS // 5, PERIOD):
        session.advance(now)
    a, b = session.links["a"], session.links["b"]
    assert (list(a.collisions()), list(b.collisions())) == (["b"], ["a"])
    assert (list(a.collisions()), list(b.collisions())) == ([], [])


def test_standing_and_landing_on_the_floor_or_a_stand_is_no_collision():
    session = world(seat(at=(0.0, 0.0, 0.6)))
    push(session, session.links["a"], 1.0, thrust(8.0))
    assert list(session.links["a"].collisions()) == []
