"""A claim of touch-down counts where the estimate has the vehicle on something."""

from __future__ import annotations

from math import cos, sin

import pytest

from kybflow.core.geometry import LEVEL, ZERO
from kybflow.core.signals import NS, Estimate
from kybflow.runtime.vehicle.touch_down import CLAIM_TIME_NS, TouchDown
from kybflow.world.shapes import Box, Cylinder, Plane, Sphere
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(
    mass=0.23, diameter=0.2, inertia=(0.00045, 0.00045, 0.0008), thrust=1.3, rotor_time=0.03
)
OBSTACLES = {
    "table": Box((2.0, -1.0, 0.0), (3.0, 1.0, 0.7)),
    "barrel": Cylinder((-2.0, 0.0, 0.0), 0.3, 0.9),
    "ball": Sphere((0.0, 3.0, 0.0), 0.5),
    "wall": Plane((-5.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
}


def landing(start=ZERO, expected=(), off=0.0) -> TouchDown:
    context = VehicleContext("a", FRAME, start, 0.0, None, 0.004, obstacles=OBSTACLES)
    return TouchDown(context, expected, off)


def at(x: float, y: float, z: float, *, age=0.0, spread=0.001, attitude=LEVEL) -> Estimate:
    return Estimate(0, (x, y, z), ZERO, attitude, ZERO, "mocap", age, spread)


@pytest.mark.parametrize(
    "estimate",
    [
        at(0.0, 0.0, 0.01),
        at(5.0, 5.0, -0.3),
        at(2.5, 0.0, 0.76),
        at(-2.1, 0.2, 0.94),
        at(0.0, 3.05, 0.55),
        at(1.0, 0.0, 0.14, attitude=(cos(0.75), sin(0.75), 0.0, 0.0)),
        at(0.0, 0.0, 0.3, spread=0.15),
        at(0.0, 0.0, 2.0, age=0.5),
    ],
    ids=["floor", "pit", "table", "barrel", "ball", "on its side", "who knows", "stale"],
)
def test_it_may_be_on_something(estimate):
    assert landing().refusal(estimate, 0, is_pushed=True) == ""


@pytest.mark.parametrize(
    "estimate",
    [
        at(0.0, 0.0, 0.14),
        at(0.0, 0.0, 7.9),
        at(2.5, 0.0, 0.9),
        at(1.5, 0.0, 0.75),
        at(-4.9, 0.0, 0.5),
        at(2.5, 0.0, 0.4),
    ],
)
def test_a_fresh_estimate_in_the_air_refuses_it(estimate):
    assert landing().refusal(estimate, 0, is_pushed=True) != ""


def test_the_reason_says_how_high():
    reason = landing().refusal(at(0.0, 0.0, 7.9), 0, is_pushed=True)
    assert reason == "its estimated height above the ground is 7.90 m"


def test_without_an_estimate_nothing_contradicts():
    assert landing().refusal(None, 0, is_pushed=True) == ""


def test_it_may_stand_where_it_started_and_where_the_ground_is_expected():
    assert landing(start=(0.0, 0.0, 0.8)).refusal(at(0.2, 0.0, 0.8), 0, is_pushed=True) == ""
    assert landing(start=(0.0, 0.0, 0.8)).refusal(at(1.5, 0.0, 0.8), 0, is_pushed=True) != ""
    assert landing(expected=(0.4,)).refusal(at(1.5, 0.0, 0.42), 0, is_pushed=True) == ""


def test_an_estimate_that_was_off_at_the_start_is_off_by_as_much():
    assert landing(off=0.12).refusal(at(1.0, 0.0, 0.13), 0, is_pushed=True) == ""
    assert landing(off=2.0).refusal(at(1.0, 0.0, 1.0), 0, is_pushed=True) != ""


@pytest.mark.parametrize(
    ("height", "sinks", "pushed", "counts"),
    [
        (0.4, 0.0, True, True),
        (0.4, 0.0, False, False),
        (0.4, 0.02, True, False),
        (1.4, 0.0, True, False),
    ],
)
def test_on_what_nobody_named_a_claim_counts_that_is_made_for_long(height, sinks, pushed, counts):
    claims, period = landing(), NS // 50
    found = [
        claims.refusal(at(1.0, 0.0, height - sinks * now / NS), now, is_pushed=pushed)
        for now in range(0, CLAIM_TIME_NS + NS, period)
    ]
    assert found[CLAIM_TIME_NS // period - 1] != ""
    assert (found[-1] == "") is counts


def test_a_claim_that_was_withdrawn_begins_anew():
    claims = landing()
    for now in range(0, CLAIM_TIME_NS - NS, NS // 50):
        claims.refusal(at(1.0, 0.0, 0.4), now, is_pushed=True)
    assert claims.refusal(at(1.0, 0.0, 0.4), 2 * CLAIM_TIME_NS, is_pushed=True) != ""
