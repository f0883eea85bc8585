"""avoid_obstacles: vehicles that meet go round each other; what meets nobody passes bit for bit."""

import random
from dataclasses import replace
from math import cos, pi, sin

import pytest
from part_bench import AIRFRAME, FENCE, at_rest, estimate

from kybflow.core.events import Emitting
from kybflow.core.geometry import ZERO, Vec3, add, distance, norm, scale, sub
from kybflow.core.signals import NS, Estimate, Setpoint, SetpointKind, Tick
from kybflow.flight.motion import Straight
from kybflow.runtime.processors.avoid_obstacles import AvoidObstacles, AvoidObstaclesParams
from kybflow.world.shapes import Cylinder
from kybflow.world.vehicle_context import VehicleContext

DT = 0.01
KEEP = 0.2
APART = 2.0 * AIRFRAME.hull + KEEP


def site(name: str, names: tuple[str, ...], **more) -> VehicleContext:
    diameters = dict.fromkeys(names, AIRFRAME.diameter)
    return VehicleContext(name, AIRFRAME, ZERO, 0.0, FENCE, DT, diameters=diameters, **more)


def tick(seconds: float, known: Estimate, last: Setpoint | None, fleet: dict) -> Tick:
    now = round(seconds * NS)
    fleet = {name: one and one._replace(time=now) for name, one in fleet.items()}
    return Tick(now, DT, seconds, known, None, last, fleet)


class Crossing:
    """Vehicles on a circle that fly to the other side, each following its setpoint like TeleKyb's
    law and pushed about; their estimates are noisy."""

    def __init__(self, count: int, seed: int, **params) -> None:
        self.chance = random.Random(seed)
        self.names = tuple(f"v{i}" for i in range(count))
        turns = [2 * pi * i / count for i in range(count)]
        self.places = [self.near((2 * cos(a), 2 * sin(a), 1.0), 0.02) for a in turns]
        self.goals = [(-x, -y, z) for x, y, z in self.places]
        self.legs = [Straight(p, g, 0.6, 0.7) for p, g in zip(self.places, self.goals, strict=True)]
        self.speeds: list[Vec3] = [ZERO] * count
        self.last: list[Setpoint | None] = [None] * count
        parameters = AvoidObstaclesParams(keep=KEEP, **params)
        self.parts = [AvoidObstacles(parameters, site(name, self.names)) for name in self.names]
        self.told: list[str] = []
        self.apart, self.waits, self.longest = 9.0, [0.0] * count, 0.0

    def near(self, place: Vec3, spread: float) -> Vec3:
        return add(place, tuple(self.chance.gauss(0.0, spread) for _ in range(3)))

    def fly(self, seconds: float) -> None:
        for step in range(round(seconds / DT)):
            self.step(step * DT)
            if all(distance(p, g) < 0.05 for p, g in zip(self.places, self.goals, strict=True)):
                return

    def step(self, now: float) -> None:
        fleet = {
            name: estimate(self.near(p, 3e-3), self.near(v, 0.02))
            for name, p, v in zip(self.names, self.places, self.speeds, strict=True)
        }
        for i, name in enumerate(self.names):
            asked = self.legs[i].at(now).setpoint(0.0)
            given = self.parts[i](asked, tick(now, fleet[name], self.last[i] or asked, fleet))
            if isinstance(given, Emitting):
                self.told.append(given.event.name)
                given = given.output
            self.last[i] = given
            self.move(i, given)
        pairs = ((p, q) for i, p in enumerate(self.places) for q in self.places[:i])
        self.apart = min(self.apart, *(distance(p, q) for p, q in pairs))

    def move(self, i: int, given: Setpoint) -> None:
        place, speed = self.places[i], self.speeds[i]
        pull = add(scale(sub(given.position, place), 9.0), scale(sub(given.velocity, speed), 7.5))
        push = self.near(add(pull, given.acceleration), 0.3)
        self.speeds[i] = speed = add(speed, scale(push, DT))
        self.places[i] = place = add(place, scale(speed, DT))
        waits = norm(speed) < 0.05 and distance(place, self.goals[i]) > 0.1
        self.waits[i] = self.waits[i] + DT if waits else 0.0
        self.longest = max(self.longest, self.waits[i])


@pytest.mark.parametrize("count", [2, 3, 8])
@pytest.mark.parametrize(
    "seed",
    [
        0,
        pytest.param(1, marks=pytest.mark.thorough),
        *(pytest.param(s, marks=pytest.mark.slow) for s in range(2, 8)),
    ],
)
def test_those_who_meet_in_a_point_go_round_each_other(count: int, seed: int) -> None:
    crossing = Crossing(count, seed)
    crossing.fly(30.0)
    assert crossing.apart > APART - 0.03
    assert crossing.longest < 2.0
    assert crossing.told == []
    assert all(distance(p, g) < 0.05 for p, g in zip(crossing.places, crossing.goals, strict=True))


def test_who_meets_nobody_passes_bit_for_bit() -> None:
    part = AvoidObstacles(AvoidObstaclesParams(), site("a", ("a", "b")))
    leg = Straight((0.0, 0.0, 1.0), (2.0, 0.0, 1.0), 0.6, 0.7)
    for i in range(500):
        setpoint = leg.at(i * DT).setpoint(0.0)
        known = estimate(setpoint.position)
        fleet = {"a": known, "b": estimate((1.0, 2.5, 1.0))}
        assert part(setpoint, tick(i * DT, known, setpoint, fleet)) is setpoint


def nearest(params: AvoidObstaclesParams, later: AvoidObstaclesParams | None = None) -> float:
    """How near a vehicle comes to another that stands in its way."""
    part = AvoidObstacles(params, site("a", ("a", "b")))
    leg = Straight((0.0, 0.0, 1.0), (2.0, 0.0, 1.0), 0.6, 0.7)
    other, last, found = estimate((1.0, 0.0, 1.0)), None, 9.0
    for i in range(1200):
        if i == 10 and later is not None:
            part.params = later
        asked = leg.at(i * DT).setpoint(0.0)
        known = estimate(last.position if last is not None else asked.position)
        last = part(asked, tick(i * DT, known, last, {"a": known, "b": other}))
        found = min(found, distance(last.position, other.position))
    assert distance(last.position, (2.0, 0.0, 1.0)) < 1e-3
    return found


def test_only_those_it_is_told_of_are_obstacles_and_that_may_change_in_flight() -> None:
    every = AvoidObstaclesParams()
    nobody, other = (replace(every, treat_as_obstacles=names) for names in ((), ("b",)))
    assert nearest(every) == nearest(other) > APART - 1e-3
    assert nearest(nobody) < 0.01
    assert nearest(nobody, later=other) > APART - 1e-3
    assert nearest(other, later=nobody) < 0.01


def test_it_goes_round_a_pillar() -> None:
    pillar = Cylinder((1.0, 0.0, 0.0), 0.2, 2.5)
    part = AvoidObstacles(AvoidObstaclesParams(), site("a", ("a",), obstacles={"pillar": pillar}))
    leg, last = Straight((0.0, 0.0, 1.0), (2.0, 0.0, 1.0), 0.6, 0.7), None
    for i in range(1500):
        asked = leg.at(i * DT).setpoint(0.0)
        known = estimate(last.position if last is not None else asked.position)
        last = part(asked, tick(i * DT, known, last, {"a": known}))
        assert pillar.distance(last.position) > AIRFRAME.hull + KEEP - 1e-3
    assert last is asked


def test_who_is_flown_at_gives_way() -> None:
    part = AvoidObstacles(AvoidObstaclesParams(), site("a", ("a", "b")))
    asked, last = at_rest((0.0, 0.0, 1.0)), None
    for i in range(900):
        known = estimate(last.position if last is not None else asked.position)
        other = estimate((-2.0 + 0.8 * i * DT, 0.02, 1.0), (0.8, 0.0, 0.0))
        last = part(asked, tick(i * DT, known, last, {"a": known, "b": other}))
        assert distance(last.position, other.position) > APART - 0.02
    assert distance(last.position, asked.position) < 0.01


@pytest.mark.parametrize("kind", [SetpointKind.VELOCITY, SetpointKind.ACCELERATION])
def test_other_kinds_are_kept_away_too(kind: SetpointKind) -> None:
    part = AvoidObstacles(AvoidObstaclesParams(), site("a", ("a", "b")))
    place, speed, other, last = (0.0, 0.0, 1.0), ZERO, estimate((1.5, 0.0, 1.0)), None
    for i in range(800):
        if kind is SetpointKind.VELOCITY:
            asked = Setpoint(kind, velocity=(0.5, 0.0, 0.0), heading=0.0)
        else:
            asked = Setpoint(kind, acceleration=(0.5, 0.0, 0.0), heading=0.0)
        known = estimate(place, speed)
        last = part(asked, tick(i * DT, known, last, {"a": known, "b": other}))
        speed = last.velocity or add(speed, scale(last.acceleration or ZERO, DT))
        place = add(place, scale(speed, DT))
        assert distance(place, other.position) > APART - 0.02


def test_who_loses_the_estimate_is_kept_away_from_where_it_was() -> None:
    part = AvoidObstacles(AvoidObstaclesParams(), site("a", ("a", "b")))
    asked, last, nearest = Straight((0.0, 0.0, 1.0), (2.0, 0.0, 1.0), 0.6, 0.7), None, 9.0
    other = estimate((1.0, 0.05, 1.0))
    for i in range(1200):
        known = estimate(last.position if last is not None else (0.0, 0.0, 1.0))
        fleet = {"a": known, "b": other if i < 100 else None}
        last = part(asked.at(i * DT).setpoint(0.0), tick(i * DT, known, last, fleet))
        nearest = min(nearest, distance(last.position, other.position))
    assert nearest > APART - 1e-3
    assert last.position == (2.0, 0.0, 1.0)
