"""Which estimator a vehicle flies on: the first healthy one of its list, with hysteresis.

Where none has been healthy for long enough, one that has become so just now is better than none:
hysteresis keeps from changing to and fro, not from flying. One that raises, or whose estimate is
not finite, is not asked again. The others are told in every tick what the one in use estimates. A
behavior may name those that come first while it is active. Where the one in use changes, the
estimate goes on without a step (`kybflow.runtime.vehicle.blending`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import Any

from kybflow.core.errors import PartFailed
from kybflow.core.signals import NS, Estimate, Measurement, MeasurementKind, Time
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import EstimatorPlan, VehiclePlan
from kybflow.parts import Estimator
from kybflow.parts.observables import Unavailable
from kybflow.runtime.conditions import bind
from kybflow.runtime.events import Events
from kybflow.runtime.finite import checked_estimate
from kybflow.runtime.making import make
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.blending import EstimateBlend
from kybflow.world.vehicle_context import VehicleContext

Known = Callable[[frozenset[MeasurementKind]], str]


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


class Estimation:
    """The list of a vehicle's estimators. `report` is told of one that has failed. `known` says
    what is known to be wrong with measurements of these kinds, in words; nothing for nothing."""

    def __init__(
        self,
        plan: VehiclePlan,
        context: VehicleContext,
        events: Events,
        score: VehicleScore,
        report: Callable[[PartFailed], None],
        known: Known = lambda _: "",
    ) -> None:
        self._listed = [Candidate(estimator, context) for estimator in plan.estimators]
        self._candidates = self._listed
        self._preferred: tuple[str, ...] = ()
        self._is_reordered = False
        self._bounded = [candidate for candidate in self._candidates if candidate.is_bounded]
        self._in_use: Candidate | None = None
        self._flown: Estimate | None = None
        self._blend: EstimateBlend | None = None
        self._was_used = False
        self._time: Time = 0
        self._vehicle, self._events, self._score, self._report = plan.name, events, score, report
        self._known = known

    def update(self, measurements: Sequence[Measurement], now: Time) -> Estimate | None:
        """The estimate of the first healthy estimator, None when none is healthy."""
        if self._bounded:
            self._count(now)
        chosen: Candidate | None = None
        for candidate in self._candidates:
            try:
                healthy = candidate.update(measurements, now)
            except Exception as error:  # a part may raise anything
                self._fail(candidate, error)
                continue
            if healthy and chosen is None:
                chosen = candidate
        if chosen is None:
            chosen = next((c for c in self._candidates if c.is_usable), None)
        estimate = chosen.estimate if chosen is not None else None
        if chosen is not self._in_use:
            self._change(chosen, estimate, now)
        self._is_reordered = False
        self._flown = estimate if self._blend is None else self._blended(estimate, now)
        if estimate is not None and len(self._candidates) > 1:
            self._anchor(estimate)
        return self._flown

    def prefer(self, names: tuple[str, ...]) -> None:
        """From now on the estimators of these names come first, in this order, then the others in
        that of the mission."""
        if names == self._preferred:
            return
        self._preferred, self._is_reordered = names, True
        rank = {name: index for index, name in enumerate(names)}
        living = [candidate for candidate in self._listed if not candidate.has_failed]
        self._candidates = sorted(living, key=lambda c: rank.get(c.name, len(rank)))

    @property
    def candidates(self) -> Sequence[Candidate]:
        """The living estimators, those that come first at present first."""
        return self._candidates

    def kill(self, names: frozenset[str]) -> None:
        """Let the estimators of these names fail as if they had raised."""
        for candidate in self._candidates:
            if candidate.name in names:
                self._fail(candidate, RuntimeError("killed by a fault of the mission"))

    @property
    def source(self) -> str | None:
        """The name of the estimator in use."""
        return self._in_use.name if self._in_use is not None else None

    def parts(self) -> dict[str, Any]:
        """The living estimators by label."""
        return {candidate.label: candidate.part for candidate in self._candidates}

    def _count(self, now: Time) -> None:
        passed, self._time = now - self._time, now
        used = self._in_use
        if used is not None:
            for candidate in self._bounded:
                candidate.count(passed, used)

    def _anchor(self, estimate: Estimate) -> None:
        """Tell the others what the vehicle flies on, without what is left of an offset."""
        for candidate in self._candidates:
            if candidate.anchors and candidate is not self._in_use:
                try:
                    candidate.part.anchor(estimate)
                except Exception as error:  # a part may raise anything
                    self._fail(candidate, error)

    def _fail(self, failed: Candidate, error: Exception) -> None:
        failed.has_failed = True
        self._candidates = [c for c in self._candidates if c is not failed]
        self._bounded = [c for c in self._bounded if c is not failed]
        self._report(PartFailed(failed.label, error))

    def _gain(self, name: str) -> str:
        """Why another is flown on though nothing is wrong with the last one."""
        if not self._is_reordered:
            return f"`{name}` is healthy again"
        return f"`{name}` comes first {'in this behavior' if self._preferred else 'again'}"

    def _blended(self, estimate: Estimate | None, now: Time) -> Estimate | None:
        if self._blend is None or estimate is None:
            return estimate
        if self._blend.is_over(now):
            self._blend = None
            return estimate
        return self._blend.applied(estimate)

    def _why(self, previous: Candidate) -> str:
        """Why it can't be used any more, and what is known of that; empty where it can."""
        known = self._known(previous.uses) if previous.is_starved else ""
        return f"{previous.trouble}; {known}" if known else previous.trouble

    def _change(self, chosen: Candidate | None, estimate: Estimate | None, now: Time) -> None:
        previous, self._in_use = self._in_use, chosen
        before, reason = None, "there was none" if self._was_used else "the first estimate"
        if previous is not None:
            before, reason = previous.name, self._why(previous)
        self._was_used = True
        last, self._blend = self._flown, None
        if chosen is None or estimate is None:
            self._events.tell("estimator_lost", self._vehicle, previous=before, reason=reason)
            self._score.estimator("", now / NS)
            return
        offset = 0.0
        if last is not None:
            offset, self._blend = EstimateBlend.between(last, estimate)
        self._events.tell(
            "estimator_changed",
            self._vehicle,
            estimator=chosen.name,
            previous=before,
            reason=reason or self._gain(chosen.name),
            offset=offset,
            blended=self._blend is not None,
        )
        self._score.estimator(chosen.name, now / NS)
