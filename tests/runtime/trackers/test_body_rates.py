"""body_rates: the attitude loop of this program, and flights on a vehicle that follows rates."""

from __future__ import annotations

from math import cos, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from onboard_control import RATES, following
from plans import part, state, then, vehicle
from short_flights import down, hold, up

from kybflow.core.geometry import (
    LEVEL,
    ZERO,
    Quat,
    Vec3,
    conjugate,
    from_heading,
    integrate,
    multiply,
    norm,
    rotate,
)
from kybflow.core.signals import CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.flight.geometric_law import GeometricParams
from kybflow.runtime.trackers.body_rates import BodyRates, BodyRatesParams, _turn
from kybflow.runtime.trackers.geometric import Geometric
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(
    mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05, drag=0.0,
)  # fmt: skip
SITE = VehicleContext("a", FRAME, ZERO, 0.0, None, 0.004)
UP: Vec3 = (0.0, 0.0, 1.0)
HERE = Setpoint(SetpointKind.POSITION, UP, ZERO, ZERO, ZERO, 0.0)


def rates(**params) -> BodyRates:
    return BodyRates(BodyRatesParams(mass_guess=1.0, **params), SITE)


def tick(attitude: Quat = LEVEL, where: Vec3 = UP) -> Tick:
    known = Estimate(0, where, ZERO, attitude, ZERO, "mocap", 0.0, 0.0)
    return Tick(0, 0.004, 0.0, known, None, None, {})


def turned(axis: Vec3, angle: float) -> Quat:
    s = sin(0.5 * angle)
    return (cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2])


def test_level_and_in_place_it_asks_for_no_rate() -> None:
    command = rates().update(HERE, tick())
    assert command.kind is CommandKind.RATES_THRUST
    assert command.rates == pytest.approx(ZERO, abs=1e-12)


@pytest.mark.parametrize(
    ("axis", "gain"), [((1.0, 0.0, 0.0), 8.0), ((0.0, 1.0, 0.0), 8.0), ((0.0, 0.0, 1.0), 2.5)]
)
@pytest.mark.parametrize("angle", [-0.2, 0.3])
def test_an_attitude_error_is_turned_back_about_its_axis(
    axis: Vec3, gain: float, angle: float
) -> None:
    command = rates(attitude=8.0, turn=2.5).update(HERE, tick(turned(axis, angle)))
    expected = tuple(-gain * angle * x for x in axis)
    assert command.rates == pytest.approx(expected, abs=1e-9)


def test_half_a_turn_and_more_is_made_the_shorter_way() -> None:
    assert _turn(turned((0.0, 0.0, 1.0), 2.0)) == pytest.approx((0.0, 0.0, 2.0))
    assert _turn(turned((0.0, 0.0, 1.0), 5.0)) == pytest.approx((0.0, 0.0, 5.0 - 6.283185307))
    assert _turn(LEVEL) == ZERO


@pytest.mark.thorough
@given(
    axis=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: norm(v) > 0.1),
    angle=st.floats(-1.5, 1.5),
)
@settings(max_examples=40)
def test_followed_it_brings_the_attitude_home(axis: Vec3, angle: float) -> None:
    size = norm(axis)
    attitude = turned((axis[0] / size, axis[1] / size, axis[2] / size), angle)
    tracker = rates()
    for _ in range(1500):
        attitude = integrate(attitude, tracker.update(HERE, tick(attitude)).rates, 0.004)
    goal = tracker._law.command(tracker.params, HERE, tick(attitude)).attitude
    assert norm(_turn(multiply(conjugate(attitude), goal))) < 1e-3


def test_the_feed_forward_of_the_law_is_turned_into_the_body_that_flies() -> None:
    setpoint = HERE._replace(jerk=(0.8, 0.0, 0.0), heading_rate=0.3)
    attitude = from_heading(0.4)
    geometric = Geometric(GeometricParams(mass_guess=1.0), SITE)
    for tracker in (own := rates(fastest=50.0), geometric):  # the law looks at the last thrust
        tracker.update(setpoint, tick())
    wanted = geometric.update(setpoint, tick(attitude))
    sent = own.update(setpoint, tick(attitude))
    off = multiply(conjugate(attitude), wanted.attitude)
    error, feed = _turn(off), rotate(off, wanted.rates)
    gains = (8.0, 8.0, 2.5)
    expected = tuple(k * e + f for k, e, f in zip(gains, error, feed, strict=True))
    assert sent.rates == pytest.approx(expected)
    assert norm(feed) > 0.05
    assert (sent.attitude, sent.thrust) == (wanted.attitude, wanted.thrust)


@given(
    where=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
    axis=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: norm(v) > 0.1),
    angle=st.floats(-3.1, 3.1),
)
def test_whatever_the_error_the_rates_are_bounded(where: Vec3, axis: Vec3, angle: float) -> None:
    size = norm(axis)
    attitude = turned((axis[0] / size, axis[1] / size, axis[2] / size), angle)
    command = rates(fastest=3.0).update(HERE, tick(attitude, where))
    assert norm(command.rates) <= 3.0 + 1e-9
    assert 0.0 <= command.thrust <= FRAME.max_thrust


def test_an_option_that_changes_counts_in_the_next_tick() -> None:
    tracker = rates()
    tracker.params = BodyRatesParams(mass_guess=1.0, attitude=4.0)
    command = tracker.update(HERE, tick(turned((1.0, 0.0, 0.0), 0.1)))
    assert command.rates[0] == pytest.approx(-0.4)


@pytest.mark.thorough
def test_a_vehicle_that_follows_rates_flies_a_mission_by_it(run) -> None:
    driver, opened = following(RATES)
    eight = part("behaviors", "figure_eight", width=1.2, lap=7.0)
    states = [up("eight", 0.8), state("eight", eight, then("hold")), hold(1.0, "down"), down()]
    flown, _ = run(vehicle("a", states, tracker=part("trackers", "body_rates"), driver=driver))
    assert flown.summary["outcome"] == "succeeded"
    assert flown.summary["vehicles"]["a"]["final"] == "ground"
    scores = {b["name"]: b for b in flown.summary["vehicles"]["a"]["behaviors"]}
    assert scores["eight"]["ended"] == "done"
    assert scores["eight"]["position_error_m"]["max"] < 0.05
    assert opened["a"].kinds == {CommandKind.RATES_THRUST}
