"""Which estimator a vehicle flies on: the first healthy one of its list, with hysteresis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import EstimatorPlan
from kybflow.observables import Unavailable
from kybflow.parts import Estimator
from kybflow.runtime.conditions import bind
from kybflow.signals import NS, Battery, Estimate, Measurement, Time
from kybflow.site import Site


class Candidate:
    """One estimator of the list with its health; also the view that its health condition reads.

    It is healthy while its condition holds. Once it was not, it must hold for `recover_after`
    seconds before it counts again. `for_at_most` bounds the time in which it may be used at a
    stretch.
    """

    def __init__(self, plan: EstimatorPlan, site: Site) -> None:
        self.name = plan.part.label.rpartition(".")[2]
        self.part: Estimator[Any] = plan.part.cls(plan.part.params, site)
        self.estimate: Estimate | None = None
        self.in_use_since: Time | None = None
        self._recover = round(plan.recover_after * NS)
        self._at_most = None if plan.for_at_most is None else round(plan.for_at_most * NS)
        self._healthy_since: Time | None = None
        self._was_lost = False
        self._spent = False
        self._holds = self._bound(plan.healthy)

    def _bound(self, healthy: Expression | None) -> Callable[[], bool]:
        if healthy is None:
            return lambda: True
        return bind(healthy, {self.name: self}, self.name, lambda: 0.0)

    def update(self, measurements: Sequence[Measurement], now: Time) -> bool:
        """Take the measurements; whether the estimator is healthy now."""
        self.estimate = self.part.update(measurements, now)
        if self.estimate is None or not self._holds():
            self._was_lost = self._was_lost or self._healthy_since is not None
            self._healthy_since = None
            return False
        if self._healthy_since is None:
            self._healthy_since = now
        if self._at_most is not None and self.in_use_since is not None:
            self._spent = now - self.in_use_since >= self._at_most
        recovered = not self._was_lost or now - self._healthy_since >= self._recover
        return recovered and not self._spent

    def renew(self) -> None:
        """Another estimator is used: this one may be used again for its time."""
        self._spent = False

    @property
    def age(self) -> float:
        return self._known().age

    @property
    def spread(self) -> float:
        return self._known().spread

    def _known(self) -> Estimate:
        if self.estimate is None:
            raise Unavailable
        return self.estimate

    def _never(self) -> Any:
        raise Unavailable

    state = wanted = battery = behavior = estimator = elapsed = start = property(_never)


class Estimation:
    """The list of a vehicle's estimators."""

    def __init__(self, plans: Sequence[EstimatorPlan], site: Site) -> None:
        self.candidates = [Candidate(plan, site) for plan in plans]
        self.in_use: Candidate | None = None

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        """The estimate of the first healthy estimator, None when none is healthy."""
        chosen: Candidate | None = None
        for candidate in self.candidates:
            healthy = candidate.update(measurements, now)
            if healthy and chosen is None:
                chosen = candidate
        if chosen is not self.in_use:
            self._change(chosen, now)
        return chosen.estimate if chosen is not None else None

    def _change(self, chosen: Candidate | None, now: Time) -> None:
        if self.in_use is not None:
            self.in_use.in_use_since = None
        if chosen is not None:
            chosen.in_use_since = now
            for other in self.candidates:
                if other is not chosen:
                    other.renew()
        self.in_use = chosen


def newest_battery(measurements: Sequence[Measurement]) -> Battery | None:
    """The last battery report among `measurements`."""
    for measurement in reversed(measurements):
        if type(measurement) is Battery:
            return measurement
    return None
