"""Which estimator a vehicle flies on: the first healthy one of its list, with hysteresis.

One that raises, or whose estimate is not finite, is not asked again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import EstimatorPlan, VehiclePlan
from kybflow.errors import PartFailed
from kybflow.observables import Unavailable
from kybflow.parts import Estimator
from kybflow.runtime.checked import checked_estimate
from kybflow.runtime.conditions import bind
from kybflow.runtime.events import Events
from kybflow.runtime.making import make
from kybflow.runtime.outcome import VehicleScore
from kybflow.signals import NS, Estimate, Measurement, Time
from kybflow.site import Site


class Candidate:
    """One estimator of the list with its health; also the view that its health condition reads.

    It is healthy while its condition holds. Once it was not, it must hold for `recover_after`
    seconds before it counts again. `for_at_most` bounds the time in which it may be used at a
    stretch.
    """

    def __init__(self, plan: EstimatorPlan, site: Site) -> None:
        self.label = plan.part.label
        self.name = self.label.rpartition(".")[2]
        self.part: Estimator[Any] = make(plan.part, plan.part.params, site)
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
        """Take the measurements; whether the estimator is healthy now. Raises whatever the part
        raises, and ValueError for an estimate that is not finite."""
        self.estimate = estimate = self.part.update(measurements, now)
        if estimate is None or not (checked_estimate(estimate) and self._holds()):
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
    """The list of a vehicle's estimators. `report` is told of one that has failed."""

    def __init__(
        self,
        plan: VehiclePlan,
        site: Site,
        events: Events,
        score: VehicleScore,
        report: Callable[[PartFailed], None],
    ) -> None:
        self._candidates = [Candidate(estimator, site) for estimator in plan.estimators]
        self._in_use: Candidate | None = None
        self._vehicle, self._events, self._score, self._report = plan.name, events, score, report

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        """The estimate of the first healthy estimator, None when none is healthy."""
        chosen: Candidate | None = None
        for candidate in self._candidates:
            try:
                healthy = candidate.update(measurements, now)
            except Exception as error:  # a part may raise anything
                self._candidates = [c for c in self._candidates if c is not candidate]
                self._report(PartFailed(candidate.label, error))
                continue
            if healthy and chosen is None:
                chosen = candidate
        if chosen is not self._in_use:
            self._change(chosen, now)
        return chosen.estimate if chosen is not None else None

    @property
    def source(self) -> str | None:
        """The name of the estimator in use."""
        return self._in_use.name if self._in_use is not None else None

    def parts(self) -> dict[str, Any]:
        """The living estimators by label."""
        return {candidate.label: candidate.part for candidate in self._candidates}

    def _change(self, chosen: Candidate | None, now: Time) -> None:
        previous = self._in_use
        if previous is not None:
            previous.in_use_since = None
        self._in_use = chosen
        before = previous.name if previous is not None else None
        if chosen is None:
            self._events.tell("estimate_lost", self._vehicle, previous=before)
            self._score.estimator("", now / NS)
        else:
            chosen.in_use_since = now
            for other in self._candidates:
                if other is not chosen:
                    other.renew()
            name = chosen.name
            self._events.tell("estimator_changed", self._vehicle, estimator=name, previous=before)
            self._score.estimator(name, now / NS)
