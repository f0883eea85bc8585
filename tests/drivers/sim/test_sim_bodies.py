"""Obstacles and parcels are bodies in the simulator, and whoever runs into one, or another vehicle,
is told."""

from __future__ import annotations

import random

import pytest
from sim_worlds import (
    FRAME,
    PERIOD,
    QUIET,
    STOPPED,
    in_flight,
    opened,
    push,
    seat,
    thrust,
    touches,
    world,
)

from kybflow.core.errors import Refused
from kybflow.core.geometry import ZERO, sub
from kybflow.core.signals import NS, Payload
from kybflow.drivers.sim import Sim
from kybflow.drivers.sim.model import loaded
from kybflow.parts import Seat
from kybflow.parts.link import Touch
from kybflow.world.scanned import Columns, PointCloud
from kybflow.world.shapes import Box, Cylinder, Plane, Sphere
from kybflow.world.vehicle_context import Parcel, VehicleContext

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


SMALL, LEVEL_BOX = Parcel(mass=0.2, size=0.06), Parcel(mass=0.2, size=0.1)


def carrying(parcel=SMALL, name="a", at=ZERO, **facts):
    bare = seat(name, at, QUIET)
    return bare._replace(context=bare.context._replace(payload=parcel, **facts))


def at_height(session, link, height=1.0, velocity=ZERO):
    """The vehicle is put there, and what was said so far is forgotten."""
    index = list(session.links).index("a")
    session.data.qpos[7 * index : 7 * index + 3] = (0.0, 0.0, height)
    session.data.qvel[6 * index : 6 * index + 3] = velocity
    return push(session, link, 0.004, thrust(12.0))[1]


def said(measured):
    return [(m.is_open, m.aboard) for m in measured if isinstance(m, Payload)]


@pytest.mark.parametrize("parcel", [SMALL, LEVEL_BOX])
def test_on_board_it_is_a_part_of_the_body_and_gone_with_its_release(parcel):
    bare = world().model
    session = world(carrying(parcel))
    model, height = session.model, parcel.size / 2 - 0.05
    mass = bare.body_mass[1]
    assert model.body_mass[1] == pytest.approx(mass + 0.2)
    assert model.body_ipos[1, 2] == pytest.approx(0.2 * height / (mass + 0.2))
    assert (model.body_inertia[1] >= bare.body_inertia[1] + 1e-5).all()
    session.links["a"].grip(True, 0)
    assert model.body_mass[1] == mass
    assert tuple(model.body_inertia[1]) == tuple(bare.body_inertia[1])
    assert tuple(model.body_ipos[1]) == ZERO


def test_two_bodies_together_turn_as_the_parallel_axes_say():
    mass, (jx, jy, jz), height = loaded(2.0, (0.01, 0.02, 0.03), Parcel(mass=1.0, size=0.3))
    own = 0.3**2 / 6
    off = 2.0 * (0.1 / 3) ** 2 + 1.0 * (0.2 / 3) ** 2  # each to the common centre, 1 : 2
    assert (mass, height) == pytest.approx((3.0, 0.1 / 3))
    assert (jx, jy, jz) == pytest.approx((0.01 + own + off, 0.02 + own + off, 0.03 + own))


def test_released_it_falls_with_the_velocity_it_had_and_the_vehicle_weighs_less():
    session, link = opened(carrying())
    now = at_height(session, link, 1.5, (0.5, 0.0, 0.0))
    before = link.truth()
    assert sub(before.payload, before.position) == pytest.approx((0.0, 0.0, -0.02), abs=1e-6)
    link.grip(True, now)
    measured, _ = push(session, link, 0.3, thrust(FRAME.mass * 9.81), now)
    after = link.truth()
    assert said(measured) == [(True, False)]
    fallen = 0.5 * 9.81 * 0.3**2 - 0.3 * before.velocity[2]
    assert before.payload[2] - after.payload[2] == pytest.approx(fallen, abs=0.02)
    assert after.payload[0] - before.payload[0] == pytest.approx(0.15, abs=0.005)
    assert session.model.body_mass[1] == pytest.approx(FRAME.mass)


def test_let_go_from_a_hover_it_lands_below():
    session, link = opened(carrying())
    now = at_height(session, link, 1.5)
    link.grip(True, now)
    met = touches(link)
    push(session, link, 1.0, thrust(FRAME.mass * 9.81), now)
    assert link.truth().payload == pytest.approx((0.0, 0.0, -0.02), abs=0.01)
    assert met == []


def test_it_falls_once_however_often_the_servo_opens():
    session, link = opened(carrying())
    now = at_height(session, link)
    link.grip(True, now)
    _, now = push(session, link, 0.2, thrust(10.3), now)
    link.grip(True, now)
    measured, _ = push(session, link, 0.4, thrust(10.3), now)
    assert said(measured) == [(True, False)]
    assert link.truth().payload[2] == pytest.approx(-0.02, abs=0.01)


def test_let_go_on_the_ground_it_lies_between_the_legs_and_the_vehicle_flies_off():
    session, link = opened(carrying(LEVEL_BOX))
    link.grip(True, 0)
    _, now = push(session, link, 0.5, STOPPED)
    assert link.truth().position == pytest.approx(ZERO, abs=0.003)
    assert link.truth().payload == pytest.approx(ZERO, abs=0.003)
    push(session, link, 1.0, thrust(13.0), now)
    assert link.truth().position[2] > 0.5
    assert link.truth().payload == pytest.approx(ZERO, abs=0.003)


def test_on_the_ground_it_is_put_in_as_the_servo_closes_but_not_in_flight():
    session, link = opened(carrying(Parcel(mass=0.2, size=0.06, aboard=False)))
    measured, now = push(session, link, 0.1, STOPPED)
    assert said(measured) == [(True, False)]
    link.grip(False, now)
    measured, now = push(session, link, 0.1, STOPPED, now)
    assert said(measured) == [(False, True)]
    assert session.model.body_mass[1] == pytest.approx(FRAME.mass + 0.2)
    _, now = push(session, link, 0.1, thrust(13.0), now)
    link.grip(True, now)
    link.grip(False, now)
    assert said(push(session, link, 0.1, thrust(13.0), now)[0]) == [(True, False), (False, False)]


def test_it_lies_on_an_obstacle_that_is_under_it():
    table = Box((-1.0, -1.0, 0.0), (1.0, 1.0, 0.5))
    session, link = opened(carrying(at=(2.0, 0.0, 0.0), obstacles={"table": table}))
    now = at_height(session, link, 1.2)
    link.grip(True, now)
    push(session, link, 1.0, thrust(FRAME.mass * 9.81), now)
    assert link.truth().payload[2] == pytest.approx(0.53, abs=0.01)


def test_a_vehicle_that_is_hit_by_the_parcel_of_another_has_run_into_it():
    session = world(carrying(at=(2.0, 0.0, 0.0)), seat("b"))
    a, b = session.links["a"], session.links["b"]
    now = at_height(session, a, 1.5)
    a.grip(True, now)
    hit, stood = touches(a), touches(b)
    push(session, a, 1.0, thrust(FRAME.mass * 9.81), now)
    assert (hit, stood) == ([], [Touch("the payload of a", carries=False)])


def test_a_vehicle_without_one_refuses():
    with pytest.raises(Refused, match="carries no payload"):
        world().links["a"].grip(True, 0)
