"""Quintic pieces and the slopes that values leave open."""

from itertools import pairwise
from math import cos, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.flight.trajectory import Knot, Quintic, slopes

numbers = st.floats(-5.0, 5.0)
knots = st.builds(Knot, numbers, numbers, numbers)


@given(knots, knots, st.floats(0.05, 10.0))
def test_a_piece_goes_through_both_knots_with_their_derivatives(a: Knot, b: Knot, h: float) -> None:
    piece = Quintic.between(a, b, h)
    assert piece.at(0.0)[:3] == pytest.approx(a)
    scale = 1.0 + max(map(abs, (*a, *b))) * (1.0 + 1.0 / h**2)
    assert piece.at(h)[:3] == pytest.approx(b, abs=1e-10 * scale)


@given(knots, knots, st.floats(0.2, 5.0), st.floats(0.1, 0.9))
def test_what_it_gives_are_each_others_derivatives(a: Knot, b: Knot, h: float, at: float) -> None:
    piece, s, d = Quintic.between(a, b, h), at * h, 1e-5 * h
    before, here, after = piece.at(s - d), piece.at(s), piece.at(s + d)
    for order in range(3):
        slope = (after[order] - before[order]) / (2.0 * d)
        scale = 1.0 + max(abs(x) for x in (*before, *after)) / h
        assert slope == pytest.approx(here[order + 1], abs=1e-4 * scale)


def test_a_quintic_is_met_exactly() -> None:
    def curve(t: float) -> Knot:
        return Knot(t**5 - 2.0 * t**3, 5.0 * t**4 - 6.0 * t**2, 20.0 * t**3 - 12.0 * t)

    piece = Quintic.between(curve(-1.0), curve(1.5), 2.5)
    for t in (-0.5, 0.0, 0.7, 1.2):
        assert piece.at(t + 1.0)[0] == pytest.approx(curve(t).value)


def test_slopes_are_those_of_a_smooth_curve_and_zero_at_the_ends() -> None:
    times = [0.05 * i + 0.01 * (i % 3) for i in range(60)]
    end = times[-1]
    values = [cos(6.0 * t / end * 3.141592653589793) for t in times]
    found = slopes(times, values)
    k = 6.0 / end * 3.141592653589793
    for t, slope in list(zip(times, found, strict=True))[2:-2]:
        assert slope == pytest.approx(-k * sin(k * t), abs=0.02 * k)
    assert (found[0], found[-1]) == (0.0, 0.0)


def test_two_values_are_left_and_reached_at_rest() -> None:
    assert slopes([0.0, 1.0], [3.0, 4.0]) == [0.0, 0.0]


@given(st.lists(st.tuples(st.floats(0.01, 2.0), numbers), min_size=3, max_size=30))
def test_the_spline_of_its_slopes_has_no_step_in_the_second_derivative(steps) -> None:
    times = [sum(h for h, _ in steps[: i + 1]) for i in range(len(steps))]
    values = [value for _, value in steps]
    found = slopes(times, values)
    rows = list(zip(times, values, found, strict=True))
    bends = []
    for (t, p, v), (u, q, w) in pairwise(rows):
        h = u - t
        bends.append(((6.0 * (q - p) / h - 4.0 * v - 2.0 * w) / h, h))
        bends.append(((-6.0 * (q - p) / h + 2.0 * v + 4.0 * w) / h, h))
    for (left, h), (right, g) in zip(bends[1:-1:2], bends[2::2], strict=True):
        assert left == pytest.approx(right, abs=1e-6 * (1.0 + 1.0 / h**2 + 1.0 / g**2) * 100.0)
