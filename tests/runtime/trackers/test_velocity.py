"""velocity: follows velocities, also against wind; positions through a bounded law."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from plans import part, state, then, vehicle
from short_flights import down, hold, up

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, body_z, scale, tilt_of
from kybflow.core.signals import Command, Estimate, Setpoint, SetpointKind, Tick
from kybflow.runtime.trackers.velocity import Velocity, VelocityParams
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(
    mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05, drag=0.0,
)  # fmt: skip
UP = (0.0, 0.0, 1.0)
DT = 0.004


def velocity(**params) -> Velocity:
    given = {"mass_guess": 1.0, "trim": 0.0, "integral": 0.0, **params}
    tracker = Velocity(VelocityParams(**given), VehicleContext("a", FRAME, ZERO, 0.0, None, DT))
    tracker.update(position(ZERO), tick(ZERO))
    return tracker


def tick(where=UP, speed=ZERO) -> Tick:
    estimate = Estimate(0, where, speed, LEVEL, ZERO, "mocap", 0.0, 0.0)
    return Tick(0, DT, 0.0, estimate, None, None, {})


def position(where=UP) -> Setpoint:
    return Setpoint(SetpointKind.POSITION, where, ZERO, ZERO, ZERO, 0.0)


def moving(wanted, acceleration=ZERO) -> Setpoint:
    return Setpoint(SetpointKind.VELOCITY, None, wanted, acceleration, heading=0.0)


def asked(command: Command) -> tuple[float, float]:
    x, y, z = body_z(command.attitude)
    return (GRAVITY * x / z, GRAVITY * y / z)


def test_it_takes_velocities_and_positions() -> None:
    assert {SetpointKind.POSITION, SetpointKind.VELOCITY} == Velocity.accepts


def test_a_velocity_error_is_pulled_at_wherever_the_vehicle_is() -> None:
    command = velocity().update(moving((0.2, 0.0, 0.0), (0.3, 0.1, 0.0)), tick((5.0, 5.0, 1.0)))
    assert asked(command) == pytest.approx((0.3 + 7.5 * 0.2, 0.1))


@pytest.mark.parametrize(("gap", "speed"), [(0.1, 0.12), (0.4, 0.48), (5.0, 0.5)])
def test_a_position_error_asks_for_a_bounded_velocity(gap: float, speed: float) -> None:
    there = (0.6 * gap, 0.8 * gap, 1.0)
    flown = scale((0.6, 0.8, 0.0), speed)
    assert asked(velocity().update(position(there), tick(speed=flown))) == pytest.approx(
        (0.0, 0.0), abs=1e-9
    )


def test_its_integral_takes_a_steady_push() -> None:
    tracker, speed = velocity(integral=4.5), 0.0
    for _ in range(2500):
        command = tracker.update(moving((0.3, 0.0, 0.0)), tick(speed=(speed, 0.0, 0.0)))
        speed += DT * (asked(command)[0] - 0.5)
    assert speed == pytest.approx(0.3, abs=1e-3)


def test_the_jerk_turns_it_ahead() -> None:
    setpoint = position()._replace(jerk=(0.8, 0.0, 0.0))
    assert velocity().update(setpoint, tick()).rates[1] == pytest.approx(0.8 / GRAVITY)


@given(
    where=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
    speed=st.tuples(*[st.floats(-20.0, 20.0)] * 3),
)
def test_whatever_the_error_tilt_and_thrust_stay_within_the_airframe(where, speed) -> None:
    tracker = velocity(integral=4.5)
    for setpoint in (position(), moving((1.0, 0.0, 0.0))):
        command = tracker.update(setpoint, tick(where, speed))
        assert tilt_of(command.attitude) <= FRAME.tilt + 1e-9
        assert 0.0 <= command.thrust <= FRAME.max_thrust


@pytest.mark.parametrize(
    "tracker",
    ["velocity", *(pytest.param(t, marks=pytest.mark.thorough) for t in ("cascade", "geometric"))],
)
def test_a_run_is_flown_as_far_and_as_fast_as_it_says(run, tracker: str) -> None:
    search = part("behaviors", "run_until", velocity=(0.5, 0.0, 0.0), at_most=1.5)
    states = [up("search"), state("search", search, then("hold")), hold(1.0, "down"), down()]
    flown, _ = run(vehicle("a", states, tracker=part("trackers", tracker)))
    assert flown.summary["outcome"] == "succeeded"
    scores = {b["name"]: b for b in flown.summary["vehicles"]["a"]["behaviors"]}
    assert scores["search"]["ended"] == "done"
    assert scores["search"]["velocity_error_m_s"]["max"] < 0.08
    assert flown.summary["vehicles"]["a"]["final"] == "ground"


@pytest.mark.thorough
def test_it_hovers_and_lands(run) -> None:
    states = [up("hold"), hold(3.0, "down"), down()]
    flown, _ = run(vehicle("a", states, tracker=part("trackers", "velocity")))
    assert flown.summary["outcome"] == "succeeded"
    behaviors = flown.summary["vehicles"]["a"]["behaviors"]
    assert behaviors[1]["position_error_m"]["max"] < 0.08
