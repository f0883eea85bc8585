"""Small matrices: symmetric or not, positive definite or not, and their eigenvalues."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from kybflow.core.matrices import (
    asymmetry,
    eigenvalues2,
    eigenvalues3,
    is_positive_definite,
    transform,
)

NUMBERS = st.floats(-100.0, 100.0).map(lambda x: round(x, 3))
SIX = st.tuples(*[NUMBERS] * 6)


def symmetric(six: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    a, b, c, d, e, f = six
    return ((a, d, f), (d, b, e), (f, e, c))


@pytest.mark.parametrize(
    ("matrix", "place"),
    [
        (((1.0,),), None),
        (((1.0, 2.0), (2.0, 1.0)), None),
        (((1.0, 2.0), (-2.0, 1.0)), (0, 1)),
        (((1.0, 0.0, 3.0), (0.0, 1.0, 0.0), (2.0, 0.0, 1.0)), (0, 2)),
    ],
)
def test_what_is_not_symmetric_has_a_place(matrix, place) -> None:
    assert asymmetry(matrix) == place


@given(SIX)
def test_eigenvalues_are_those_of_numpy_and_rise(six) -> None:
    matrix = symmetric(six)
    assert eigenvalues3(matrix) == pytest.approx(np.linalg.eigvalsh(matrix), abs=1e-4)
    level = [row[:2] for row in matrix[:2]]
    assert eigenvalues2(level) == pytest.approx(np.linalg.eigvalsh(level), abs=1e-9)


@given(SIX)
def test_positive_definite_is_that_every_eigenvalue_is_above_zero(six) -> None:
    least = np.linalg.eigvalsh(symmetric(six))[0]
    assume(abs(least) > 1e-6)
    assert is_positive_definite(symmetric(six)) == (least > 0.0)


@pytest.mark.parametrize("k", [9.0, 0.1])
def test_equal_directions_have_one_eigenvalue(k: float) -> None:
    same = ((k, 0.0, 0.0), (0.0, k, 0.0), (0.0, 0.0, k))
    assert eigenvalues3(same) == pytest.approx((k, k, k))
    assert is_positive_definite(same)


def test_what_is_no_number_is_not_positive_definite() -> None:
    assert not is_positive_definite(((float("nan"),),))


def test_a_matrix_turns_a_vector() -> None:
    matrix = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0))
    assert transform(matrix, (1.0, 0.0, -1.0)) == (-2.0, -2.0, -2.0)
