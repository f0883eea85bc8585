"""Fault injection: starts each fault of the plan at its time or when its condition first holds, and
ends it after its duration. A fault that raises is reported and removed, and the flight
continues."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isfinite

from kybflow.core.errors import described, traceback_of
from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.signals import NS, Measurement, Time
from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import FaultPlan
from kybflow.parts import ActiveFaults, Effect, Filter
from kybflow.parts.events import FaultEnded, FaultFailed, FaultInjected
from kybflow.parts.fault import Air
from kybflow.runtime.events import Events

Conditions = Callable[[str], Callable[[Expression], Callable[[], bool]]]
"""Takes a vehicle's name; returns a function that compiles conditions of that vehicle."""


class Injection:
    """Injects the faults of a plan. The engine calls `step` once a tick, before the vehicles sense.
    Each fault's random generator is seeded with `seed` and the fault's index and name. failure:
    which fault failed last and why, or None."""

    def __init__(
        self,
        faults: Sequence[FaultPlan],
        active: Mapping[str, ActiveFaults],
        conditions: Conditions,
        events: Events,
        seed: int,
    ) -> None:
        self.failure: str | None = None
        self._active, self._events = active, events
        self._waiting = [
            _Waiting(plan, _due(plan, conditions), random.Random(f"{seed} {i} {plan.part.name}"))
            for i, plan in enumerate(faults)
        ]
        self._working: list[_Working] = []

    @property
    def never_injected(self) -> list[FaultPlan]:
        """The faults whose time or condition has not come."""
        return [waiting.plan for waiting in self._waiting]

    def step(self, now: Time) -> None:
        """End the faults that are over or have failed, then inject those that are due."""
        if self._working:
            over = [fault for fault in self._working if fault.failed or fault.over(now)]
            self._working = [fault for fault in self._working if fault not in over]
            for fault in over:
                _take_away(fault)
                if not fault.failed:
                    ended, plan = FaultEnded(fault=fault.plan.part.name), fault.plan
                    self._events.emit(ended, plan.vehicle, plan.at)
        for waiting in tuple(self._waiting):
            try:
                if waiting.due(now):
                    self._waiting.remove(waiting)
                    self._inject(waiting, now)
            except Exception as error:  # a lab's own fault may raise anything; the flight goes on
                if waiting in self._waiting:
                    self._waiting.remove(waiting)
                self._fail(waiting.plan, "could not be injected", error)

    def _inject(self, waiting: _Waiting, now: Time) -> None:
        plan = waiting.plan
        fault = plan.part.cls(plan.part.params, waiting.generator)
        working = _Working(plan, now, self._fail)
        for name, effect in fault.effects(plan.vehicle).items():
            working.effects.append((self._active[name], working.guarded(effect)))
        try:
            for active, effect in working.effects:
                active.begin(effect, now)
        except Exception:
            _take_away(working)
            raise
        self._events.emit(FaultInjected(fault=plan.part.name), plan.vehicle, plan.at)
        self._working.append(working)

    def _fail(self, plan: FaultPlan, how: str, error: Exception) -> None:
        name = plan.part.name
        self.failure = f"the fault `{name}` {how}: {described(error)}"
        failed = FaultFailed(fault=name, reason=self.failure, traceback=traceback_of(error))
        self._events.emit(failed, plan.vehicle, plan.at)


def _take_away(fault: _Working) -> None:
    for active, effect in fault.effects:
        active.end(effect)


class _Waiting:
    """A fault that has not been injected yet."""

    def __init__(
        self, plan: FaultPlan, due: Callable[[Time], bool], generator: random.Random
    ) -> None:
        self.plan, self.due, self.generator = plan, due, generator


class _Working:
    """An active fault. If one of its effects raises, the fault calls `fail`, has no effect from
    then on, and ends in the next tick."""

    def __init__(
        self, plan: FaultPlan, began: Time, fail: Callable[[FaultPlan, str, Exception], None]
    ) -> None:
        self.plan, self.failed = plan, False
        self.effects: list[tuple[ActiveFaults, Effect]] = []
        self._fail = fail
        lasts = plan.duration
        self._until = None if lasts is None else began + round(lasts * NS)

    def over(self, now: Time) -> bool:
        return self._until is not None and now >= self._until

    def guarded(self, effect: Effect) -> Effect:
        """Return `effect` with its functions wrapped so that an exception fails only this fault."""
        change, blow = effect.filter, effect.wind
        return replace(
            effect,
            filter=None if change is None else self._filter(change),
            wind=None if blow is None else self._wind(blow),
        )

    def _filter(self, change: Filter) -> Filter:
        def changed(measurement: Measurement) -> Measurement | None:
            if self.failed:
                return measurement
            try:
                given, kind = change(measurement), type(measurement)
                if given is not None and type(given) is not kind:
                    raise TypeError(f"its filter returned {given!r} for a {kind.__name__}")
                return given
            except Exception as error:  # a lab's own fault may raise anything
                self._has_failed(error)
                return measurement

        return changed

    def _wind(self, blow: Air) -> Air:
        def blown(seconds: float) -> Vec3:
            if self.failed:
                return ZERO
            try:
                x, y, z = wind = blow(seconds)
                if not isfinite(x + y + z):
                    raise ValueError(f"its wind is not finite: {wind}")
                return wind
            except Exception as error:  # a lab's own fault may raise anything
                self._has_failed(error)
                return ZERO

        return blown

    def _has_failed(self, error: Exception) -> None:
        self.failed = True
        self._fail(self.plan, "failed at work", error)


def _due(plan: FaultPlan, conditions: Conditions) -> Callable[[Time], bool]:
    """Return a function that returns whether the fault is due at a given time."""
    if plan.when is not None:
        holds = conditions(plan.vehicle)(plan.when)
        return lambda _: holds()
    begins = round((plan.time or 0.0) * NS)
    return lambda now: now >= begins
