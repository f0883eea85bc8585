"""One estimator of a vehicle's list with its health."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import Any

from kybflow.core.signals import NS, Estimate, Measurement, Time
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import EstimatorPlan
from kybflow.parts import Estimator
from kybflow.parts.observables import Unavailable
from kybflow.runtime.conditions import bind
from kybflow.runtime.finite import checked_estimate
from kybflow.runtime.making import make
from kybflow.world.vehicle_context import VehicleContext


class Candidate:
    """One estimator of the list with its health; also the view that its health condition reads:
    `age` and `spread` are those of the last estimate.

    It is healthy while its condition holds. Once it was not, it must hold for `recover_after`
    seconds before it is preferred to another again; to none at all it is preferred at once.
    `for_at_most` bounds the time in which it may be used: the time of use is counted, and counted
    back while another is used. Spent, it may be used again when all is counted back, so that
    neither a moment's health of another nor none at all renews it.
    """

    def __init__(self, plan: EstimatorPlan, context: VehicleContext) -> None:
        self.label = plan.part.label
        self.name = self.label.rpartition(".")[2]
        self.part: Estimator[Any] = make(plan.part, plan.part.params, context)
        self.uses = plan.part.cls.uses(plan.part.params)
        self.estimate: Estimate | None = None
        self.age = self.spread = inf
        self.has_failed = False
        self.anchors = type(self.part).anchor is not Estimator.anchor
        self._recover = round(plan.recover_after * NS)
        self._at_most = None if plan.for_at_most is None else round(plan.for_at_most * NS)
        self._used: Time = 0
        self._is_spent = False
        self._healthy_since: Time | None = None
        self._was_lost = False
        self._holds = self._bound(plan.healthy)

    def _bound(self, healthy: Expression | None) -> Callable[[], bool]:
        if healthy is None:
            return lambda: True
        return bind(healthy, {self.name: self}, self.name, lambda: 0.0)

    def update(self, measurements: Sequence[Measurement], now: Time) -> bool:
        """Take the measurements; whether the estimator may be used now. Raises whatever the part
        raises, and ValueError for an estimate that is not finite."""
        self.estimate = estimate = self.part.update(measurements, now)
        if estimate is not None:
            checked_estimate(estimate)
            self.age, self.spread = estimate.age, estimate.spread
        if estimate is None or not self._holds():
            self._was_lost = self._was_lost or self._healthy_since is not None
            self._healthy_since = None
            return False
        if self._healthy_since is None:
            self._healthy_since = now
        recovered = not self._was_lost or now - self._healthy_since >= self._recover
        return recovered and not self._is_spent

    @property
    def is_bounded(self) -> bool:
        """Whether it may be used for a time only."""
        return self._at_most is not None

    @property
    def is_usable(self) -> bool:
        """Better than nothing: healthy now, however short, and not spent."""
        return self._healthy_since is not None and not self._is_spent

    def count(self, passed: Time, used: Candidate) -> None:
        """In the last `passed` nanoseconds `used` was flown on. Only where its time is bounded."""
        assert self._at_most is not None
        self._used = self._used + passed if used is self else max(self._used - passed, 0)
        self._is_spent = self._used >= self._at_most or (self._is_spent and self._used > 0)

    @property
    def is_starved(self) -> bool:
        """Whether what came to it is why it can't be used now."""
        return not self.has_failed and self._healthy_since is None

    @property
    def trouble(self) -> str:
        """Why it can't be used now, in words; empty while it can."""
        estimate = self.estimate
        if self.has_failed:
            return f"`{self.name}` failed"
        if estimate is None:
            return f"`{self.name}` has no estimate"
        if self._healthy_since is None:
            figures = f"age {estimate.age:.3f} s, spread {estimate.spread:.3f} m"
            return f"`{self.name}` is not healthy: {figures}"
        if self._at_most is not None and self._is_spent:
            return f"`{self.name}` may be used for {self._at_most / NS:g} s"
        return ""

    def _never(self) -> Any:
        raise Unavailable

    state = wanted = battery = behavior = estimator = elapsed = start = property(_never)
    payload = payload_place = releases = sticks = property(_never)
