"""What is in the way is the same to whoever looks for it: a formation, which hears what vehicles
publish, and the processors and `steer`, which are told of the fleet."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Protocol

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from part_bench import SITE, estimate

from kybflow.core.geometry import Vec3, add, norm, scale
from kybflow.core.signals import NS, Answer, Estimate, NeighbourState, SeenObstacle, Tick, Time
from kybflow.flight.avoidance.surroundings import Nearby
from kybflow.runtime.behaviors.formation.room import FormationRoom
from kybflow.world.scanned import Columns, PointCloud
from kybflow.world.shapes import Box, Cylinder, MovingSphere, Plane, Shape, Sphere
from kybflow.world.vehicle_context import VehicleContext

HERE: Vec3 = (0.0, 0.0, 1.0)
THERE: Vec3 = (1.0, 0.0, 1.0)
COMES: Vec3 = (-0.5, 0.0, 0.0)
BALL = MovingSphere((THERE,), 0.2, 0.8)
TWO = SITE._replace(diameters={SITE.vehicle: 0.2, "b": 0.4})


class Radio:
    """A neighbour `b` says one thing only."""

    def __init__(self, time: Time, known: Estimate | None) -> None:
        self.news = NeighbourState(time, known, None, None)

    def heard(self, vehicle: str, by: Time) -> NeighbourState | None:
        return self.news if vehicle == "b" else None

    def once(self, question: Hashable, answer: Callable[[], Answer]) -> Answer:
        return answer()


class Looks(Protocol):
    """How far what is in the way is, as seen from `HERE`."""

    def __init__(self, context: VehicleContext) -> None: ...

    def rooms(self, seconds: float, known: Estimate | None) -> list[float]: ...


def moment(seconds: float, known: Estimate | None) -> Tick:
    now = round(seconds * NS)
    ball = SeenObstacle(0, THERE, COMES, BALL.radius, BALL.speed)
    return Tick(
        now, 0.01, 0.0, None, None, None, {"b": known}, neighbours=Radio(now, known),
        moving={"ball": ball},
    )  # fmt: skip


class Processors:
    def __init__(self, context: VehicleContext) -> None:
        self.nearby = Nearby(context)

    def rooms(self, seconds: float, known: Estimate | None) -> list[float]:
        near = self.nearby.near(HERE, 0.0, moment(seconds, known), lambda _: 9.0)
        return [hazard.room for hazard in near]


class AFormation:
    def __init__(self, context: VehicleContext) -> None:
        self.room, self.moves = FormationRoom(context, (context.vehicle,)), bool(context.moving)

    def rooms(self, seconds: float, known: Estimate | None) -> list[float]:
        tick = moment(seconds, known)
        tick = tick if self.moves else tick._replace(moving={})
        return [shape.distance(HERE) for shape in self.room.obstacles(tick, 0, ())]


both = pytest.mark.parametrize("looks", [Processors, AFormation])


@both
def test_what_is_there_to_be_touched_is_none(looks: type[Looks]) -> None:
    solids = {"pillar": Sphere(THERE, 0.3), "bar": Sphere(THERE, 0.5)}
    context = SITE._replace(obstacles=solids, touchable=frozenset({"bar"}))
    assert looks(context).rooms(0.0, None) == pytest.approx([0.7])


@both
def test_what_moves_grows_while_it_is_not_seen_for_a_second(looks: type[Looks]) -> None:
    seen = looks(SITE._replace(moving={"ball": BALL}))
    for seconds, room in ((0.0, 0.8), (0.25, 0.6), (1.0, 0.0), (9.0, 0.0)):
        assert seen.rooms(seconds, None) == pytest.approx([room])


@both
def test_another_vehicle_reaches_to_the_tips_of_its_rotors(looks: type[Looks]) -> None:
    assert looks(TWO).rooms(2.0, estimate(THERE, COMES, 2 * NS)) == pytest.approx([0.7])
    assert looks(TWO).rooms(2.0, None) == []


@both
def test_one_of_which_old_news_is_known_can_have_gone_on_or_set_out(looks: type[Looks]) -> None:
    assert looks(TWO).rooms(0.2, estimate(THERE, COMES)) == pytest.approx([0.6])
    assert looks(TWO).rooms(0.2, estimate(THERE)) == pytest.approx([0.64])
    assert looks(TWO).rooms(30.0, estimate(THERE, COMES)) == pytest.approx([0.2])


@both
def test_one_that_lost_its_estimate_is_forgotten_when_it_has_landed(looks: type[Looks]) -> None:
    seen = looks(TWO)
    assert seen.rooms(0.0, estimate(THERE, COMES)) == pytest.approx([0.7])
    for seconds, room in ((0.2, 0.6), (3.0, 0.2), (19.0, 0.2)):
        assert seen.rooms(seconds, None) == pytest.approx([room])
    assert seen.rooms(21.0, None) == []


SHAPES: tuple[Shape, ...] = (
    Box((-0.5, -0.3, 0.0), (0.5, 0.4, 1.0)),
    Cylinder((0.2, 0.1, 0.0), 0.3, 1.5),
    Sphere((0.0, 0.0, 1.0), 0.4),
    Plane((0.0, 0.0, 0.0), (0.6, 0.8, 0.0)),
    Columns(((0.0, 0.0), (1.2, 0.1)), 0.3, 0.2, 1.4),
    PointCloud(((0.0, 0.0, 1.0), (0.9, 0.1, 1.0), (-0.3, 0.5, 0.2)), 0.3),
)
STEP = 1e-5
places = st.tuples(*[st.floats(-2.0, 2.0)] * 3)
inside = st.tuples(st.floats(-0.2, 0.4), st.floats(-0.2, 0.3), st.floats(0.7, 1.0))


@pytest.mark.thorough
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
@given(place=places)
def test_the_distance_grows_as_fast_as_one_goes(shape: Shape, place: Vec3) -> None:
    outward = shape.outward(place)
    assert norm(outward) == pytest.approx(1.0)
    grown = shape.distance(add(place, scale(outward, STEP)))
    shrunk = shape.distance(add(place, scale(outward, -STEP)))
    assume(abs(grown + shrunk - 2.0 * shape.distance(place)) < 1e-8)  # no edge in between
    assert (grown - shrunk) / (2.0 * STEP) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.thorough
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
@given(place=inside)
def test_it_leads_out(shape: Shape, place: Vec3) -> None:
    room = shape.distance(place)
    assume(room < 0.0)
    assert shape.distance(add(place, scale(shape.outward(place), 1e-3 - room))) > 0.0


def test_at_the_centre_of_a_ball_it_is_up() -> None:
    assert Sphere((1.0, 2.0, 3.0), 0.5).outward((1.0, 2.0, 3.0)) == (0.0, 0.0, 1.0)
