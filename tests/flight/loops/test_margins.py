"""Margins of loops whose margins are known."""

from __future__ import annotations

from cmath import exp
from math import atan, degrees, inf, pi, radians, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.flight.loops.margins import UNSTABLE, Margins, in_words, margins


def test_three_lags_have_the_textbooks_margins() -> None:
    """K / (s (s + 1) (s + 2)) crosses the negative real axis at sqrt(2) with K / 6."""
    found = margins(lambda s: 1.0 / (s * (s + 1.0) * (s + 2.0)))
    assert found.gain == pytest.approx(6.0, rel=0.01)
    assert degrees(found.phase) == pytest.approx(53.4, abs=0.5)
    assert found.delay == pytest.approx(radians(53.4) / 0.446, rel=0.01)


@pytest.mark.parametrize(("gain", "is_stable"), [(5.9, True), (6.1, False), (50.0, False)])
def test_a_loop_beyond_its_margin_has_none(gain: float, is_stable: bool) -> None:
    found = margins(lambda s: gain / (s * (s + 1.0) * (s + 2.0)))
    assert (found != UNSTABLE) is is_stable


@given(st.floats(1.5, 40.0), st.floats(0.002, 0.5))
def test_an_integrator_behind_a_delay(k: float, delay: float) -> None:
    """k e^(-s T) / s is stable while k T < pi / 2; then it has pi / (2 k T), pi / 2 - k T and
    pi / (2 k) - T."""
    if abs(k * delay - pi / 2.0) < 0.05 or pi / (2.0 * delay) > 250.0:
        return
    found = margins(lambda s: k / s * exp(-s * delay))
    if k * delay > pi / 2.0:
        assert found == UNSTABLE
        return
    expected = Margins(pi / (2.0 * k * delay), pi / 2.0 - k * delay, pi / (2.0 * k) - delay)
    assert found.gain == pytest.approx(expected.gain, rel=0.01)
    assert found.phase == pytest.approx(expected.phase, abs=0.01)
    assert found.delay == pytest.approx(expected.delay, rel=0.02, abs=1e-4)


def test_a_double_integrator_needs_a_derivative() -> None:
    assert margins(lambda s: 4.0 / (s * s * (1.0 + 0.01 * s))) == UNSTABLE
    found = margins(lambda s: (4.0 + 4.0 * s) / (s * s))
    crossing = sqrt(8.0 + sqrt(80.0))
    assert found.gain == inf
    assert found.phase == pytest.approx(atan(crossing), abs=0.01)
    assert found.delay == pytest.approx(atan(crossing) / crossing, rel=0.01)


def test_a_gain_that_must_not_shrink_is_no_gain_margin() -> None:
    """With an integral a double integrator oscillates at low gains, not at high ones."""
    found = margins(lambda s: (9.0 * s * s + 16.0 * s + 8.0) / s**3 / (1.0 + 0.01 * s))
    assert found.gain == inf
    assert degrees(found.phase) == pytest.approx(73.0, abs=2.0)


def test_a_resonance_beyond_the_crossing_counts() -> None:
    """(s^2 + 2 z w s + w^2) with w = 30 and z = 0.02 lifts an integrator over 1 again."""
    found = margins(lambda s: 2.0 / s * 900.0 / (s * s + 1.2 * s + 900.0))
    assert found == UNSTABLE
    found = margins(lambda s: 1.0 / s * 900.0 / (s * s + 1.2 * s + 900.0))
    assert found.gain == pytest.approx(1.2, rel=0.02)


def test_margins_in_words() -> None:
    assert in_words(Margins(1.5, radians(31.0), 0.052)) == (
        "gain margin 1.5, phase margin 31 deg, delay margin 52 ms"
    )
    assert in_words(UNSTABLE) == "no margin at all"
