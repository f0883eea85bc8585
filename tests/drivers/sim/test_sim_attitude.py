"""The attitude law of the simulated autopilot."""

from __future__ import annotations

from math import radians

import pytest
from sim_worlds import FRAME

from kybflow.core.geometry import from_euler, from_heading
from kybflow.drivers.sim.onboard import AT_REST, _gains, control

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
