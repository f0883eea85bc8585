"""The view (`observables.View`) of an estimator's last estimate that its health condition reads.

It has its own module because mypyc, which compiles `estimation`, doesn't support a property with
several names.
"""

from __future__ import annotations

from math import inf
from typing import Any, Protocol

from kybflow.core.geometry import Vec3
from kybflow.core.signals import Estimate
from kybflow.parts.observables import ObjectView, ObstacleView, Unavailable


class _Estimating(Protocol):
    estimate: Estimate | None


class EstimatorView:
    """A view of the newest estimate of one of a vehicle's estimators: its age in seconds and its
    spread in metres, both infinite without an estimate. Reading any other value raises
    Unavailable."""

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

    state = wanted = battery = behavior = estimator = elapsed = airborne = property(_never)
    start = hull = contact = contact_time = property(_never)
    payload = payload_place = releases = sticks = property(_never)

    def obstacle(self, name: str) -> ObstacleView:
        raise Unavailable

    def object(self, name: str) -> ObjectView:
        raise Unavailable

    def object_place(self, name: str, surface: str) -> Vec3:
        raise Unavailable
