"""Objects of the world: what motion capture shows of their joints, and that nobody sees them."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from math import pi

import pytest

from kybflow.core.geometry import ZERO, Vec3, add, from_heading, integrate, wrap
from kybflow.core.signals import NS, Event, Measurement, Pose, Time
from kybflow.parts import Stream
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.tracked_objects import TrackedObjects, tracked_objects
from kybflow.world.objects import SlideJoint, TurnJoint, WorldObject, coordinate, placements

CAR = WorldObject(
    "car", (0.5, 0.0, 0.8), (0.2, 0.2, 0.1), 1.0, heading=0.7,
    joint=SlideJoint(along=(2.0, 1.0, 0.0), low=-1.0, high=3.0),
)  # fmt: skip
BAR = WorldObject(
    "bar", (0.1, 0.0, 0.2), (0.04, 1.2, 0.06), 0.5, "car", heading=-0.4,
    joint=TurnJoint(about=(0.0, 0.0, 1.0), low=-pi, high=pi),
)  # fmt: skip
CRATE = WorldObject("crate", (0.0, 1.0, 0.1), (0.2, 0.2, 0.2), 0.4)
OBJECTS = {"bar": BAR, "car": CAR, "crate": CRATE}
PERIOD = NS // 120
NOISE, TURN_NOISE = 0.0005, 0.002


def q_of(name: str, seconds: float) -> float:
    return {"car": 0.2 * seconds, "bar": 0.3 - 0.4 * seconds, "crate": 3.0 + 0.5 * seconds}[name]


class Measured(Stream):
    """The poses of an object, noisy; none while `hidden` says so."""

    def __init__(self, name: str, hidden: Callable[[float], bool] = lambda _: False) -> None:
        self._name, self._hidden, self._draw = name, hidden, random.Random(name)

    def read(self, now: Time) -> Sequence[Measurement]:
        seconds = now / NS
        if self._hidden(seconds):
            return ()
        place = placements(OBJECTS, {name: q_of(name, seconds) for name in OBJECTS})[self._name]
        attitude = place.attitude
        if self._name == "crate":
            attitude = from_heading(q_of("crate", seconds))
        return (
            Pose(now, add(place.position, self._noise(NOISE)),
                 integrate(attitude, self._noise(TURN_NOISE), 1.0)),
        )  # fmt: skip

    def _noise(self, deviation: float) -> Vec3:
        gauss = self._draw.gauss
        return gauss(0.0, deviation), gauss(0.0, deviation), gauss(0.0, deviation)

    def close(self) -> None:
        """Nothing is open."""


def tracked(
    seconds: float, hidden: Callable[[float], bool] = lambda _: False
) -> tuple[TrackedObjects, list[Event]]:
    told: list[Event] = []
    streams = {
        name: Measured(name, hidden if name == "bar" else lambda _: False) for name in OBJECTS
    }
    objects = tracked_objects(OBJECTS, Events((told.append,)), streams)
    for tick in range(round(seconds * NS / PERIOD)):
        objects.step(tick * PERIOD)
    return objects, told


@pytest.mark.parametrize("name", OBJECTS)
def test_the_coordinate_of_a_joint_and_its_rate_are_those_of_the_poses(name: str) -> None:
    objects, told = tracked(2.0)
    seen = objects.seen[name]
    assert told == []
    assert abs(wrap(seen.q - q_of(name, seen.time / NS))) < 5.0 * TURN_NOISE
    slope = (q_of(name, 1.0) - q_of(name, 0.0)) / 1.0
    assert seen.speed == pytest.approx(slope, abs=0.04)


@pytest.mark.thorough
def test_the_rate_is_no_noisier_than_the_equation_says() -> None:
    """sqrt(12 / n) s / T for the velocity along x, of 0.5 mm in 18 poses and 0.15 s: 2.7 mm/s."""
    objects = tracked_objects(OBJECTS, Events(), {name: Measured(name) for name in OBJECTS})
    speeds = []
    for tick in range(2400):
        objects.step(tick * PERIOD)
        if tick > 60:
            speeds.append(objects.seen["car"].speed)
    mean = sum(speeds) / len(speeds)
    deviation = (sum((v - mean) ** 2 for v in speeds) / len(speeds)) ** 0.5
    assert mean == pytest.approx(0.2, abs=0.001)
    assert deviation < 0.0032


def test_an_object_that_is_not_seen_is_told_and_found_again() -> None:
    objects, told = tracked(3.0, lambda t: 1.0 <= t < 2.0)
    assert [event.name for event in told] == ["object_lost", "object_found"]
    assert told[0].fields == {"object": "bar", "reason": "not seen for 0.5 s"}
    assert dict(objects.objections(3 * NS)) == {"car": None, "bar": None, "crate": None}


def test_nobody_takes_off_beside_one_that_was_never_seen() -> None:
    objects, _ = tracked(1.0, lambda _: True)
    assert dict(objects.objections(NS))["bar"] == "it is not seen"


@pytest.mark.parametrize("seed", range(20))
def test_a_coordinate_is_the_one_that_places_the_object(seed: int) -> None:
    draw = random.Random(seed)
    q = {"car": draw.uniform(-1.0, 3.0), "bar": draw.uniform(-3.0, 3.0)}
    places = placements(OBJECTS, q)
    assert coordinate(CAR, None, places["car"]) == pytest.approx(q["car"])
    assert coordinate(BAR, places["car"], places["bar"]) == pytest.approx(q["bar"])
    assert coordinate(CRATE, None, places["crate"]) == pytest.approx(0.0)
    assert placements(OBJECTS, {})["crate"].position != ZERO
