"""The cascade tracker: its law, its limits, what it learns."""

from __future__ import annotations

from dataclasses import replace
from math import hypot, tan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.geometry import GRAVITY, LEVEL, ZERO, body_z, from_euler, heading_of, tilt_of
from kybflow.core.signals import CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.flight.force_estimates import MassEstimator
from kybflow.runtime.trackers.cascade import Cascade, CascadeParams
from kybflow.world.vehicle_context import Airframe, VehicleContext

FRAME = Airframe(
    mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05, drag=0.0,
)  # fmt: skip
UP = (0.0, 0.0, 1.0)
DT = 0.004


def cascade(frame=FRAME, **params):
    return Cascade(
        CascadeParams(**{"mass_guess": 1.0, **params}),
        VehicleContext("a", frame, ZERO, 0.0, None, DT),
    )


def tick(position=UP, velocity=ZERO, attitude=LEVEL, dt=DT):
    estimate = Estimate(0, position, velocity, attitude, ZERO, "mocap", 0.0, 0.0)
    return Tick(0, dt, 0.0, estimate, None, None, {})


def at(position=UP, velocity=ZERO, acceleration=ZERO, jerk=None, **rest):
    return Setpoint(SetpointKind.POSITION, position, velocity, acceleration, jerk, 0.0, **rest)


def flying(tracker, weight=None):
    """The tracker after it has lifted off from the ground, hovering."""
    tracker.update(at(ZERO), tick(ZERO))
    for _ in range(2500):
        command = tracker.update(at(), tick())
        if weight is not None:
            command = hover(tracker, weight)
    assert command.armed
    return tracker


def hover(tracker, weight, seconds=0.0):
    """Let it carry `weight` newtons: what thrust is too much accelerates the vehicle."""
    height, speed = 1.0, 0.0
    for _ in range(round(seconds / DT) + 1):
        command = tracker.update(at(), tick((0.0, 0.0, height), (0.0, 0.0, speed)))
        speed += DT * (command.thrust - weight) / (weight / GRAVITY)
        height += DT * speed
    return command


def asked(command):
    """Horizontal acceleration that a level-flying vehicle gets from a command's slope."""
    x, y, z = body_z(command.attitude)
    return (GRAVITY * x / z, GRAVITY * y / z)


def test_it_takes_every_kind_of_motion_and_gives_attitude_and_thrust():
    kinds = {SetpointKind.POSITION, SetpointKind.VELOCITY, SetpointKind.ACCELERATION}
    assert kinds == Cascade.accepts
    assert CommandKind.ATTITUDE_THRUST is Cascade.emits


def test_at_its_setpoint_it_stays_level_at_hover_thrust():
    tracker = flying(cascade())
    command = tracker.update(at(), tick())
    assert tilt_of(command.attitude) == pytest.approx(0.0, abs=1e-9)
    assert command.thrust == pytest.approx(tracker.hover_thrust)
    assert command.rates == (0.0, 0.0, 0.0)


@given(
    error=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    speed=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)),
    feed=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
)
def test_the_law_is_feed_forward_and_gains_times_errors(error, speed, feed):
    tracker = cascade(integral=0.0, trim=0.0)
    tracker.update(at(ZERO), tick(ZERO))
    here = tick((-error[0], -error[1], 1.0), (-speed[0], -speed[1], 0.0))
    command = tracker.update(at(acceleration=(*feed, 0.0)), here)
    expected = [f + 9.0 * e + 7.5 * v for f, e, v in zip(feed, error, speed, strict=True)]
    assert asked(command) == pytest.approx(expected, abs=1e-6)


STIFF = ((4.0, 1.0, 0.0), (1.0, 16.0, 0.0), (0.0, 0.0, 2.0))
ALIKE = ((9.0, 0.0, 0.0), (0.0, 9.0, 0.0), (0.0, 0.0, 9.0))


@given(st.tuples(*[st.floats(-0.05, 0.05)] * 3))
def test_a_matrix_of_gains_stands_in_place_of_the_proportional(error):
    ex, ey, ez = error
    trackers = [
        cascade(position_gain=STIFF, proportional=1.0, integral=0.0, trim=0.0),
        cascade(proportional=2.0, integral=0.0, trim=0.0),
    ]
    command, upwards = (t.update(at(), tick((-ex, -ey, 1.0 - ez))) for t in trackers)
    ax, ay, az = 4.0 * ex + ey, ex + 16.0 * ey, GRAVITY + 2.0 * ez
    x, y, z = body_z(command.attitude)
    assert (x / z, y / z) == pytest.approx((ax / az, ay / az), abs=1e-6)
    assert command.thrust == pytest.approx(upwards.thrust)


@given(st.tuples(*[st.floats(-0.5, 0.5)] * 3), st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_a_matrix_that_is_alike_in_every_direction_changes_nothing(position, velocity):
    alike, plain = cascade(position_gain=ALIKE), cascade()
    for _ in range(3):
        here = tick(position, velocity)
        assert alike.update(at(), here) == plain.update(at(), here)


def test_a_velocity_setpoint_has_no_matrix_either():
    moving = Setpoint(SetpointKind.VELOCITY, None, (0.2, 0.0, 0.0), heading=0.0)
    commands = [cascade(**of).update(moving, tick()) for of in ({}, {"position_gain": STIFF})]
    assert commands[0] == commands[1]


def test_the_rotors_drag_is_given_back():
    tracker = cascade(replace(FRAME, drag=0.5), integral=0.0, trim=0.0)
    command = tracker.update(at(velocity=(1.0, 0.0, 0.0)), tick(velocity=(1.0, 0.0, 0.0)))
    assert asked(command) == pytest.approx((0.5, 0.0))


def test_a_velocity_setpoint_has_no_position_term_and_an_acceleration_none_but_its_own():
    away = tick((5.0, 5.0, 1.0), (0.1, 0.0, 0.0))
    moving = Setpoint(SetpointKind.VELOCITY, None, (0.2, 0.0, 0.0), heading=0.0)
    assert asked(cascade().update(moving, away)) == pytest.approx((0.75, 0.0))
    pushing = Setpoint(SetpointKind.ACCELERATION, None, None, (0.0, 0.3, 0.0), heading=0.0)
    assert asked(cascade().update(pushing, away)) == pytest.approx((0.0, 0.3))


@given(
    position=st.tuples(*[st.floats(-50.0, 50.0)] * 3),
    velocity=st.tuples(*[st.floats(-20.0, 20.0)] * 3),
    tilt=st.floats(0.05, 1.2),
)
def test_whatever_the_error_tilt_and_thrust_stay_within_the_airframe(position, velocity, tilt):
    tracker = cascade(tilt=tilt, trim=0.0)
    tracker.update(at(ZERO), tick(ZERO))
    for _ in range(3):
        command = tracker.update(at(), tick(position, velocity))
        assert tilt_of(command.attitude) <= min(tilt, FRAME.tilt) + 1e-9
        assert 0.0 <= command.thrust <= FRAME.max_thrust


def test_the_same_gains_ask_the_same_of_a_small_airframe():
    small = replace(FRAME, mass=0.2, thrust=1.2)
    commands = [
        cascade(frame, integral=0.0).update(at((0.05, 0.0, 1.02)), tick())
        for frame in (FRAME, small)
    ]
    assert commands[0].attitude == pytest.approx(commands[1].attitude)
    assert commands[0].thrust == pytest.approx(5.0 * commands[1].thrust)


def test_a_lasting_error_is_integrated_up_to_its_limit():
    tracker = flying(cascade(trim=0.0, integral_limit=0.3))
    for _ in range(5000):
        command = tracker.update(at((0.05, 0.0, 1.0)), tick())
    assert asked(command)[0] == pytest.approx(9.0 * 0.05 + 0.3, rel=1e-3)


def test_nothing_winds_up_on_the_ground_at_the_tilt_limit_or_in_a_long_step():
    grounded = cascade(trim=0.0)
    for _ in range(500):
        grounded.update(at((0.1, 0.0, 0.0)), tick(ZERO))
    saturated = flying(cascade(trim=0.0))
    for _ in range(500):
        saturated.update(at((2.0, 0.0, 1.0)), tick())
    late = flying(cascade(trim=0.0))
    for _ in range(500):
        late.update(at((0.1, 0.0, 1.0)), tick(dt=0.1))
    for tracker in (grounded, saturated, late):
        tracker.update(at(), tick())
        assert asked(tracker.update(at(), tick()))[0] == pytest.approx(0.0, abs=0.05)


def test_jerk_turns_the_attitude_as_fast_as_the_acceleration_changes():
    tracker = cascade(integral=0.0, trim=0.0)
    step, jerk = 1e-4, (0.8, -0.5, 0.0)
    first = tracker.update(at(acceleration=(0.3, 0.2, 0.0), jerk=jerk), tick())
    later = at(acceleration=(0.3 + step * jerk[0], 0.2 + step * jerk[1], 0.0), jerk=jerk)
    second = tracker.update(later, tick())
    (w, x, y, z), (dw, dx, dy, dz) = first.attitude, second.attitude
    turned = (
        2.0 * (w * dx - x * dw - y * dz + z * dy) / step,
        2.0 * (w * dy + x * dz - y * dw - z * dx) / step,
    )
    assert first.rates[:2] == pytest.approx(turned, rel=1e-2)


def test_heading_is_held_turned_and_told():
    tracker = cascade()
    turning = at()._replace(heading=None, heading_rate=0.5)
    for _ in range(250):
        command = tracker.update(turning, tick(attitude=from_euler(0.0, 0.0, 0.3)))
    assert heading_of(command.attitude) == pytest.approx(0.5, abs=1e-6)
    assert command.rates[2] == pytest.approx(0.5)
    assert command.heading == pytest.approx(0.3)


def test_it_begins_with_the_guess():
    assert cascade(mass_guess=0.8).hover_thrust == pytest.approx(0.8 * FRAME.hover_thrust)


@pytest.mark.parametrize("guess", [0.5, 0.8, 1.2, 2.0])
@pytest.mark.parametrize("ratio", [0.7, 1.0, 1.4])
def test_it_learns_the_mass_in_the_air_within_seconds(guess, ratio):
    tracker = cascade(mass_guess=guess)
    tracker.update(at(ZERO), tick(ZERO))
    weight = ratio * FRAME.hover_thrust
    hover(tracker, weight, seconds=8.0)
    assert tracker.hover_thrust == pytest.approx(weight, rel=0.01)


def test_on_the_ground_thrust_rises_until_it_lifts_and_that_is_the_first_estimate():
    tracker = cascade(mass_guess=1.6)
    a_little_up = at((0.0, 0.0, 0.03))
    rising = [tracker.update(a_little_up, tick(ZERO)).thrust for _ in range(10)]
    assert rising == sorted(rising)
    assert rising[0] < FRAME.hover_thrust
    assert tracker.hover_thrust == pytest.approx(1.6 * FRAME.hover_thrust)
    tracker.update(a_little_up, tick((0.0, 0.0, 0.03)))
    assert tracker.hover_thrust == pytest.approx(FRAME.hover_thrust, rel=0.01)


def test_a_height_that_wavers_on_the_ground_does_not_end_the_spool_up():
    tracker = cascade()
    a_little_up = at((0.0, 0.0, 0.3))
    tracker.update(a_little_up, tick(ZERO))
    tracker.update(a_little_up, tick((0.0, 0.0, 0.03)))
    assert tracker.hover_thrust < 0.7 * FRAME.hover_thrust
    for _ in range(250):
        last = tracker.update(a_little_up, tick(ZERO)).thrust
    assert last > FRAME.hover_thrust


def test_an_estimate_that_stands_still_teaches_no_mass():
    """On the ground the thrust would rise for as long as nobody sees that the vehicle lifts."""
    tracker = cascade()
    a_little_up = at((0.0, 0.0, 0.3))
    tracker.update(a_little_up, tick(ZERO))
    before = tracker.update(a_little_up, tick(ZERO)).thrust
    for count in range(60):
        moment = tick(ZERO)
        old = moment.estimate._replace(age=count * moment.dt)
        last = tracker.update(a_little_up, moment._replace(estimate=old)).thrust
    assert last < 1.02 * before


def test_in_flight_below_its_start_it_does_not_spool_up():
    tracker = cascade()
    tracker.update(at((0.0, 0.0, 1.5)), tick((0.0, 0.0, 1.0)))
    hover(tracker, FRAME.hover_thrust, seconds=8.0)
    believed = tracker.hover_thrust
    for _ in range(250):
        tracker.update(at((0.0, 0.0, 0.8)), tick((0.0, 0.0, -0.5)))
    assert tracker.hover_thrust == pytest.approx(believed, rel=0.01)


def test_it_does_not_spool_up_unless_it_is_asked_to_rise():
    tracker = cascade()
    first = tracker.update(at(ZERO), tick(ZERO)).thrust
    for _ in range(500):
        last = tracker.update(at(ZERO), tick(ZERO)).thrust
    assert last == pytest.approx(first)


@given(
    lift=st.floats(-100.0, 100.0),
    speed=st.floats(-50.0, 50.0),
    dt=st.floats(1e-4, 0.2),
    guess=st.floats(0.5, 2.0),
)
def test_the_believed_mass_stays_within_its_bounds(lift, speed, dt, guess):
    mass = MassEstimator(9.81, guess)
    for n in range(200):
        mass.update(lift, speed * (-1) ** n, dt)
        assert 0.5 - 1e-9 <= mass.ratio <= 2.0 + 1e-9


def test_an_on_board_attitude_that_errs_is_turned_back():
    tracker, error = flying(cascade(integral=0.0)), 0.03
    for _ in range(1500):
        command = tracker.update(at(), tick(attitude=_shown(tracker, error)))
    assert asked(command)[0] == pytest.approx(-GRAVITY * tan(error), rel=0.05)


def _shown(tracker, error):
    """The attitude that flies when the on-board one errs by `error` about y."""
    x, _ = tracker._steering.trim
    return from_euler(0.0, x + error, 0.0)


def test_it_holds_still_in_a_simple_world_with_a_disturbance():
    """A point mass whose attitude follows at once, pushed by a steady 0.5 m/s^2."""
    tracker = flying(cascade(trim=0.0))
    x, v = 0.0, 0.0
    for _ in range(2500):
        command = tracker.update(at(), tick((x, 0.0, 1.0), (v, 0.0, 0.0)))
        v += DT * (asked(command)[0] + 0.5)
        x += DT * v
    assert hypot(x, v) < 1e-3
