"""Conditions bound to live views."""

from __future__ import annotations

import pytest
from fake_view import FakeView

from kybflow.core.geometry import from_heading
from kybflow.core.units import LENGTH
from kybflow.dsl.diagnostics import Span, Text
from kybflow.dsl.expressions import Aggregate, Compare, Quantity, Read, Scope, parse
from kybflow.dsl.expressions.semantics import ObjectNames
from kybflow.runtime.conditions import reader_of
from kybflow.world.objects import ObjectState
from kybflow.world.shapes import Cylinder, Sphere

VEHICLES = {"a": ("up", "hover"), "b": ("up", "hover"), "c": ("up",)}


SCOPE = Scope("condition", VEHICLES, "a")


def asked(words: str, scope: Scope = SCOPE, now: float = 0.0, **views: FakeView) -> bool:
    text = Text(words, Span("m.yaml", 1, 1, 1, 1 + len(words)))
    expression, findings = parse(text, scope)
    assert findings == []
    assert expression is not None
    return reader_of(expression, {"a": FakeView(), **views}, "a", lambda: now)()


@pytest.mark.parametrize(
    ("words", "holds"),
    [
        ("state.altitude > 1 m", True),
        ("state.altitude < 1 m", False),
        ("state.altitude >= 2 m and state.altitude <= 2 m", True),
        ("1 m < state.altitude", True),
        ("not state.altitude > 1 m", False),
        ("behavior == up", True),
        ("behavior != up", False),
        ("a in up", True),
        ("a in hover or state.altitude > 1 m", True),
        ("a in hover or state.altitude > 3 m or elapsed > 1 s", False),
        ("a in up and state.altitude > 1 m and elapsed > 1 s", False),
        ("state.speed == state.climb", True),
        ("distance(a to [0 0 1]) < 1.5 m", True),
        ("distance(start to a) < 1.5 m", False),
    ],
)
def test_own_values(words: str, holds: bool) -> None:
    assert holds == asked(words, a=FakeView(position=(0.0, 0.0, 2.0)))


POLE, BALL = Cylinder((1.0, 0.0, 0.0), 0.25, 2.0), Sphere((0.0, 2.0, 1.0), 0.5)


@pytest.mark.parametrize(
    ("words", "holds"),
    [
        ("distance(a to pole) == 75 cm", True),  # from its surface
        ("distance(world.obstacles.pole to a) == 75 cm", True),
        ("distance(start to ball) > 1.7 m", True),
        ("distance([1 0 1] to pole) == -25 cm", True),  # inside
        ("clearance(a) == 65 cm", True),  # from the tips of its rotors
        ("clearance(b) > 2.2 m", True),  # not from `bar`, which may be touched
        ("separation(a and b) == 2 m", True),
        ("separation(a and b and pole) == 75 cm", True),
        ("separation(all and bar) == 0 m", True),
        ("separation(a and ball) == 1.5 m", True),
        ("distance(a to unseen) > 0 m", False),
        ("not clearance(a) > 1 m", True),
    ],
)
def test_distances_from_obstacles(words: str, holds: bool) -> None:
    solids = {"pole": POLE, "ball": BALL, "bar": Sphere((-3.0, 0.0, 1.0), 1.0)}
    kept = {"pole": True, "ball": True, "bar": False, "unseen": False}  # whether vehicles keep away
    a = FakeView(position=(0.0, 0.0, 1.0), hull=0.1, obstacles=solids)
    b = FakeView(position=(-2.0, 0.0, 1.0), hull=0.1, obstacles=solids)
    scope = Scope("condition", {"a": (), "b": ()}, "a", obstacles=kept)
    assert holds == asked(words, scope, a=a, b=b)


BAR = ObjectState((1.0, 0.0, 1.0), from_heading(0.2), (0.3, 0.4, 0.0), 0.2, -0.1)


@pytest.mark.parametrize(
    ("words", "holds"),
    [
        ("bar.x == 1 m and bar.z == 1 m", True),
        ("bar.speed == 50 cm/s", True),
        ("bar.yaw > 11 deg and bar.angle < 12 deg", True),
        ("bar.turn_rate < 0 rad/s", True),
        ("distance(a to bar) == 1 m", True),
        ("distance(bar.left to [1 1.5 1]) == 1 m", True),
        ("unseen.x < 1 m or unseen.x >= 1 m", False),
    ],
)
def test_values_of_objects(words: str, holds: bool) -> None:
    names = ObjectNames(("x", "z", "yaw", "speed", "angle", "turn_rate"), ("left",))
    scope = Scope("condition", {"a": ()}, "a", objects={"bar": names, "unseen": names})
    assert holds == asked(words, scope, a=FakeView(position=(0.0, 0.0, 1.0), objects={"bar": BAR}))


def test_values_are_read_anew_each_time() -> None:
    view = FakeView(position=(0.0, 0.0, 2.0))
    expression = Compare(">", Read(None, "state.altitude"), Quantity(1.0, LENGTH))
    condition = reader_of(expression, {"a": view}, "a", lambda: 0.0)
    assert condition()
    view.position = (0.0, 0.0, 0.5)
    assert not condition()


def test_the_clock() -> None:
    assert asked("time > 5 s", now=6.0)
    assert not asked("time > 5 s", now=5.0)


def test_other_vehicles() -> None:
    b = FakeView("hover", (3.0, 4.0, 0.0))
    assert asked("b in hover and distance(a to b) > 4.9 m", b=b)
    assert asked("distance(b to b.start) > 4.9 m", b=b)


def test_separation_is_that_of_the_nearest_two() -> None:
    b, c = FakeView(position=(3.0, 0.0, 0.0)), FakeView(position=(3.0, 0.5, 0.0))
    assert asked("separation(all) < 51 cm", b=b, c=c)
    assert asked("separation(a and b) > 2 m", b=b, c=c)


@pytest.mark.parametrize(
    "words", ["state.altitude > -9 m", "state.altitude < 9 m", "distance(a to b) < 9 m"]
)
def test_a_comparison_with_what_cannot_be_known_is_false(words: str) -> None:
    assert not asked(words, a=FakeView(position=None), b=FakeView())


def test_what_decides_first_is_all_that_is_read() -> None:
    view = FakeView()
    assert not asked("behavior == hover and state.altitude > 1 m", a=view)
    assert view.asked == []


def test_a_statistic_is_no_condition() -> None:
    aggregate = Aggregate("mean", Read("a", "position_error"))
    expression = Compare("<", aggregate, Quantity(1.0, LENGTH))
    with pytest.raises(TypeError, match="not a value of one tick"):
        reader_of(expression, {"a": FakeView()}, "a", lambda: 0.0)
