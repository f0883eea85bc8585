"""The air over the floor and below other vehicles."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sqrt

import numpy
import pytest
from sim_worlds import FRAME, QUIET, push, seat, thrust, world

from kybflow.core.geometry import ZERO
from kybflow.drivers.sim.lab import Downwash, GroundEffect, as_flown
from kybflow.world.vehicle_context import LEGS

LAB = replace(as_flown(QUIET), calm=False)
"""A lab that does nothing to a vehicle but what a test asks for."""
HOVER = FRAME.mass * 9.81
HOLDS = HOVER / 4.0 / FRAME.thrust
"""The part of each rotor's largest thrust that holds it."""
RADIUS = 0.125
"""Of a rotor of that airframe, a quarter of its 0.5 m."""
INDUCED = sqrt(HOVER / (2.0 * 1.2 * 4.0 * pi * RADIUS**2))
"""What its rotors induce in hover, m/s."""


def hovering(*heights, **facts):
    """Vehicles above each other whose rotors already give what holds them, and the speed along z
    that each has after 40 ms of that."""
    params = replace(LAB, inflow=2.0, **facts)
    names = "abc"[: len(heights)]
    session = world(*(seat(name, (5.0 * i, 0.0, 0.0), params) for i, name in enumerate(names)))
    for link in session.links.values():
        link.send(thrust(HOVER), 0)
    states = session.data.qpos.reshape(len(heights), 7)
    for index, height in enumerate(heights):
        states[index, :3] = (0.0, 0.0, height)
        session.onboard.rotors[index] = session.onboard.controls[index] = (HOLDS,) * 4
        session.onboard.loops[index] = (*ZERO, HOLDS, *ZERO)
    session.apply_faults(0)  # forgets where they stood
    push(session, session.links["a"], 0.04, thrust(HOVER))
    return session, session.data.qvel.reshape(len(heights), 6)[:, 2].tolist()


@pytest.mark.parametrize(
    ("radii", "gain"), [(0.1, 0.430), (0.5, 0.430), (1.0, 0.159), (2.0, 0.0886), (20.0, 0.00185)]
)
def test_thrust_grows_over_the_floor(radii: float, gain: float) -> None:
    """By hand from the equation, over the rotors' radius: d = 2.83, b = 4."""
    ground = GroundEffect(FRAME, 1.0)
    assert ground.gain(radii * RADIUS) == pytest.approx(gain, rel=0.02)
    assert GroundEffect(FRAME, 0.5).gain(RADIUS) == pytest.approx(0.5 * ground.gain(RADIUS))


def test_a_quadrotors_gain_is_more_than_one_rotors_and_less_than_four_in_one_place() -> None:
    for z in numpy.linspace(0.6, 4.0, 20):
        alone, together = (1.0 / (1.0 - (r / 4.0 / z) ** 2) - 1.0 for r in (1.0, 4.0))
        assert alone < GroundEffect(FRAME, 1.0).gain(z * RADIUS) < abs(together)


def test_a_vehicle_in_hover_over_the_floor_rises() -> None:
    height = 2.0 * RADIUS - LEGS
    _, [rises] = hovering(height, ground_effect=1.0)
    _, [stays] = hovering(height)
    assert rises - stays == pytest.approx(0.0886 * 9.81 * 0.04, rel=0.05)


@pytest.mark.parametrize(
    ("depth", "aside", "speed"),
    [
        (2.0, 0.0, 10.11 / 7.817),
        (2.0, 0.07668 * 7.817, 10.11 / 7.817 / 2.0),
        (10.0, 0.0, 10.11 / 15.817),
        (0.0, 0.0, 0.0),
        (-1.0, 0.0, 0.0),
        (0.1, 3.0, 0.0),
    ],
)
def test_air_sinks_below_a_vehicle(depth: float, aside: float, speed: float) -> None:
    """Over what its rotors induce; lengths over its diameter."""
    jet = Downwash(FRAME, 1.0).jet((1.0, 2.0, 3.0), HOVER)
    place = (1.0 + 0.5 * aside * 0.6, 2.0 - 0.5 * aside * 0.8, 3.0 - 0.5 * depth)
    assert jet.sinks(place) == pytest.approx(speed * INDUCED, abs=1e-9)


def test_a_heavier_vehicle_blows_harder() -> None:
    light, heavy = (Downwash(FRAME, 1.0).jet(ZERO, n * HOVER) for n in (1.0, 4.0))
    assert heavy.sinks((0.0, 0.0, -1.0)) == pytest.approx(2.0 * light.sinks((0.0, 0.0, -1.0)))


def test_a_vehicle_below_another_is_pushed_down_and_more_below_two() -> None:
    _, still = hovering(4.0, 3.0, 2.0)
    session, speeds = hovering(4.0, 3.0, 2.0, downwash=1.0)
    lost = [before - now for before, now in zip(still, speeds, strict=True)]
    near, far = (10.11 / (5.817 + depth) * INDUCED for depth in (2.0, 4.0))
    sinks = (0.0, near, sqrt(near**2 + far**2))
    expected = [2.0 * FRAME.drag * speed * 0.04 for speed in sinks]
    assert lost == pytest.approx(expected, rel=0.06, abs=1e-9)
    assert [session.onboard.winds[i][2] for i in range(3)] == pytest.approx(
        [-speed for speed in sinks], rel=0.02
    )


def test_neighbours_at_one_height_leave_each_other_in_peace() -> None:
    jet = Downwash(FRAME, 1.0).jet((0.0, 0.0, 1.0), HOVER)
    assert jet.sinks((0.9, 0.0, 0.99)) < 0.005


def test_rotors_at_rest_blow_nothing() -> None:
    assert Downwash(FRAME, 1.0).jet(ZERO, 0.0).sinks((0.0, 0.0, -1.0)) == 0.0
