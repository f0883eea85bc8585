"""Steering: the setpoint goes where the sticks point, stays where it may be, and stops when nobody
steers."""

from __future__ import annotations

import random
from itertools import pairwise
from math import cos, hypot, pi, sin
from typing import Any

import pytest
from part_bench import SITE, at_rest, entry, estimate

from kybflow.core.errors import Refused
from kybflow.core.geometry import GRAVITY, ZERO, Vec3, distance, norm, scale, sub
from kybflow.core.signals import NS, Failed, InputReading, Setpoint, Tick
from kybflow.parts import AXES, Entry
from kybflow.runtime.behaviors.steer import Steer, SteerParams
from kybflow.world.shapes import Box, Cylinder, Plane, Shape, Sphere
from kybflow.world.vehicle_context import VehicleContext

DT = 0.004
ROOM = Box((-2.0, -2.0, 0.0), (2.0, 2.0, 2.5))
SOLIDS: dict[str, Shape] = {
    "pillar": Cylinder((1.0, 0.0, 0.0), 0.1, 2.5),
    "crate": Box((-1.2, 0.6, 0.0), (-0.8, 1.0, 1.2)),
    "ball": Sphere((0.0, -1.2, 1.2), 0.2),
    "slope": Plane((1.6, 1.6, 0.0), (-0.6, -0.8, 0.0)),
}
PLACE = SITE._replace(fence=ROOM, obstacles=SOLIDS, dt=DT)
HEIGHT: Vec3 = (0.0, 0.0, 1.0)


def sticks(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: float = 0.0) -> InputReading:
    return InputReading(0, dict(zip(AXES, (x, y, z, turn), strict=True)))


CENTRED = sticks()


class Flight:
    """A steered vehicle that is always on its setpoint."""

    def __init__(
        self,
        where: Vec3 = HEIGHT,
        velocity: Vec3 = ZERO,
        site: VehicleContext = SITE,
        reading: InputReading = CENTRED,
        **own: Any,
    ) -> None:
        self.now, self.dt = 0, site.dt
        begin = entry(where, velocity, context=site)._replace(inputs={"stick": reading})
        self.behavior = Steer(SteerParams(input="stick", **own), begin)
        self.setpoint = at_rest(where, velocity)
        self.way: list[Setpoint] = []
        self.end: Failed | None = None

    def fly(self, seconds: float, reading: InputReading | None, **others: Vec3) -> Setpoint:
        for _ in range(round(seconds / self.dt)):
            self.now += round(self.dt * NS)
            known = estimate(self.setpoint.position or ZERO, self.setpoint.velocity or ZERO)
            fleet = {name: estimate(place, now=self.now) for name, place in others.items()}
            tick = Tick(
                self.now, self.dt, self.now / NS, known, None, self.setpoint, fleet,
                inputs={"stick": reading},
            )  # fmt: skip
            output = self.behavior.update(tick)
            if isinstance(output, Failed):
                self.end, output = output, output.setpoint
            self.setpoint = output
            self.way.append(output)
        return self.setpoint

    @property
    def velocity(self) -> Vec3:
        return self.setpoint.velocity or ZERO

    @property
    def position(self) -> Vec3:
        return self.setpoint.position or ZERO


def test_it_goes_where_the_sticks_point_and_rests_when_they_are_let_go() -> None:
    flight = Flight(speed=0.5, climb=0.3)
    flight.fly(2.0, sticks(x=1.0, z=1.0))
    assert pytest.approx((0.5, 0.0, 0.3)) == flight.velocity
    there = flight.fly(2.0, CENTRED).position
    assert pytest.approx(ZERO) == flight.velocity
    assert there == flight.fly(1.0, CENTRED).position


def test_two_sticks_together_are_no_faster_than_one() -> None:
    flight = Flight(speed=0.5)
    flight.fly(2.0, sticks(x=1.0, y=1.0))
    assert pytest.approx(0.5) == hypot(*flight.velocity)


def test_forward_is_where_the_setpoint_heads_or_east() -> None:
    flight = Flight(turn_rate=0.5)
    flight.fly(pi, sticks(turn=1.0))
    heading = flight.setpoint.heading or 0.0
    assert pytest.approx(pi / 2, abs=0.05) == heading
    flight.fly(1.0, CENTRED)
    flight.fly(1.0, sticks(x=1.0))
    heading = flight.setpoint.heading or 0.0
    assert pytest.approx((0.5 * cos(heading), 0.5 * sin(heading), 0.0)) == flight.velocity
    world = Flight(turn_rate=0.5, frame="world")
    world.fly(pi, sticks(turn=1.0))
    world.fly(1.0, sticks(x=1.0))
    assert pytest.approx((0.5, 0.0, 0.0)) == world.velocity


def test_a_full_stick_tilts_and_ends_at_the_speed() -> None:
    tilt = 5 * pi / 180
    flight = Flight(by="tilt", tilt=tilt, speed=0.8)
    flight.fly(DT, sticks(x=1.0))
    assert pytest.approx(tilt, rel=0.01) == flight.velocity[0] / DT / GRAVITY
    flight.fly(3.0, sticks(x=1.0))
    assert pytest.approx(0.8, abs=0.05) == flight.velocity[0]


def test_four_signals_at_zero_brake_where_tilt_drifts_on() -> None:
    left = {}
    for by in ("tilt", "signals"):
        flight = Flight(by=by, speed=0.8)
        flight.fly(1.5, sticks(x=1.0))
        flight.fly(0.7, CENTRED)
        left[by] = flight.velocity[0]
    assert left["signals"] == 0.0
    assert left["tilt"] > 0.1


@pytest.mark.parametrize("by", ["velocity", "tilt", "signals"])
def test_a_dead_man_switch_that_is_released_brakes(by: str) -> None:
    flight = Flight(by=by)
    flight.fly(2.0, sticks(x=1.0))
    flight.fly(0.7, sticks(x=1.0)._replace(engaged=False))
    assert pytest.approx(ZERO, abs=1e-9) == flight.velocity
    flight.fly(1.0, sticks(x=1.0))
    assert flight.velocity[0] > 0.3


def test_a_lost_input_brakes_at_once_and_fails_after_its_patience() -> None:
    flight = Flight(patience=1.0)
    flight.fly(2.0, sticks(x=1.0))
    flight.fly(DT, None)
    assert flight.velocity[0] < 0.5
    flight.fly(0.9, None)
    assert pytest.approx(ZERO, abs=1e-9) == flight.velocity
    assert flight.end is None
    flight.fly(0.2, None)
    assert flight.end is not None
    assert flight.end.reason == "`stick` is lost"


def test_an_input_that_comes_back_is_obeyed_once_it_was_centred() -> None:
    flight = Flight()
    flight.fly(1.0, None)
    flight.fly(1.0, sticks(x=1.0))
    assert flight.velocity == ZERO
    flight.fly(0.1, CENTRED)
    flight.fly(1.0, sticks(x=1.0))
    assert flight.velocity[0] > 0.3


def test_after_a_hold_the_sticks_must_have_been_centred() -> None:
    flight = Flight()
    flight.fly(0.1, sticks(x=1.0))
    flight.now += NS
    flight.fly(1.0, sticks(x=1.0))
    assert pytest.approx(ZERO, abs=1e-9) == flight.velocity


@pytest.mark.parametrize(
    ("inputs", "reason"),
    [
        ({}, "`stick` is lost"),
        ({"stick": None}, "`stick` is lost"),
        ({"stick": sticks(y=0.2)}, "the sticks of `stick` are off their centres"),
    ],
)
def test_it_takes_over_only_with_sticks_at_their_centres(inputs: Any, reason: str) -> None:
    begin: Entry = entry(HEIGHT)._replace(inputs=inputs)
    assert reason == Steer.objection(SteerParams(input="stick"), begin)
    assert Steer.objection(SteerParams(input="a"), entry(HEIGHT)) is None


def test_it_refuses_to_start_without_its_input() -> None:
    with pytest.raises(Refused, match="`stick` is lost"):
        Steer(SteerParams(input="stick"), entry(HEIGHT))


def test_entered_off_centre_it_waits_for_the_sticks() -> None:
    flight = Flight(reading=sticks(y=0.2))
    flight.fly(1.0, sticks(y=0.5))
    assert flight.velocity == ZERO
    assert flight.behavior.waits_for == "the sticks of `stick` to be at their centres"
    flight.fly(0.1, CENTRED)
    assert flight.behavior.waits_for is None


@pytest.mark.parametrize("seed", range(100))
def test_it_takes_over_without_a_step(seed: int) -> None:
    draw = random.Random(seed)
    velocity = scale((draw.gauss(0, 1), draw.gauss(0, 1), draw.gauss(0, 0.3)), 0.4)
    where = (draw.uniform(-2, 2), draw.uniform(-2, 2), draw.uniform(0.3, 2.2))
    flight = Flight(where, velocity, by=draw.choice(["velocity", "tilt", "signals"]))
    first = flight.fly(DT, CENTRED)
    assert distance(first.position or ZERO, where) < 0.01
    assert norm(sub(first.velocity or ZERO, velocity)) < 0.05


def pushed(seed: int, seconds: float, **own: Any) -> Flight:
    """Somebody plays with the sticks, mostly at full deflection."""
    draw = random.Random(seed)
    flight = Flight(site=PLACE._replace(dt=0.02), speed=0.9, acceleration=2.0, **own)
    while flight.now < seconds * NS:
        way = draw.uniform(-pi, pi)
        reading = sticks(cos(way), sin(way), draw.choice((-1, 0, 0, 1)), draw.choice((-1, 0, 1)))
        flight.fly(draw.choice((0.3, 1.0, 3.0)), reading)
    return flight


@pytest.mark.parametrize("by", ["velocity", "tilt", "signals"])
@pytest.mark.parametrize(
    "seed",
    [0, pytest.param(1, marks=pytest.mark.thorough), pytest.param(2, marks=pytest.mark.slow)],
)
def test_it_stays_inside_and_away_from_everything(seed: int, by: str) -> None:
    arm = SITE.airframe.arm
    for setpoint in pushed(seed, 60.0, by=by).way:
        place = setpoint.position or ZERO
        assert ROOM.outside_by(place) < -0.3 + 2e-3
        assert place[2] > 0.4 - 2e-3
        for name, shape in SOLIDS.items():
            assert shape.distance(place) > 0.3 + arm - 5e-3, name
        assert norm(setpoint.acceleration or ZERO) < 2.5 + 1e-6


def test_it_slides_along_what_it_is_pushed_against() -> None:
    flight = Flight(site=PLACE._replace(obstacles={}))
    flight.fly(10.0, sticks(x=1.0, y=0.5))
    x, y, _ = flight.position
    assert pytest.approx(1.7, abs=1e-2) == x
    assert pytest.approx(1.7, abs=1e-2) == y


def test_it_stays_away_from_another_vehicle() -> None:
    site = SITE._replace(diameters={"nano": 0.19, "mk": 0.5})
    flight = Flight(site=site)
    flight.fly(10.0, sticks(x=1.0), mk=(1.5, 0.0, 1.0))
    assert pytest.approx(1.5 - 0.375 - 0.3 - SITE.airframe.arm, abs=1e-2) == flight.position[0]


@pytest.mark.parametrize("seed", range(10))
def test_what_closes_in_from_several_sides_does_not_make_it_shake(seed: int) -> None:
    """A vehicle that is not heard any more counts as one that may come nearer from tick to tick."""
    draw = random.Random(seed)
    site = PLACE._replace(diameters={"nano": 0.19, "b": 0.5, "c": 0.5})
    flight = Flight((-1.2, 0.0, 1.0), site=site, speed=0.8)
    flight.fly(1.0, sticks(x=1.0))
    for step in range(300):
        near = 1.3 - 0.004 * step + draw.uniform(-0.01, 0.01)
        others = {"b": (-0.3 + 0.4 * near, near, 1.0), "c": (-0.3, -near, 1.0)}
        flight.fly(DT, sticks(x=1.0), **others)
    accelerations = [one.acceleration or ZERO for one in flight.way[-300:]]
    steps = [norm(sub(b, a)) for a, b in pairwise(accelerations)]
    assert max(map(norm, accelerations)) > 1.0
    assert sum(step > 0.2 for step in steps) <= 3  # such as where the stick's own acceleration ends
