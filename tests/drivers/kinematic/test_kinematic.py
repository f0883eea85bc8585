"""Ideal vehicles do exactly what they are commanded, stand on what carries them, and tell what they
run into."""

from __future__ import annotations

import dataclasses
import random
from math import atan, cos, tan

import pytest
from sim_worlds import seat

from kybflow.core.errors import Refused
from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, from_euler, heading_of, tilt_of
from kybflow.core.signals import (
    NS,
    Battery,
    Command,
    CommandKind,
    Imu,
    Odometry,
    Payload,
    Setpoint,
    SetpointKind,
)
from kybflow.drivers.kinematic import Kinematic, KinematicParams
from kybflow.drivers.kinematic.world import SPEED_RESERVE
from kybflow.parts import Seat
from kybflow.parts.link import Touch
from kybflow.world.shapes import Box, Cylinder
from kybflow.world.vehicle_context import LEGS, Parcel

TICK = NS // 25


class World:
    """Vehicles, and a clock for them."""

    def __init__(self, *places, **changes):
        contexts = [seat(f"v{i}", at=place).context for i, place in enumerate(places)]
        seats = [Seat(c._replace(**changes), KinematicParams()) for c in contexts]
        self.session = Kinematic.open(seats, random.Random(0))
        self.links, self.now, self.touched = list(self.session.links.values()), 0, []
        for link in self.links:
            link.report_touches(self.touched.append)

    def run(self, seconds, *commands):
        for _ in range(round(seconds * NS / TICK)):
            for link, command in zip(self.links, commands, strict=False):
                link.send(command, self.now)
            self.now += TICK
            self.session.advance(self.now)
        return self.links[0].truth()


def following(kind, **fields):
    wanted = Setpoint(SetpointKind[kind.name], heading=0.0, **fields)
    return Command(LEVEL, 0.0, ZERO, 0.0, kind=kind, setpoint=wanted)


def at(*place, velocity=ZERO):
    return following(CommandKind.POSITION, position=place, velocity=velocity)


def test_it_reaches_a_setpoint_no_faster_than_it_may() -> None:
    world = World((0.0, 0.0, 0.0))
    airframe = seat().context.airframe
    most = SPEED_RESERVE * max(airframe.speed, airframe.climb)

    early = world.run(0.4, at(0.0, 0.0, 2.0))
    late = world.run(4.0, at(0.0, 0.0, 2.0))

    assert early.position[2] == pytest.approx(0.4 * most)
    assert late.position == pytest.approx((0.0, 0.0, 2.0))


def test_it_moves_with_a_setpoint_and_tilts_by_its_acceleration() -> None:
    world = World((0.0, 0.0, 0.0))
    world.run(2.0, at(0.0, 0.0, 1.0))
    level = world.run(0.4, following(CommandKind.VELOCITY, velocity=(0.5, 0.0, 0.0)))
    pushed = world.run(0.4, following(CommandKind.ACCELERATION, acceleration=(1.0, 0.0, 0.0)))

    assert level.position == pytest.approx((0.2, 0.0, 1.0))
    assert level.velocity == pytest.approx((0.5, 0.0, 0.0))
    assert pushed.velocity[0] == pytest.approx(0.9)
    assert tilt_of(pushed.attitude) == pytest.approx(atan(1.0 / GRAVITY))


def test_an_attitude_pushes_by_its_thrust() -> None:
    world = World((0.0, 0.0, 0.0))
    weight = seat().context.airframe.hover_thrust
    before = world.run(2.0, at(0.0, 0.0, 1.0)).position
    moved = world.run(0.4, Command(from_euler(0.0, 0.1, 0.0), weight / cos(0.1), ZERO, 0.0))

    assert before[0] == 0.0
    assert moved.position == pytest.approx((0.08 * GRAVITY * tan(0.1), 0.0, 1.0))
    assert moved.velocity == pytest.approx((0.4 * GRAVITY * tan(0.1), 0.0, 0.0))


def test_rates_turn_it_and_no_heading_keeps_its_own() -> None:
    world = World((0.0, 0.0, 0.0))
    weight = seat().context.airframe.hover_thrust
    world.run(2.0, at(0.0, 0.0, 1.0))
    spin = Command(LEVEL, weight, (0.0, 0.0, 0.5), 0.0, kind=CommandKind.RATES_THRUST)
    turned = world.run(0.4, spin)
    kept = world.run(0.04, Command(LEVEL, weight, ZERO, None))

    assert heading_of(turned.attitude) == pytest.approx(0.2, abs=1e-3)
    assert heading_of(kept.attitude) == pytest.approx(heading_of(turned.attitude))


def test_the_floor_and_what_stands_on_it_carry_it() -> None:
    crate = Box((-0.5, -0.5, 0.0), (0.5, 0.5, 0.6))
    world = World((2.0, 0.0, 0.0), obstacles={"crate": crate})
    sinks = following(CommandKind.VELOCITY, velocity=(0.0, 0.0, -0.3))

    world.run(2.0, at(2.0, 0.0, 1.0))
    floor = world.run(6.0, sinks)
    world.run(2.0, at(2.0, 0.0, 1.0))
    world.run(3.0, at(0.0, 0.0, 1.0))
    top = world.run(4.0, sinks)
    pushed = world.run(1.0, at(0.0, 0.0, 0.4))

    assert floor.position == (2.0, 0.0, 0.0)
    assert top.position == pytest.approx((0.0, 0.0, 0.6 + LEGS))
    assert top.velocity == ZERO
    assert pushed.position == top.position
    assert world.touched == [Touch("the floor", True)] * 2


def test_it_falls_without_thrust_and_feels_the_ground() -> None:
    world = World((0.0, 0.0, 0.0))
    link = world.links[0]
    link.subscribe(frozenset({Imu}))
    world.run(2.0, at(0.0, 0.0, 1.0))
    link.read(world.now)
    down, felt = Command(LEVEL, 0.0, ZERO, 0.0, armed=False), []
    for _ in range(20):
        world.run(0.04, down)
        felt += [m.specific_force[2] for m in link.read(world.now) if isinstance(m, Imu)]

    assert felt[0] == pytest.approx(0.0, abs=1e-3)
    assert max(felt) > 50.0
    assert felt[-1] == pytest.approx(GRAVITY, abs=1e-3)
    assert link.truth().position[2] == 0.0


def test_it_tells_what_it_runs_into() -> None:
    pillar = Cylinder((1.0, 0.0, 0.0), 0.2, 2.0)
    world = World((0.0, 0.0, 0.0), (0.0, 2.0, 0.0), obstacles={"pillar": pillar})
    world.run(2.0, at(0.0, 0.0, 1.0), at(0.0, 2.0, 1.0))
    world.run(2.0, at(1.0, 0.0, 1.0), at(0.0, 2.0, 1.0))
    world.run(4.0, at(0.0, 1.9, 1.0), at(0.0, 2.0, 1.0))

    assert world.touched == [
        Touch("pillar", False), Touch("v1", False), Touch("v0", False)
    ]  # fmt: skip


def test_the_battery_drains_in_the_airframes_endurance() -> None:
    world = World((0.0, 0.0, 0.0))
    world.run(2.0, at(0.0, 0.0, 1.0))
    link = world.links[0]
    [before] = [m for m in link.read(world.now) if isinstance(m, Battery)]
    world.run(60.0, at(0.0, 0.0, 1.0))
    [after] = [m for m in link.read(world.now) if isinstance(m, Battery)]

    endurance = seat().context.airframe.endurance
    assert before.remaining - after.remaining == pytest.approx(60.0 / endurance)


def test_a_payload_lies_where_it_was_let_go() -> None:
    parcel = Parcel(mass=0.1, size=0.1, channel=1, aboard=True)
    world = World((0.0, 0.0, 0.0), payload=parcel)
    link = world.links[0]
    world.run(2.0, at(0.0, 0.0, 1.0))
    link.grip(True, world.now)
    world.run(2.0, at(1.0, 0.0, 1.0))
    said = [m for m in link.read(world.now) if isinstance(m, Payload)]

    assert [(one.is_open, one.aboard) for one in said] == [(False, True), (True, False)]
    assert link.truth().payload == pytest.approx((0.0, 0.0, 0.05 - LEGS))
    with pytest.raises(Refused):
        World((0.0, 0.0, 0.0)).links[0].grip(True, 0)


def test_measurements_come_when_they_are_asked_for() -> None:
    world = World((0.0, 0.0, 0.0))
    link = world.links[0]

    assert [type(m) for m in link.read(0)] == [Battery]
    link.subscribe(frozenset({Odometry}))
    assert [type(m) for m in link.read(TICK)] == [Odometry]


def test_a_full_battery_is_not_needed() -> None:
    context = seat().context
    params = dataclasses.replace(KinematicParams(), battery=0.5)
    link = Kinematic.open([Seat(context, params)], random.Random(0)).links[context.vehicle]

    assert [m.remaining for m in link.read(0) if isinstance(m, Battery)] == [0.5]
