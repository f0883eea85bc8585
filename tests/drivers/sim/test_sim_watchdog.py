"""The simulated vehicle's watchdog: it comes down by itself when nobody commands it any more."""

from __future__ import annotations

from dataclasses import replace

import pytest
from sim_worlds import FRAME, PERIOD, QUIET, STOPPED, in_flight, lift, opened, push, seat, thrust

from kybflow.core.geometry import tilt_of
from kybflow.core.signals import NS
from kybflow.drivers.sim import Sim, SimParams
from kybflow.parts import Effect


def left_alone(session, link, now, seconds=30.0):
    """Nobody sends any more: the fastest descent in the last 5 cm above the floor, and the end."""
    fastest = 0.0
    for _ in range(round(seconds * 250)):
        now += PERIOD
        before = link.truth()
        session.advance(now)
        if before.position[2] < 0.05:
            fastest = max(fastest, -before.velocity[2])
    return fastest, now


def cut_after(seconds, seed, height=1.0, bias=0.0, since=4.0, calm=False):
    """The link is cut after so long a hover, begun before the IMU has rested for long; since so
    many seconds the accelerometer is wrong by `bias`, m/s^2. The greatest height from then on over
    the last, the fastest descent above the floor, and the last height."""
    session, link = opened(seat(params=SimParams(calm=calm)), seed=seed)
    _, now = push(session, link, 0.04, STOPPED)
    now = lift(session, link, height, seconds - since, now)
    link.faults.begin(Effect(accelerometer_bias=(0.0, 0.0, bias)), now)
    now = lift(session, link, height, since, now)
    last = top = link.truth().position[2]
    fastest = 0.0
    while link.controller.armed:
        now += PERIOD
        before = link.truth()
        session.advance(now)
        top = max(top, before.position[2])
        if before.position[2] < 0.05:
            fastest = max(fastest, -before.velocity[2])
    return top / last, fastest, link.truth().position[2]


HEIGHTS = {0.6: 0, 1.5: 1, 2.5: 2}
"""Metres, each with the seed of the quick tests; the others are thorough."""


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("height", "seed"),
    [
        pytest.param(height, seed, marks=[] if seed == quick else [pytest.mark.slow])
        for height, quick in HEIGHTS.items()
        for seed in range(3)
    ],
)
def test_a_vehicle_that_nobody_commands_any_more_comes_down_gently(height, seed):
    session, link, now = in_flight(SimParams(), height, seed=seed)
    fastest, _ = left_alone(session, link, now)
    assert 0.1 < fastest <= 1.2
    assert link.truth().position[2] == pytest.approx(0.0, abs=0.02)
    assert max(session.onboard.controls[0]) == 0.0
    assert tilt_of(link.truth().attitude) < 0.1


def assert_gently_down(climbed, fastest, height):
    assert climbed <= 1.2
    assert 0.0 < fastest <= 1.5
    assert height == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    "seed", [100, *(pytest.param(s, marks=pytest.mark.thorough) for s in (101, 104))]
)
def test_a_long_flight_does_not_make_it_climb(seed):
    assert_gently_down(*cut_after(60.0, seed))


@pytest.mark.parametrize(("bias", "since"), [(-0.3, 4.0), (-0.6, 12.0), (0.6, 6.0)])
def test_an_accelerometer_that_went_wrong_in_flight_does_not_make_it_climb(bias, since):
    assert_gently_down(*cut_after(20.0, 300, bias=bias, since=since))


@pytest.mark.parametrize(("bias", "since"), [(-0.5, 1.0), (-1.0, 0.0)])
def test_an_accelerometer_that_goes_wrong_with_the_link_makes_it_climb_little(bias, since):
    climbed, fastest, _ = cut_after(8.0, 300, bias=bias, since=since, calm=True)
    assert climbed <= 1.6
    assert 0.0 < fastest <= 1.5


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [5.0, 60.0, 150.0, 600.0])
@pytest.mark.parametrize("seed", range(200, 220))
def test_however_long_it_flew_before_it_does_not_climb(seconds, seed):
    assert_gently_down(*cut_after(seconds, seed))


@pytest.mark.thorough
@pytest.mark.parametrize("climb", [-1.0, 1.0])
def test_the_watchdog_knows_how_fast_it_climbs(climb):
    session, link, now = in_flight(SimParams(), 2.0)
    for _ in range(100):
        error = 4.0 * (climb - link.truth().velocity[2])
        link.send(thrust(FRAME.mass * (9.81 + error)), now)
        now += PERIOD
        session.advance(now)
    assert left_alone(session, link, now)[0] <= 1.5


@pytest.mark.parametrize("error", [-1.0, 1.0])
def test_it_takes_an_error_of_its_accelerometer_at_rest_for_no_motion(error):
    session, link = opened(seat(params=SimParams()))
    link.faults.begin(Effect(accelerometer_bias=(0.0, 0.0, error)), 0)
    _, now = push(session, link, 0.5, STOPPED)
    now = lift(session, link, 1.5, 4.0, now)
    fastest, _ = left_alone(session, link, now, 8.0)
    assert 0.0 < fastest <= 1.5
    assert max(session.onboard.controls[0]) == 0.0


def test_it_waits_250_ms_and_then_heeds_only_who_cuts_its_rotors():
    session, link, now = in_flight()
    held = session.onboard.controls[0][0]
    session.advance(now + NS // 4 - NS // 100)
    assert session.onboard.controls[0][0] == pytest.approx(held, rel=0.05)
    now += NS
    session.advance(now)
    _, now = push(session, link, 0.5, thrust(20.0), now)
    assert link.truth().velocity[2] < 0.0
    assert link.override is not None
    assert link.override.lands
    _, now = push(session, link, 0.1, STOPPED, now)
    assert link.controller.armed, "it is in the air"
    link.cut(now)
    _, now = push(session, link, 0.1, STOPPED, now)
    assert max(session.onboard.controls[0]) == 0.0
    push(session, link, 1.0, thrust(20.0), now)
    assert link.truth().velocity[2] > 1.0


def test_once_down_it_is_armed_again_after_a_command_to_rest():
    session, link, now = in_flight(height=0.5)
    _, now = left_alone(session, link, now, 8.0)
    _, now = push(session, link, 0.5, thrust(20.0), now)
    assert not link.controller.armed
    assert link.override is None
    _, now = push(session, link, 0.1, STOPPED, now)
    push(session, link, 0.1, thrust(20.0), now)
    assert link.controller.armed


def test_without_a_watchdog_it_flies_on_and_the_part_says_so():
    params = replace(QUIET, watchdog=False)
    session, link, now = in_flight(params)
    session.advance(now + 3 * NS)
    assert link.truth().position[2] > 0.5
    assert (
        Sim.watchdog(params) == "`watchdog` is off: nothing lands the vehicle if this program stops"
    )
    assert Sim.watchdog(QUIET) is None
