"""Freedoms of objects: what moves, how heavy it is, and what a push does to it."""

from __future__ import annotations

import pytest

from kybflow.core.geometry import GRAVITY, LEVEL
from kybflow.world.freedoms import freedoms_of
from kybflow.world.objects import (
    ObjectSurface,
    Placement,
    SlideJoint,
    TurnJoint,
    WorldObject,
)

CAR = WorldObject(
    "car", (0.5, 0.0, 0.8), (0.16, 0.16, 0.1), 1.0,
    joint=SlideJoint((1.0, 0.0, 0.0), -1.0, 3.0, friction=0.4),
)  # fmt: skip
BAR = WorldObject(
    "bar", (0.0, 0.0, 0.2), (0.06, 1.2, 0.06), 0.5, "car",
    joint=TurnJoint((0.0, 0.0, 1.0), -1.0, 1.0, friction=0.01),
    surfaces=(ObjectSurface("left", (-0.04, 0.45, 0.0), (-1.0, 0.0, 0.0), 0.4, 0.3),),
)  # fmt: skip
OBJECTS = {"car": CAR, "bar": BAR}


def test_a_bar_on_a_car_turns_and_slides() -> None:
    turn, slide = freedoms_of(OBJECTS, "bar")
    assert (turn.name, turn.turns) == ("bar.yaw", True)
    assert (slide.name, slide.turns) == ("car.position", False)
    assert slide.inertia == pytest.approx(CAR.mass + BAR.mass)
    assert [one.name for one in freedoms_of(OBJECTS, "car")] == ["car.position"]


def test_the_inertia_of_a_beam_is_that_of_a_box() -> None:
    beam = BAR._replace(surfaces=(), size=(0.04, 1.2, 0.04), mass=0.6)
    turn, _ = freedoms_of({"car": CAR, "bar": beam}, "bar")
    assert turn.inertia == pytest.approx(0.6 / 12.0 * (1.2**2 + 0.04**2))


def test_a_push_beside_the_axis_turns_and_slides() -> None:
    turn, slide = freedoms_of(OBJECTS, "bar")
    place = Placement((2.0, 0.0, 1.0), LEVEL)
    at, ahead = (2.0, 0.45, 1.0), (1.0, 0.0, 0.0)
    assert turn.lever(place, at, ahead) == pytest.approx(-0.45)
    assert slide.lever(place, at, ahead) == pytest.approx(1.0)


def test_a_free_object_moves_in_the_plane_against_the_friction_of_the_floor() -> None:
    box = WorldObject("box", (0.0, 0.0, 0.2), (0.4, 0.4, 0.4), 1.0, grip=0.2)
    found = {one.name: one for one in freedoms_of({"box": box}, "box")}
    assert set(found) == {"box.yaw", "box.x", "box.y"}
    assert found["box.x"].friction == pytest.approx(0.2 * GRAVITY)
