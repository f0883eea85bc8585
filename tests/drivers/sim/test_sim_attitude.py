"""The attitude law of the simulated autopilot."""

from __future__ import annotations

from dataclasses import replace
from math import radians, sin

import pytest
from sim_worlds import FRAME

from kybflow.core.geometry import from_euler, from_heading
from kybflow.drivers.sim.steps.onboard import AT_REST, _gains, control

STEP = 0.002


def rotors(attitude, wanted):
    """The first controls of the four rotors at rest in `attitude`, asked for `wanted` at 40 %."""
    filtered, setpoint = (*attitude, 0.0, 0.0, 0.0, 0.0), (1.0, *wanted, 0.0, 0.0, 0.0, 0.4, 0.0)
    still = (0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0)
    assert len(still) == len(AT_REST)
    return control(still, filtered, (0.0, 0.0, 0.0), setpoint, _gains(FRAME, STEP))[1]


@pytest.mark.parametrize("turned", [0.0, 30.0, 90.0, 150.0, -120.0])
@pytest.mark.parametrize("roll", [2.0, -1.0])
def test_a_heading_that_is_far_off_changes_nothing_about_the_tilt(turned: float, roll: float):
    a, b, c, d = rotors(from_euler(radians(roll), 0.0, 0.0), from_heading(radians(turned)))
    x, y, z, w = rotors(from_euler(radians(roll), 0.0, 0.0), from_heading(0.0))
    assert (a + b - c - d, b + c - a - d) == pytest.approx((x + y - z - w, y + z - x - w))
    assert b + c - a - d == pytest.approx(0.0, abs=1e-9), "a roll needs no pitch"
    assert (a - b + c - d) * turned >= 0.0, "it turns the shorter way"


def test_upside_down_its_controls_stay_in_bounds():
    assert all(0.0 <= part <= 1.0 for part in rotors((0.0, 1.0, 0.0, 0.0), from_heading(0.0)))


def lifted(a, b, c, d):
    """Thrust, roll, pitch and yaw of four rotors, as parts of what one can give."""
    return a + b + c + d, a + b - c - d, b + c - a - d, a - b + c - d


def asked(lift, attitude, spin=0.0, rates=(0.0, 0.0)):
    """The controls that hold `lift`, long asked for, in `attitude` and at these turn rates."""
    filtered, gains = (*attitude, 0.0, 0.0, 0.0, 0.0), _gains(FRAME, STEP)
    setpoint = (1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, lift, 0.0)
    still = (0.0, 0.0, 0.0, lift, 0.0, 0.0, 0.0)
    return control(still, filtered, (*rates, spin), setpoint, gains)[1]


@pytest.mark.parametrize("lift", [0.4, 0.6, 0.75])
def test_what_one_diagonal_cant_lift_the_other_does(lift):
    tilted = from_euler(0.02, 0.02, 0.0)
    thrust, roll, pitch, _ = lifted(*asked(lift, tilted))
    _, roll_asked, pitch_asked, _ = lifted(*asked(0.4, tilted))
    assert max(asked(lift, tilted)) <= 1.0
    assert thrust == pytest.approx(4.0 * lift), "all the thrust that is asked for"
    assert (roll, pitch) == pytest.approx((roll_asked, pitch_asked))


def test_roll_and_pitch_come_before_thrust():
    tilted = from_euler(0.02, 0.02, 0.0)
    thrust, roll, pitch, _ = lifted(*asked(1.0, tilted))
    assert (roll, pitch) == pytest.approx(lifted(*asked(0.4, tilted))[1:3])
    assert thrust == pytest.approx(4.0 - max(abs(roll), abs(pitch))), "all that they leave"


def test_a_spin_is_foreseen_for_as_long_as_the_rotors_need():
    """What is asked of a body that turns is asked in the frame that it will have."""
    spin, gains = 30.0, _gains(FRAME, STEP)
    roll, pitch = lifted(*asked(0.4, from_euler(0.005, 0.0, 0.0)))[1:3]
    turned_roll, turned_pitch = lifted(*asked(0.4, from_euler(0.005, 0.0, 0.0), spin))[1:3]
    assert pitch == pytest.approx(0.0, abs=1e-9)
    assert turned_roll == pytest.approx(roll)
    assert turned_pitch == pytest.approx(-spin * gains.lag * roll, rel=0.01)


def test_a_declared_cascade_leads_no_rotor():
    cascade = replace(FRAME, attitude_gain=6.5, rate_gain=18.0)
    gains = _gains(cascade, STEP)
    assert (gains.lead, gains.lag) == (1.0, 0.0)
    still = (0.0, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0)
    filtered = (*from_euler(0.01, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0)
    setpoint = (1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4, 0.0)
    lift, roll, *_ = lifted(*control(still, filtered, (0.0, 0.0, 0.0), setpoint, gains)[1])
    assert roll == pytest.approx(-4.0 * gains.roll * 6.5 * 18.0 * sin(0.01), rel=0.01)
    assert lift == pytest.approx(4.0 * 0.4)
