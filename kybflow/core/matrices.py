"""Products, symmetry, definiteness and eigenvalues of small matrices, given as rows of floats."""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, cos, hypot, pi, sqrt

from kybflow.core.units import Vec3

Rows = Sequence[Sequence[float]]


def transform(matrix: Rows, v: Vec3) -> Vec3:
    """Return the product of a 3 x 3 matrix and the vector `v`."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    x, y, z = v
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def asymmetry(matrix: Rows) -> tuple[int, int] | None:
    """Return the row and column, from 0, of the first entry that differs from its mirror image
    across the diagonal; None for a symmetric matrix."""
    pairs = ((i, j) for i in range(len(matrix)) for j in range(i))
    return next(((j, i) for i, j in pairs if matrix[i][j] != matrix[j][i]), None)


def is_positive_definite(matrix: Rows) -> bool:
    """Return whether all eigenvalues of a symmetric matrix are positive. They are if all pivots of
    Gaussian elimination are positive."""
    rows = [list(row) for row in matrix]
    for i, row in enumerate(rows):
        if not row[i] > 0.0:
            return False
        for below in rows[i + 1 :]:
            share = below[i] / row[i]
            below[:] = [b - share * a for a, b in zip(row, below, strict=True)]
    return True


def eigenvalues2(matrix: Rows) -> tuple[float, float]:
    """Return the eigenvalues of a symmetric 2 x 2 matrix in ascending order."""
    (a, b), (_, c) = matrix
    middle, reach = 0.5 * (a + c), hypot(0.5 * (a - c), b)
    return middle - reach, middle + reach


def eigenvalues3(matrix: Rows) -> tuple[float, float, float]:
    """Return the eigenvalues of a symmetric 3 x 3 matrix in ascending order (Smith, Comm. ACM 4,
    1961)."""
    (a, d, f), (_, b, e), (_, _, c) = matrix
    mean = (a + b + c) / 3.0
    a, b, c = a - mean, b - mean, c - mean
    size = sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    if size == 0.0:
        return mean, mean, mean
    half = (a * (b * c - e * e) - d * (d * c - e * f) + f * (d * e - b * f)) / (2.0 * size**3)
    angle = acos(max(-1.0, min(1.0, half))) / 3.0
    low, high = (mean + 2.0 * size * cos(angle + turn) for turn in (2.0 * pi / 3.0, 0.0))
    return low, 3.0 * mean - low - high, high
