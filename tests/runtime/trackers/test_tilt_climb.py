"""tilt_climb: a tilt at the estimated heading, a climb rate and a heading rate, each bounded."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, hypot, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.core.geometry import GRAVITY, ZERO, body_z, from_heading, tilt_of
from kybflow.core.signals import CommandKind, Estimate, Setpoint, SetpointKind, Tick
from kybflow.flight.loops.margins import margins
from kybflow.flight.loops.position_loop import (
    FASTEST,
    PLANNED,
    OuterLoop,
    holds,
    margins_of,
    vertical,
)
from kybflow.runtime.trackers.tilt_climb import TiltClimb, TiltClimbParams, delay
from kybflow.world.vehicle_context import Airframe, InnerLoop, VehicleContext, attitude_loop

FRAME = Airframe(
    mass=0.42, diameter=0.36, inertia=(0.00224, 0.00299, 0.0048), thrust=1.7, rotor_time=0.03,
    tilt=0.2, climb=0.7, attitude_gain=10.0, rate_gain=24.0,
)  # fmt: skip
SLOW = InnerLoop(FRAME.attitude_loop, 0.03, command_latency=0.07, climb_time=0.7)
UP = (0.0, 0.0, 1.0)
metres = st.floats(-5.0, 5.0)


def tracker(loop=None, frame=FRAME, **params) -> TiltClimb:
    given = {"integral": 0.0, "proportional": 4.0, "derivative": 4.0, **params}
    context = VehicleContext("a", frame, ZERO, 0.0, None, 0.01, loop=loop)
    made = TiltClimb(TiltClimbParams(**given), context)
    made.update(position(ZERO), tick(ZERO))
    return made


def tick(where=UP, speed=ZERO, heading=0.0) -> Tick:
    estimate = Estimate(0, where, speed, from_heading(heading), ZERO, "mocap", 0.0, 0.0)
    return Tick(0, 0.01, 0.0, estimate, None, None, {})


def position(where=UP, **more) -> Setpoint:
    return Setpoint(SetpointKind.POSITION, where, **{"velocity": ZERO, "heading": 0.0, **more})


def asked(command) -> tuple[float, float]:
    x, y, z = body_z(command.attitude)
    return (GRAVITY * x / z, GRAVITY * y / z)


def climb(command) -> float:
    return command.setpoint.velocity[2]


def test_at_its_setpoint_it_asks_for_nothing() -> None:
    command = tracker().update(position(), tick())
    assert command.kind is CommandKind.TILT_CLIMB
    assert asked(command) == pytest.approx((0.0, 0.0))
    assert climb(command) == 0.0
    assert command.rates == ZERO


def test_errors_become_tilt_climb_and_turn() -> None:
    aside = position((0.2, -0.1, 1.3), heading=0.2)
    command = tracker().update(aside, tick(speed=(0.05, 0.0, 0.0)))
    assert asked(command) == pytest.approx((4.0 * 0.2 - 4.0 * 0.05, -0.4))
    assert climb(command) == pytest.approx(0.3)
    assert command.rates[2] == pytest.approx(0.3)


@given(st.floats(-pi, pi), metres, metres)
def test_the_tilt_points_where_it_should_whatever_the_heading(heading, x, y) -> None:
    command = tracker().update(position((x, y, 1.0), heading=heading), tick(heading=heading))
    ax, ay = asked(command)
    assert ax * y - ay * x == pytest.approx(0.0, abs=1e-6)
    assert tilt_of(command.attitude) <= FRAME.tilt + 1e-9
    assert command.heading == pytest.approx(heading)


@given(metres, metres, metres, st.floats(-pi, pi))
def test_nothing_is_beyond_its_limit(x, y, z, heading) -> None:
    command = tracker(turn_rate=1.0).update(position((x, y, z), heading=heading), tick())
    assert abs(climb(command)) <= FRAME.climb
    assert abs(command.rates[2]) <= 1.0
    assert hypot(*asked(command)) <= GRAVITY * 0.203


def test_what_comes_late_is_asked_for_earlier() -> None:
    moving = position(acceleration=(0.5, 0.0, 0.2), jerk=(1.0, 0.0, 0.0))
    command = tracker(SLOW).update(moving, tick())
    assert delay(SLOW) == pytest.approx(0.1 + 0.07)
    assert asked(command)[0] == pytest.approx(0.5 + 1.0 * 0.17)
    assert climb(command) == pytest.approx(0.7 * 0.2)


def test_the_integral_grows_in_the_air_to_its_limit_and_not_on_the_ground() -> None:
    flying, standing = (tracker(integral=2.0, integral_limit=0.3) for _ in range(2))
    for _ in range(300):
        up = flying.update(position((0.1, 0.0, 1.0)), tick())
        down = standing.update(position((0.1, 0.0, 0.0)), tick(ZERO))
    assert asked(up)[0] == pytest.approx(0.4 + 0.3)
    assert asked(down)[0] == pytest.approx(0.4)


def test_a_velocity_has_no_position() -> None:
    wanted = Setpoint(SetpointKind.VELOCITY, velocity=(0.1, 0.0, -0.2), heading_rate=0.5)
    command = tracker().update(wanted, tick((3.0, 3.0, 1.0)))
    assert asked(command) == pytest.approx((0.4, 0.0))
    assert climb(command) == pytest.approx(-0.2)
    assert command.rates[2] == 0.5


def test_gains_follow_from_the_loop_and_hold() -> None:
    params = TiltClimbParams()
    quick = attitude_loop(0.03, None, None)
    fast = TiltClimb.outer_loop(params, FRAME, InnerLoop(quick, 0.03), 0.01)
    slow = TiltClimb.outer_loop(params, FRAME, SLOW, 0.01)
    assert slow.proportional < fast.proportional <= FASTEST[0]
    assert holds(margins_of(slow, SLOW), PLANNED)


def test_a_climb_that_is_followed_late_has_the_margins_of_its_two_poles() -> None:
    law = OuterLoop(*FASTEST, 0.0, 0.0, 0.0, climb=1.0)
    loop = InnerLoop(FRAME.attitude_loop, 0.0, pose_latency=0.0, pose_period=0.001, climb_time=0.7)
    found = margins(vertical(law, loop))
    assert degrees(found.phase) == pytest.approx(60.0, abs=3.0)
    late = margins(vertical(law, replace_late(loop, 0.3)))
    assert late.delay == pytest.approx(found.delay - 0.3, abs=0.02)


def replace_late(loop: InnerLoop, seconds: float) -> InnerLoop:
    return loop._replace(command_latency=seconds)


def test_new_parameters_tune_it_again() -> None:
    made = tracker()
    made.params = replace(made.params, proportional=1.0)
    assert asked(made.update(position((0.1, 0.0, 1.0)), tick()))[0] == pytest.approx(0.1)
