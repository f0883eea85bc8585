"""Objects in the simulator: joints, friction, contacts with a bumper, and what stays the same."""

from __future__ import annotations

import random
from dataclasses import replace
from math import exp
from statistics import fmean

import pytest
from sim_worlds import FRAME, PERIOD, QUIET, hover_control, lift, push, thrust

from kybflow.core.geometry import from_thrust_direction
from kybflow.core.signals import Event
from kybflow.drivers.sim import Sim
from kybflow.parts import Seat
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.ground_truth import ObjectContacts
from kybflow.world.objects import ObjectSurface, SlideJoint, TurnJoint, WorldObject
from kybflow.world.vehicle_context import VehicleContext

FAR = (50.0, 0.0, 1.0)
TILTED, BACK = (from_thrust_direction((x, 0.0, 1.0), 0.0) for x in (0.05, -0.05))


def opened(*objects: WorldObject, bumper: float | None = None):
    frame = replace(FRAME, bumper=bumper)
    context = VehicleContext(
        "a", frame, (0.0, 0.0, 0.0), 0.0, None, 0.004, objects={one.name: one for one in objects}
    )
    return Sim.open([Seat(context, QUIET)], random.Random(1))


def car(at=FAR, **joint: float) -> WorldObject:
    slide = SlideJoint((1.0, 0.0, 0.0), -5.0, 5.0, **joint)
    return WorldObject("car", at, (0.2, 0.2, 0.2), 1.0, joint=slide)


def rolling(session, seconds: float, speed: float = 1.0) -> list[float]:
    """The speed of the car in every tick, from `speed` on."""
    freedom = session.model.joint("object car").dofadr[0]
    session.data.qvel[freedom] = speed
    found = []
    for k in range(1, round(seconds * 250) + 1):
        session.advance(k * PERIOD)
        found.append(session.scene.states()["car"].speed)
    return found


@pytest.mark.parametrize("damping", [0.3, 3.0, 300.0])
def test_viscous_friction_slows_a_car_as_its_solution_says(damping: float):
    speeds = rolling(opened(car(damping=damping)), 1.0)
    expected = [exp(-damping * (k + 1) / 250) for k in range(250)]
    assert speeds == pytest.approx(expected, abs=2e-3)


def test_dry_friction_stops_a_car():
    """By F / m = 0.5 m/s^2: after 2 s."""
    speeds = rolling(opened(car(friction=0.5)), 3.0)
    assert speeds[249] == pytest.approx(0.5, abs=0.02)
    assert speeds[-1] == pytest.approx(0.0, abs=1e-3)


def test_a_joint_ends_at_its_stop():
    session = opened(car())
    rolling(session, 4.8)
    places = []
    for k in range(1200, 2000):
        session.advance(k * PERIOD)
        places.append(session.scene.states()["car"].q)
    assert 4.9 < max(places) < 5.02


def test_what_is_on_a_car_moves_with_it_and_a_free_box_rests_on_the_floor():
    on = WorldObject(
        "bar", (0.0, 0.0, 0.3), (0.1, 1.0, 0.1), 0.5, on="car",
        joint=TurnJoint((0.0, 0.0, 1.0), -1.0, 1.0, start=0.4),
    )  # fmt: skip
    box = WorldObject("box", (48.0, 3.0, 0.2), (0.3, 0.3, 0.3), 2.0)
    session = opened(on, car(), box)
    rolling(session, 1.0, speed=0.5)
    states = session.scene.states()
    assert states["bar"].position == pytest.approx((50.5, 0.0, 1.3), abs=0.01)
    assert states["bar"].velocity == pytest.approx((0.5, 0.0, 0.0), abs=0.01)
    assert states["bar"].q == pytest.approx(0.4, abs=1e-6)
    assert states["box"].position == pytest.approx((48.0, 3.0, 0.1), abs=0.002)


def test_a_far_object_changes_no_flight():
    """Only the last bits of the touch-down differ, because MuJoCo solves all contacts together."""

    def flight(*objects: WorldObject):
        session = opened(*objects)
        link = session.links["a"]
        _, now = push(session, link, 1.0, thrust(11.0))
        lift(session, link, 1.5, 3.0, now)
        return link.truth()

    on = WorldObject(
        "bar", (0.0, 0.0, 0.3), (0.1, 1.0, 0.1), 0.5, on="car",
        joint=TurnJoint((0.0, 0.0, 1.0), -1.0, 1.0, friction=0.01, damping=0.02),
    )  # fmt: skip
    alone, beside = flight(), flight(car(friction=0.4, damping=0.3), on)
    assert alone.position == pytest.approx(beside.position, abs=1e-9)
    assert alone.velocity == pytest.approx(beside.velocity, abs=1e-9)


def test_a_bumper_presses_a_plate_with_the_force_of_the_tilt():
    """The car has friction enough to stand: m g tan(tilt) is all on the plate. The contact has one
    beginning."""
    plate = ObjectSurface("back", (-0.12, 0.0, 0.0), (-1.0, 0.0, 0.0), 0.8, 0.8)
    block = car((0.75, 0.0, 1.0), friction=50.0)._replace(surfaces=(plate,))
    session = opened(block, bumper=0.3)
    link, told = session.links["a"], list[Event]()
    contacts = ObjectContacts([session], Events((told.append,)))
    now = lift(session, link, 1.0, 5.0)
    forces = []
    for _ in range(5 * 250):
        lifts = hover_control(link, 1.0).thrust
        _, now = push(session, link, 0.004, thrust(lifts, TILTED), now)
        contacts.step(now, 0.004)
        forces.append(sum(contacts.forces.values()))
    assert [(e.name, e.fields["surface"]) for e in told] == [("contact_began", "back")]
    assert fmean(forces[-250:]) == pytest.approx(0.05 * FRAME.mass * 9.81, rel=0.1)
    assert session.scene.states()["car"].q == pytest.approx(0.0, abs=1e-3)
    for _ in range(125):
        _, now = push(session, link, 0.004, thrust(hover_control(link, 1.0).thrust, BACK), now)
        contacts.step(now, 0.004)
    assert [e.name for e in told] == ["contact_began", "contact_ended"]
    assert told[-1].fields["lasted"] > 3.0
    assert contacts.forces == {}
