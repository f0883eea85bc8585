"""Where objects on joints are, and how far from them a point is."""

from __future__ import annotations

from math import cos, pi, sin

import pytest

from kybflow.core.geometry import from_heading, heading_of
from kybflow.core.signals import SeenObject
from kybflow.world.objects import (
    WORLD,
    ObjectSurface,
    Placement,
    SlideJoint,
    TurnJoint,
    WorldObject,
    corners,
    distance_to,
    in_order,
    placements,
    seen_face,
    seen_object,
)

CAR = WorldObject(
    "car", (1.0, 2.0, 0.8), (0.2, 0.2, 0.1), 1.0, joint=SlideJoint((2.0, 0.0, 0.0), -1, 3)
)
BAR = WorldObject(
    "bar", (0.0, 0.0, 0.2), (0.1, 1.2, 0.1), 0.5, on="car",
    joint=TurnJoint((0.0, 0.0, 1.0), -1.0, 1.0),
    surfaces=(ObjectSurface("left", (-0.05, 0.5, 0.0), (-3.0, 0.0, 0.0), 0.4, 0.3),),
)  # fmt: skip
EVERY = {"bar": BAR, "car": CAR}


def test_an_object_moves_with_the_one_that_it_is_on():
    places = placements(EVERY, {"car": 0.5, "bar": 0.3})
    assert places["car"] == Placement((1.5, 2.0, 0.8), (1.0, 0.0, 0.0, 0.0))
    assert places["bar"].position == pytest.approx((1.5, 2.0, 1.0))
    assert heading_of(places["bar"].attitude) == pytest.approx(0.3)


def test_a_joint_s_direction_turns_with_its_object():
    turned = CAR._replace(heading=pi / 2)
    assert turned.placed(WORLD, 0.5).position == pytest.approx((1.0, 2.5, 0.8))
    below = Placement((0.0, 0.0, 0.0), from_heading(0.4))
    at = BAR._replace(at=(1.0, 0.0, 0.0)).placed(below, 0.2)
    assert at.position == pytest.approx((cos(0.4), sin(0.4), 0.0))
    assert heading_of(at.attitude) == pytest.approx(0.6)


def test_a_part_is_seen_by_what_it_is_a_part_of():
    plate = WorldObject("plate", (0.0, 0.6, 0.0), (0.1, 0.1, 0.1), 0.1, on="bar")
    knob = WorldObject(
        "knob", (0.0, 0.4, 0.0), (0.1, 0.1, 0.1), 0.1, on="plate",
        surfaces=(ObjectSurface("front", (-0.1, 0.0, 0.0), (-1.0, 0.0, 0.0), 0.2, 0.2),),
    )  # fmt: skip
    every = {**EVERY, "plate": plate, "knob": knob}
    bar = SeenObject(7, (5.0, 1.0, 1.0), from_heading(pi / 2), (0.2, 0.0, 0.0), pi / 2, 0.5)
    assert seen_object(every, {"bar": bar}, "bar") is bar
    seen = seen_object(every, {"bar": bar}, "knob")
    assert seen is not None
    assert seen.time == 7
    assert seen.position == pytest.approx((4.0, 1.0, 1.0))
    assert seen.velocity == pytest.approx((0.2, -0.5, 0.0))  # 0.5 rad/s at 1 m
    face = seen_face(every, {"bar": bar}, "knob.front")
    assert face is not None
    assert face.centre == pytest.approx((4.0, 0.9, 1.0))
    assert face.velocity == pytest.approx((0.25, -0.5, 0.0))
    assert seen_object(every, {}, "knob") is None


def test_objects_on_a_circle_or_on_nothing_are_left_out():
    lost = WorldObject("lost", (0.0,) * 3, (1.0,) * 3, 1.0, on="nowhere")
    round_a = WorldObject("a", (0.0,) * 3, (1.0,) * 3, 1.0, on="b")
    round_b = WorldObject("b", (0.0,) * 3, (1.0,) * 3, 1.0, on="a")
    assert [one.name for one in in_order([BAR, lost, round_a, CAR, round_b])] == ["car", "bar"]


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.0, 0.0, 0.0), -0.05),
        ((0.05, 0.0, 0.3), 0.25),
        ((-0.25, 0.5, 0.1), 0.2),  # before the plate, which is 30 cm high
        ((0.05 + 0.3, -0.6 - 0.4, 0.0), 0.5),
    ],
)
def test_a_distance_is_that_of_the_nearest_box_or_plate(point, expected):
    turned = Placement((5.0, 1.0, 1.0), from_heading(0.7))
    x, y, z = point
    seen = (5.0 + x * cos(0.7) - y * sin(0.7), 1.0 + x * sin(0.7) + y * cos(0.7), 1.0 + z)
    assert distance_to(BAR, turned, seen) == pytest.approx(expected, abs=1e-9)


def test_corners_are_those_of_the_box_and_its_plates():
    found = list(corners(BAR, WORLD))
    assert len(found) == 16
    assert min(x for x, _, _ in found) == pytest.approx(-0.05)
    assert max(y for _, y, _ in found) == pytest.approx(0.7)
    assert max(z for _, _, z in found) == pytest.approx(0.15)
