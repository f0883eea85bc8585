"""What only a simulator knows: which touch is a collision, and which landing is too hard."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import pytest
from fake_view import FakeView

from kybflow.core.geometry import LEVEL, ZERO, Vec3
from kybflow.core.signals import NS, SeenObstacle, Truth
from kybflow.parts.link import Touch
from kybflow.parts.observables import Unavailable
from kybflow.parts.true_objects import TrueObjects
from kybflow.runtime.events import Events
from kybflow.runtime.fleet.ground_truth import Clearances, Excursions, Impacts, ObjectContacts
from kybflow.runtime.fleet.inferred_contacts import InferredContacts
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.views import BelievedView, KnownObjects, TrueView
from kybflow.world.objects import TurnJoint, WorldObject
from kybflow.world.shapes import Box, MovingSphere, Sphere

FLOOR, WALL = Touch("the floor", carries=True), Touch("wall", carries=False)


@dataclass
class FakeVehicle:
    sinks: float
    may_touch_down: bool
    name: str = "a"
    slides: float = 0.0
    position: Vec3 = ZERO
    airborne: bool = True
    score: VehicleScore | None = None
    touches: str = ""

    def note_touch(self, touch):
        pass

    @property
    def truth(self):
        return Truth(self.position, (self.slides, 0.0, -self.sinks), LEVEL, ZERO, None)


class FakeLink:
    def report_touches(self, tell):
        self.tell = tell


CAR = WorldObject("car", ZERO, (0.2, 0.2, 0.2), 1.0)
PLATE = WorldObject("plate", ZERO, (0.2, 0.2, 0.2), 1.0, on="car")
BAR = WorldObject("bar", ZERO, (0.2, 0.2, 0.2), 1.0, on="car", joint=TurnJoint((0, 0, 1), -1, 1))
OBJECTS = {"car": CAR, "plate": PLATE, "bar": BAR}


def told(touch, sinks, *, lands, touches=""):
    """The event of a touch, and why the run has failed."""
    heard, link = [], FakeLink()
    vehicle = FakeVehicle(sinks, lands, touches=touches)
    impacts = Impacts([vehicle], {"a": link}, Events((heard.append,)), objects=OBJECTS)
    link.tell(touch)
    return [(event.name, event.fields) for event in heard], impacts.first


@pytest.mark.parametrize("sinks", [0.0, 1.4])
def test_a_landing_ends_on_the_ground(sinks):
    assert told(FLOOR, sinks, lands=True) == ([], None)


def test_a_landing_may_be_too_hard():
    events, reason = told(FLOOR, 1.6, lands=True)
    assert events == [("landed_hard", {"onto": "the floor", "speed": 1.6})]
    assert reason == "`a` landed hard (1.60 m/s) on `the floor`"


def test_a_landing_that_slides_is_as_hard():
    heard, link = [], FakeLink()
    vehicle = FakeVehicle(0.1, True, slides=2.0)
    impacts = Impacts([vehicle], {"a": link}, Events((heard.append,)))
    link.tell(FLOOR)
    assert impacts.first == "`a` landed hard (2.00 m/s) on `the floor`"


@pytest.mark.parametrize(
    ("position", "airborne", "expected"),
    [
        ((0.0, 0.0, 1.0), True, []),
        ((0.0, 2.05, 1.0), True, []),  # as far as an estimate may err
        ((0.0, 2.5, 1.0), True, [("fence_left", {"beyond": 0.5})]),
        ((0.0, 0.0, 3.5), True, [("fence_left", {"beyond": 1.0})]),
        ((0.0, 2.5, 0.0), False, []),
    ],
)
def test_a_flight_outside_the_fence_is_seen_once(position, airborne, expected):
    heard = []
    vehicle = FakeVehicle(0.0, True, position=position, airborne=airborne)
    fence = Box((-2.0, -2.0, 0.0), (2.0, 2.0, 2.5))
    excursions = Excursions([vehicle], fence, Events((heard.append,)))
    for _ in range(2):
        excursions.step()
    assert [(event.name, event.fields) for event in heard] == expected
    assert (excursions.first is not None) == bool(expected)


def test_the_run_says_how_far_the_first_vehicle_flew_outside_the_fence():
    told, fence = [], Box((-2.0, -2.0, 0.0), (2.0, 2.0, 2.5))
    a, b = (FakeVehicle(0.0, True, name=name, airborne=True) for name in "ab")
    excursions = Excursions([a, b], fence, Events((told.append,)))
    for far, near in ((2.0, 2.0), (2.5, 2.0), (4.26, 2.9), (3.0, 2.0)):
        a.position, b.position = (far, 0.0, 1.0), (near, 0.0, 1.0)
        excursions.step()
    assert excursions.first == "`a` flew 2.26 m outside the fence"
    assert [(event.vehicle, event.name) for event in told] == [
        ("a", "fence_left"),
        ("b", "fence_left"),
    ]


def test_the_least_clearance_in_the_air_is_scored():
    """Of the true state, from every obstacle that vehicles keep away from."""
    view = FakeView(hull=0.1, obstacles={"pole": Sphere((0.0, 0.0, 0.0), 0.2)})
    score = VehicleScore("a")
    vehicle = FakeVehicle(0.0, True, score=score)
    watched, empty = (Clearances([vehicle], {"a": view}, names) for names in (("pole",), ()))
    for east, airborne in ((2.0, True), (1.0, True), (3.0, True), (0.5, False)):
        view.position, vehicle.airborne = (east, 0.0, 0.0), airborne
        watched.step()
        empty.step()
    assert pytest.approx(score.min_clearance) == 0.7


def test_expectations_read_where_a_moving_obstacle_is_and_conditions_where_it_was_seen():
    ball = MovingSphere(((0.0, 0.0, 1.0), (4.0, 0.0, 1.0)), 0.25, 1.0)
    seen = SeenObstacle(3 * NS // 2, (1.0, 0.0, 1.0), ZERO, 0.25, 1.0)
    context = SimpleNamespace(obstacles={}, moving={"ball": ball})
    vehicle = SimpleNamespace(
        context=context,
        now=2 * NS,
        moving={"ball": seen},
        truth=Truth(ZERO, ZERO, LEVEL, ZERO, None),
    )
    contacts = ObjectContacts((), Events(()))
    known = KnownObjects({}, {}, TrueObjects({}, ()), InferredContacts((), {}, {}), contacts)
    true, believed = TrueView(vehicle, known), BelievedView(vehicle, known)
    assert true.obstacle("ball") == Sphere(ball.at(2.0), 0.25)
    assert believed.obstacle("ball") == Sphere((1.0, 0.0, 1.0), 0.75)  # half a second at 1 m/s
    vehicle.truth = None  # on hardware
    assert true.obstacle("ball") == believed.obstacle("ball")
    vehicle.moving = {}
    with pytest.raises(Unavailable):
        believed.obstacle("ball")


@pytest.mark.parametrize("sinks", [0.0, 1.6])
def test_the_floor_in_flight_is_a_collision_at_any_speed(sinks):
    events, reason = told(FLOOR, sinks, lands=False)
    assert events == [("collided", {"into": "the floor"})]
    assert reason == "`a` ran into `the floor`"


@pytest.mark.parametrize("lands", [True, False])
def test_what_carries_nobody_is_a_collision_of_one_that_lands_too(lands):
    assert told(WALL, 0.2, lands=lands)[0] == [("collided", {"into": "wall"})]


@pytest.mark.parametrize("touches", ["car", "plate"])
@pytest.mark.parametrize("into", ["car", "plate"])
def test_a_touch_that_is_meant_is_no_collision(touches, into):
    assert told(Touch(into, carries=False), 0.2, lands=False, touches=touches) == ([], None)


@pytest.mark.parametrize(("touches", "into"), [("", "car"), ("car", "bar"), ("bar", "car")])
def test_ramming_an_object_is_a_collision(touches, into):
    events, reason = told(Touch(into, carries=False), 0.2, lands=False, touches=touches)
    assert events == [("collided", {"into": into})]
    assert reason == f"`a` ran into `{into}`"
