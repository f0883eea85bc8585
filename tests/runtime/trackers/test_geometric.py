"""geometric: its law, its rates, its limits; and it flies the figure eight better than cascade."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from plans import NANO, part, state, then, vehicle
from short_flights import down, hold, up

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    ZERO,
    add,
    body_z,
    from_euler,
    heading_of,
    scale,
    tilt_of,
)
from kybflow.core.signals import Command, Estimate, Setpoint, SetpointKind, Tick
from kybflow.flight.geometric_law import FRESH_S, MAX_LAG_S, ON_BOARD, SPREAD_SPEED, GeometricParams
from kybflow.runtime.trackers.geometric import Geometric
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(
    mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05, drag=0.0,
)  # fmt: skip
UP = (0.0, 0.0, 1.0)
DT = 0.004
small = st.tuples(*[st.floats(-0.3, 0.3)] * 3)


def geometric(frame=FRAME, **params) -> Geometric:
    given = {"mass_guess": 1.0, "trim": 0.0, "integral": 0.0, **params}
    tracker = Geometric(GeometricParams(**given), VehicleContext("a", frame, ZERO, 0.0, None, DT))
    tracker.update(at(ZERO), tick(ZERO))
    return tracker


def tick(position=UP, velocity=ZERO, attitude=LEVEL, dt=DT, age=0.0, spread=0.0) -> Tick:
    estimate = Estimate(0, position, velocity, attitude, ZERO, "mocap", age, spread)
    return Tick(0, dt, 0.0, estimate, None, None, {})


def at(position=UP, velocity=ZERO, acceleration=ZERO, jerk=ZERO, heading=0.0, **rest) -> Setpoint:
    kind = SetpointKind.POSITION
    return Setpoint(kind, position, velocity, acceleration, jerk, heading, **rest)


def slope(command: Command) -> tuple[float, float]:
    x, y, z = body_z(command.attitude)
    return (GRAVITY * x / z, GRAVITY * y / z)


HOVER = geometric().update(at(), tick()).thrust


def test_at_its_setpoint_it_stays_level() -> None:
    tracker = geometric()
    command = tracker.update(at(), tick())
    assert tilt_of(command.attitude) == pytest.approx(0.0, abs=1e-9)
    assert command.rates == (0.0, 0.0, 0.0)


@given(small, small, small)
def test_the_law_is_feed_forward_and_gains_times_errors_in_every_axis(error, speed, feed) -> None:
    error, speed, feed = scale(error, 0.05), scale(speed, 0.05), scale(feed, 0.5)
    here = tick(tuple(u - e for u, e in zip(UP, error, strict=True)), scale(speed, -1.0))
    command = geometric().update(at(acceleration=feed), here)
    x, y, z = add(feed, add(scale(error, 16.0), scale(speed, 9.0)))
    assert body_z(command.attitude)[0] / body_z(command.attitude)[2] == pytest.approx(
        x / (GRAVITY + z), abs=1e-9
    )
    assert command.thrust == pytest.approx(HOVER * (1.0 + z / GRAVITY))
    assert slope(command)[1] == pytest.approx(y * GRAVITY / (GRAVITY + z), abs=1e-9)


@pytest.mark.parametrize(("age", "spread"), [(FRESH_S + ON_BOARD, 0.0), (0.0, 0.4)])
def test_what_is_known_late_or_badly_is_followed_slower(age: float, spread: float) -> None:
    tracker, here = geometric(), (-0.02, 0.0, 1.0)
    assert slope(tracker.update(at(), tick(here)))[0] == pytest.approx(16.0 * 0.02)
    for _ in range(1500):
        command = tracker.update(at(), tick(here, age=age, spread=spread))
    slower = ON_BOARD / (ON_BOARD + min(MAX_LAG_S, age + spread / SPREAD_SPEED - FRESH_S))
    assert slope(command)[0] == pytest.approx(slower**2 * 16.0 * 0.02, rel=0.02)


def test_the_drag_of_the_rotors_is_given_back_in_their_plane() -> None:
    east = (1.0, 0.0, 0.0)
    command = geometric(replace(FRAME, drag=0.5)).update(at(velocity=east), tick(velocity=east))
    assert slope(command) == pytest.approx((0.5, 0.0))
    climb = (0.0, 0.0, 1.0)
    command = geometric(replace(FRAME, drag=0.5)).update(at(velocity=climb), tick(velocity=climb))
    assert command.thrust == pytest.approx(HOVER)


@given(small, small, st.floats(-3.0, 3.0), st.floats(-1.0, 1.0))
def test_its_rates_are_those_at_which_its_attitude_turns(feed, jerk, heading, rate) -> None:
    """Without feedback, the jerk alone turns it."""
    feed, jerk, step = scale(feed, 5.0), scale(jerk, 5.0), 1e-5
    tracker = geometric(tilt=1.2, derivative=1e-12)
    now = at(acceleration=feed, jerk=jerk, heading=heading, heading_rate=rate)
    soon = at(acceleration=add(feed, scale(jerk, step)), heading=heading + step * rate)
    first, second = tracker.update(now, tick()), tracker.update(soon, tick())
    assert first.rates == pytest.approx(turned(first, second, step), abs=2e-3)


def turned(first: Command, second: Command, step: float) -> tuple[float, float, float]:
    (w, x, y, z), (dw, dx, dy, dz) = first.attitude, second.attitude
    sign = 2.0 / step if w * dw + x * dx + y * dy + z * dz > 0.0 else -2.0 / step
    return (
        sign * (w * dx - x * dw - y * dz + z * dy),
        sign * (w * dy + x * dz - y * dw - z * dx),
        sign * (w * dz - x * dy + y * dx - z * dw),
    )


def test_feedback_turns_it_as_well() -> None:
    tracker = geometric()
    still = tracker.update(at(), tick(velocity=(0.1, 0.0, 0.0)))
    assert still.rates[1] == pytest.approx(-16.0 * 0.1 / GRAVITY, rel=0.01)


@given(
    position=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
    velocity=st.tuples(*[st.floats(-20.0, 20.0)] * 3),
    tilt=st.floats(0.05, 1.2),
    roll=st.floats(-1.5, 1.5),
)
def test_whatever_the_error_tilt_and_thrust_stay_within_the_airframe(
    position, velocity, tilt, roll
) -> None:
    tracker = geometric(tilt=tilt, integral=8.0)
    for _ in range(3):
        command = tracker.update(at(), tick(position, velocity, from_euler(roll, 0.0, 1.0)))
        assert tilt_of(command.attitude) <= min(tilt, FRAME.tilt) + 1e-9
        assert 0.0 <= command.thrust <= FRAME.max_thrust


def test_at_a_limit_and_on_the_ground_nothing_turns_ahead() -> None:
    away = geometric().update(at(jerk=(1.0, 0.0, 0.0)), tick((50.0, 0.0, 1.0)))
    resting = geometric().update(at(ZERO, jerk=(1.0, 0.0, 0.0)), tick(ZERO))
    assert away.rates == resting.rates == (0.0, 0.0, 0.0)


def test_heading_is_held_turned_and_told() -> None:
    tracker = geometric()
    turning = at()._replace(heading=None, heading_rate=0.5)
    for _ in range(250):
        command = tracker.update(turning, tick(attitude=from_euler(0.0, 0.0, 0.3)))
    assert heading_of(command.attitude) == pytest.approx(0.504, abs=0.005)
    assert command.rates[2] == pytest.approx(0.5)
    assert command.heading == pytest.approx(0.3)


def eight(tracker: str, lap: float) -> list:
    states = [
        up("steady", 1.0),
        state("steady", part("behaviors", "hover", for_time=3.0), then("eight")),
        state("eight", part("behaviors", "figure_eight", width=1.46, lap=lap), then("down")),
        down(),
    ]
    airframe = replace(NANO, speed=3.0)
    return [vehicle("a", states, airframe=airframe, tracker=part("trackers", tracker))]


def errors(flown) -> tuple[float, float, float, float]:
    behaviors = flown.summary["vehicles"]["a"]["behaviors"]
    score = next(b for b in behaviors if b["name"] == "eight")
    position, velocity = score["position_error_m"], score["velocity_error_m_s"]
    return position["mean"], position["max"], velocity["mean"], velocity["max"]


@pytest.mark.parametrize(
    "lap", [pytest.param(lap, marks=pytest.mark.thorough) for lap in (10.0, 5.0)]
)
def test_it_flies_the_eight_nearer_than_cascade(run, lap: float) -> None:
    cascade, _ = run(*eight("cascade", lap))
    flown, _ = run(*eight("geometric", lap))
    assert flown.summary["outcome"] == "succeeded"
    for own, other in zip(errors(flown), errors(cascade), strict=True):
        assert own < other


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.thorough)])
def test_it_hovers_in_place(run, seed: int) -> None:
    states = [up("hold"), hold(3.0, "down"), down()]
    flown, _ = run(vehicle("a", states, tracker=part("trackers", "geometric")), seed=seed)
    assert flown.summary["outcome"] == "succeeded"
    behaviors = flown.summary["vehicles"]["a"]["behaviors"]
    assert behaviors[1]["position_error_m"]["max"] < 0.05
