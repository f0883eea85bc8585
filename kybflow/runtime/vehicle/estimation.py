"""Which estimator a vehicle flies on: the first healthy one of its list, with hysteresis.

Where none has been healthy for long enough, one that has become so just now is better than none:
hysteresis keeps from changing to and fro, not from flying. One that raises, or whose estimate is
not finite, is not asked again. The others are told in every tick what the one in use estimates. A
behavior may name those that come first while it is active. Where the one in use changes, the
estimate goes on without a step (`kybflow.runtime.vehicle.blending`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from kybflow.core.errors import PartFailed
from kybflow.core.signals import NS, Estimate, Measurement, MeasurementKind, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.runtime.events import Events
from kybflow.runtime.scores import VehicleScore
from kybflow.runtime.vehicle.blending import Blend
from kybflow.runtime.vehicle.candidate import Candidate
from kybflow.world.vehicle_context import VehicleContext

Known = Callable[[frozenset[MeasurementKind]], str]


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
        self._blend: Blend | None = None
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
            offset, self._blend = Blend.between(last, estimate)
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
