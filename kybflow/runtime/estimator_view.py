"""What an estimator's health condition reads (`observables.View`): its last estimate.

It stands alone because mypyc, which compiles `estimation`, knows no property that has several
names.
"""

from __future__ import annotations

from math import inf
from typing import Any, Protocol

from kybflow.core.signals import Estimate
from kybflow.parts.observables import Unavailable


class _Estimating(Protocol):
    estimate: Estimate | None


class EstimatorView:
    """The newest estimate of `candidate`, an estimator of a vehicle's list: its age in seconds and
    its spread in metres, both infinite without an estimate."""

    def __init__(self, candidate: _Estimating) -> None:
        self._candidate = candidate

    @property
    def age(self) -> float:
        estimate = self._candidate.estimate
        return inf if estimate is None else estimate.age

    @property
    def spread(self) -> float:
        estimate = self._candidate.estimate
        return inf if estimate is None else estimate.spread

    def _never(self) -> Any:
        raise Unavailable

    state = wanted = battery = behavior = estimator = elapsed = start = property(_never)
    payload = payload_place = releases = sticks = property(_never)
