"""The filter's matrices against derivatives taken by brute force, and against tables."""

from __future__ import annotations

import random

import numpy
import pytest

from kybflow.core.geometry import (
    GRAVITY,
    Vec3,
    add,
    conjugate,
    from_euler,
    integrate,
    multiply,
    scale,
    sub,
)
from kybflow.flight.fusion.covariance import (
    STATES,
    ImuNoise,
    Matrix,
    Nominal,
    chi_square_bound,
    correction,
    predicted,
    reset,
)

SILENCE = ImuNoise(0.0, 0.0, 0.0, 0.0).variances()
START = Nominal(
    1_000_000_000,
    (1.0, -2.0, 0.5),
    (0.7, 0.2, -0.4),
    from_euler(0.2, -0.3, 2.0),
    (0.05, -0.02, 0.1),
    (0.01, 0.02, -0.03),
)
FELT: tuple[tuple[Vec3, Vec3], ...] = tuple(
    ((0.5 + 0.1 * i, -1.0, GRAVITY + 0.2 * i), (0.8, -0.5 + 0.1 * i, 0.3)) for i in range(5)
)


def after_manoeuvre(state: Nominal) -> Nominal:
    """After 20 ms of a manoeuvre."""
    for i, (force, turn) in enumerate(FELT, 1):
        state = state.moved(force, turn, START.time + i * 4_000_000)
    return state


def between(nominal: Nominal, true: Nominal) -> list[float]:
    """The error of `nominal`, in the filter's order."""
    w, x, y, z = multiply(conjugate(nominal.attitude), true.attitude)
    turned = scale((x, y, z), 2.0 / w)
    return [
        *sub(true.position, nominal.position),
        *sub(true.velocity, nominal.velocity),
        *turned,
        *sub(true.accelerometer_bias, nominal.accelerometer_bias),
        *sub(true.gyro_bias, nominal.gyro_bias),
    ]


def unit(i: int, size: float) -> Matrix:
    return numpy.eye(STATES)[i] * size


@pytest.mark.parametrize("i", range(STATES))
def test_an_error_grows_as_the_covariance_says(i: int) -> None:
    size = 1e-5
    grown = (
        numpy.array(
            between(after_manoeuvre(START), after_manoeuvre(START.corrected(unit(i, size))))
        )
        / size
    )

    error = unit(i, 1.0)
    after = predicted(numpy.outer(error, error), START, after_manoeuvre(START), SILENCE)

    assert after == pytest.approx(numpy.outer(grown, grown), abs=5e-5)


def test_noise_grows_with_the_square_root_of_time() -> None:
    noise = ImuNoise(0.02, 0.03, 0.004, 0.005)
    after = predicted(
        numpy.zeros((STATES, STATES)), START, after_manoeuvre(START), noise.variances()
    )

    deviations = numpy.sqrt(after.diagonal() / 0.02)

    expected = [0.0] * 3 + [0.02] * 3 + [0.03] * 3 + [0.004] * 3 + [0.005] * 3
    assert deviations == pytest.approx(numpy.array(expected))


def test_a_correction_is_put_in_and_taken_out_again() -> None:
    generator = random.Random(1)
    error = numpy.array([generator.gauss(0.0, 0.1) for _ in range(STATES)])
    assert between(START, START.corrected(error)) == pytest.approx(error.tolist())


def test_a_pose_corrects_as_the_textbook_has_it() -> None:
    generator = numpy.random.default_rng(2)
    square = generator.standard_normal((STATES, STATES))
    covariance = square @ square.T
    noise = numpy.diag((0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    innovation = generator.standard_normal(6)
    sees = numpy.eye(STATES)[[0, 1, 2, 6, 7, 8]]
    spread = sees @ covariance @ sees.T + noise
    gain = covariance @ sees.T @ numpy.linalg.inv(spread)

    told = correction(covariance, innovation.tolist(), noise)

    assert told.distance == pytest.approx(innovation @ numpy.linalg.inv(spread) @ innovation)
    assert told.error == pytest.approx(gain @ innovation)
    assert told.covariance == pytest.approx((numpy.eye(STATES) - gain @ sees) @ covariance)
    assert (told.covariance == told.covariance.T).all()


@pytest.mark.parametrize("i", [6, 7, 8])
def test_the_reset_moves_errors_to_the_corrected_attitude(i: int) -> None:
    error = numpy.zeros(STATES)
    error[6:9] = 0.02, -0.03, 0.01
    size = 1e-5
    corrected = START.corrected(error)
    true = START._replace(
        attitude=integrate(
            START.attitude, add((0.02, -0.03, 0.01), tuple(unit(i, size)[6:9].tolist())), 1.0
        )
    )
    left = numpy.array(between(corrected, true)) / size

    after = reset(numpy.outer(unit(i, 1.0), unit(i, 1.0)), error)

    assert after == pytest.approx(numpy.outer(left, left), abs=2e-3)
    assert after[6:9, 6:9] != pytest.approx(numpy.diag(unit(i, 1.0)[6:9]), abs=2e-3)


@pytest.mark.parametrize(
    ("refused", "size", "bound"),
    [(0.05, 3, 7.815), (0.001, 3, 16.266), (0.05, 6, 12.592), (0.001, 6, 22.458)],
)
def test_the_gate_is_that_of_the_tables(refused: float, size: int, bound: float) -> None:
    assert chi_square_bound(refused, size) == pytest.approx(bound, abs=0.001)
