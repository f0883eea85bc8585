"""What an estimator's health condition reads (`observables.View`)."""

from __future__ import annotations

from math import inf
from typing import Any

from kybflow.parts.observables import Unavailable


class EstimatorView:
    """An estimator by its last estimate, for its own health condition."""

    def __init__(self) -> None:
        self.age = self.spread = inf

    def _never(self) -> Any:
        raise Unavailable

    state = wanted = battery = behavior = estimator = elapsed = start = property(_never)
    payload = payload_place = releases = sticks = property(_never)
