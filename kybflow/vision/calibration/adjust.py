"""Solves for the corrections that best explain a walk, and for their covariance.

SciPy's `least_squares` (a trust region method; Branch, Coleman and Li, 1999) minimises the sum of
rho(r^2) over the residuals of `model`: first with rho(z) = 2 (sqrt(1 + z) - 1), which limits the
effect of a wrong tag or pose, then with plain squares of the residuals within 5 standard
deviations. The standard deviation of a kind is estimated from its n residuals,

    sigma^2 = sum r^2 / (n - tr(N^-1 J_k^T J_k)),    N = J^T J

where the trace is the number of residuals used up by corrections (variance components; Foerstner,
1979); if too few remain, the prior value is used. The covariance of the corrections is N^-1. Steps
come from LSMR on J L^-T, with N = L L^T at the start of a round, which takes about ten iterations
instead of thousands.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray

from kybflow.core.errors import CalibrationFailed
from kybflow.vision.calibration.model import Block, Walk, blocks

Array = NDArray[Any]

BELIEVED: Mapping[str, float] = {
    "corners": 0.6,
    "reference position": 0.003,
    "reference attitude": 0.005,
    "reference velocity": 0.02,
    "reference rates": 0.02,
    "survey": 0.01,
    "survey heading": 0.02,
    "focal": 0.03,
    "centre": 15.0,
    "k1": 0.1,
    "mount position": 0.02,
    "mount attitude": 0.05,
    "offset": 0.1,
    "position": 1.0,
    "attitude": 1.0,
    "heading": 1.0,
    "velocity": 0.3,
    "rates": 0.5,
}
"""Prior standard deviation of each kind of residual, in pixels, metres, radians, seconds, m/s or
rad/s; relative for the focal length."""
_LEAST = {
    "corners": 0.02,
    "reference position": 1e-4,
    "reference attitude": 1e-4,
    "reference velocity": 0.01,
    "reference rates": 0.01,
    "survey": 1e-4,
    "survey heading": 1e-4,
    "velocity": 0.01,
    "rates": 0.01,
}
"""The kinds whose standard deviation is estimated from residuals, with its smallest value."""
_KEPT = frozenset({"velocity", "rates"})
"""The kinds without outlier rejection."""
_MIN_RESIDUALS = 12.0
"""Smallest number of remaining residuals from which a standard deviation is estimated."""
_SIGMAS = 5.0
"""Number of standard deviations above which a residual is an outlier."""
_MAD_RATIO = 1.4826
"""Ratio of a normal distribution's standard deviation to the median of its absolute values."""
_ROUNDS = 3
_MAX_STEP = 1e4
"""Largest first step, standard deviations."""
_MIN_STEP = 1e-7


class Adjusted(NamedTuple):
    """The solution of a bundle adjustment. x: the corrections. sigma: the standard deviation of
    each kind of residual. used: for each kind, a mask of the residuals that are not outliers."""

    x: Array
    covariance: Array
    sigma: Mapping[str, float]
    used: Mapping[str, NDArray[numpy.bool_]]


def adjust(walk: Walk, x: Array, sigma: Mapping[str, float] = BELIEVED) -> Adjusted:
    """Return the corrections that best explain a walk, starting from `x`. Raises CalibrationFailed
    if there is no solution."""
    used = {block.kind: numpy.ones(len(block.unit), bool) for block in blocks(walk, x, sigma)}
    found = Adjusted(x, numpy.empty((0, 0)), sigma, used)
    try:
        for i in range(_ROUNDS):
            x = _solved(walk, found, "linear" if i else "soft_l1")
            found = _weighed(walk, x, found)
    except (numpy.linalg.LinAlgError, ValueError):  # SciPy's for values that are not finite
        message = "map, camera and frames contradict each other; are they of the same floor?"
        raise CalibrationFailed(message) from None
    return found


def _solved(walk: Walk, begun: Adjusted, loss: str) -> Array:
    from scipy.linalg import cholesky, solve_triangular
    from scipy.optimize import least_squares
    from scipy.sparse.linalg import LinearOperator

    _, start = _system(walk, begun.x, begun)
    lower = cholesky((start.T @ start).toarray(), lower=True)
    whole = solve_triangular(lower, numpy.eye(len(lower)), lower=True).T

    def residuals(y: Array) -> Array:
        return _system(walk, begun.x + whole @ y, begun)[0]

    def jacobian(y: Array) -> Any:
        slopes = _system(walk, begun.x + whole @ y, begun)[1]
        return LinearOperator(
            slopes.shape,
            matvec=lambda step: slopes @ (whole @ step),
            rmatvec=lambda error: whole.T @ (slopes.T @ error),
        )

    none = numpy.zeros(walk.size)
    found = least_squares(residuals, none, jacobian, loss=loss, x_scale=_MAX_STEP, ftol=_MIN_STEP)
    x: Array = begun.x + whole @ found.x
    return x


def _system(walk: Walk, x: Array, with_: Adjusted) -> tuple[Array, Any]:
    """Return the residuals that are not outliers, and their sparse Jacobian."""
    from scipy.sparse import vstack

    parts = [
        Block(block.kind, *(part[with_.used[block.kind]] for part in block[1:]))
        for block in blocks(walk, x, with_.sigma)
    ]
    values = numpy.concatenate([part.values.ravel() for part in parts])
    return values, vstack([_sparse(part, walk.size) for part in parts], format="csr")


def _sparse(block: Block, size: int) -> Any:
    from scipy.sparse import csr_matrix

    count, rows, entries = block.slopes.shape
    columns = numpy.repeat(block.columns, rows, axis=0).ravel()
    begins = numpy.arange(0, columns.size + 1, entries)
    return csr_matrix((block.slopes.ravel(), columns, begins), shape=(count * rows, size))


def _weighed(walk: Walk, x: Array, before: Adjusted) -> Adjusted:
    """Return the solution `x` with its outliers, standard deviations and covariance."""
    from scipy.linalg import inv

    sigma, used = dict(before.sigma), dict(before.used)
    _, slopes = _system(walk, x, before)
    covariance = inv((slopes.T @ slopes).toarray())
    for block in blocks(walk, x, before.sigma):
        kind, count = block.kind, block.values.size
        if kind not in _LEAST or not count:
            continue
        own = _sparse(block, walk.size)
        spent = float((covariance * (own.T @ own).toarray()).sum())
        remains = count - spent
        if remains < _MIN_RESIDUALS:
            continue
        scale = _MAD_RATIO * float(numpy.median(numpy.abs(block.values))) * (count / remains) ** 0.5
        scale = max(scale, _LEAST[kind] / before.sigma[kind])
        far = numpy.inf if kind in _KEPT else _SIGMAS * scale
        wrong = block.unit[numpy.abs(block.values).max(axis=1) > far]
        within = ~numpy.isin(block.unit, wrong)
        if not within.any():
            continue
        used[kind], kept = within, block.values[within]
        share = (float((kept**2).sum()) / (remains * kept.size / count)) ** 0.5
        sigma[kind] = max(before.sigma[kind] * share, _LEAST[kind])
    _, slopes = _system(walk, x, Adjusted(x, covariance, sigma, used))
    return Adjusted(x, inv((slopes.T @ slopes).toarray()), sigma, used)
