"""The on-board attitude loop that an airframe declares."""

from __future__ import annotations

from dataclasses import replace

import pytest

from kybflow.world.vehicle_context import Airframe

FRAME = Airframe(mass=1.0, diameter=0.5, inertia=(0.01, 0.01, 0.02), thrust=6.0, rotor_time=0.05)


def test_without_a_gain_it_is_as_fast_as_the_rotors_allow_and_leads_them() -> None:
    loop = FRAME.attitude_loop
    assert loop == pytest.approx((23.0**2, 48.0, 23.0**3 / 8.0, 4.0))
    quick = replace(FRAME, rotor_time=0.025).attitude_loop
    assert quick == pytest.approx((35.0**2, 2.0 * 0.85 * 35.0, 35.0**3 / 8.0, 4.0))
    slow = replace(FRAME, rotor_time=0.115).attitude_loop
    assert slow.derivative == pytest.approx(2.0 * 1.4 * 10.0), "its rotors bear no more"


def test_with_both_gains_it_is_a_cascade_without_a_lead() -> None:
    loop = replace(FRAME, attitude_gain=6.5, rate_gain=18.0).attitude_loop
    assert loop[:2] == pytest.approx((6.5 * 18.0, 18.0))
    assert loop.lead == 1.0
    assert loop.integral == pytest.approx(6.5 * 18.0 * 0.2 / 0.15, rel=0.02), "as PX4 comes"


@pytest.mark.parametrize(("given", "expected"), [("attitude_gain", 12.0), ("rate_gain", 30.0)])
def test_with_one_gain_the_other_is_px4s(given: str, expected: float) -> None:
    loop = replace(FRAME, **{given: expected}).attitude_loop
    attitude, rate = loop.proportional / loop.derivative, loop.derivative
    both = {"attitude_gain": 6.5, "rate_gain": 18.0} | {given: expected}
    assert (attitude, rate) == pytest.approx((both["attitude_gain"], both["rate_gain"]))
