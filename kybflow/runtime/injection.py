"""Faults at work: each of the plan's is injected at its time or when its condition first holds, and
mended when its own time is over."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence

from kybflow.dsl.expressions import Expression
from kybflow.dsl.plan import FaultPlan
from kybflow.errors import described
from kybflow.parts import Effect, Rig
from kybflow.runtime.events import Events
from kybflow.signals import NS, Time

Conditions = Callable[[str], Callable[[Expression], Callable[[], bool]]]
"""By vehicle: what makes a closure of a condition of its."""


class Injection:
    """The engine calls `step` once a tick, before anything is sensed. Chance comes from `seed` and
    the fault's place in the mission. `failure` says which fault could not be injected, and why;
    None while all could."""

    def __init__(
        self,
        faults: Sequence[FaultPlan],
        rigs: Mapping[str, Rig],
        conditions: Conditions,
        events: Events,
        seed: int,
    ) -> None:
        self.failure: str | None = None
        self._rigs, self._events = rigs, events
        self._waiting = [
            _Waiting(plan, _due(plan, conditions), random.Random(f"{seed} {i} {plan.part.name}"))
            for i, plan in enumerate(faults)
        ]
        self._working: list[_Working] = []

    def step(self, now: Time) -> None:
        """Mend what is over, then inject what is due."""
        if self._working:
            over = [fault for fault in self._working if fault.over(now)]
            self._working = [fault for fault in self._working if fault not in over]
            for fault in over:
                self._mend(fault)
        for waiting in tuple(self._waiting):
            try:
                if waiting.due(now):
                    self._waiting.remove(waiting)
                    self._inject(waiting, now)
            except Exception as error:  # a lab's own fault may raise anything; the flight goes on
                self._fail(waiting, error)

    def _inject(self, waiting: _Waiting, now: Time) -> None:
        plan = waiting.plan
        fault = plan.part.cls(plan.part.params, waiting.generator)
        effects = [(self._rigs[n], e) for n, e in fault.effects(plan.vehicle).items()]
        for rig, effect in effects:
            rig.begin(effect, now)
        self._events.tell("fault_injected", plan.vehicle, plan.at, fault=plan.part.name)
        self._working.append(_Working(plan, effects, now))

    def _fail(self, waiting: _Waiting, error: Exception) -> None:
        if waiting in self._waiting:
            self._waiting.remove(waiting)
        plan, name = waiting.plan, waiting.plan.part.name
        self.failure = f"the fault `{name}` could not be injected: {described(error)}"
        self._events.tell("fault_failed", plan.vehicle, plan.at, fault=name, reason=self.failure)

    def _mend(self, fault: _Working) -> None:
        for rig, effect in fault.effects:
            rig.end(effect)
        plan = fault.plan
        self._events.tell("fault_ended", plan.vehicle, plan.at, fault=plan.part.name)


class _Waiting:
    """A fault that was not injected yet."""

    def __init__(
        self, plan: FaultPlan, due: Callable[[Time], bool], generator: random.Random
    ) -> None:
        self.plan, self.due, self.generator = plan, due, generator


class _Working:
    """A fault that is at work."""

    def __init__(self, plan: FaultPlan, effects: list[tuple[Rig, Effect]], began: Time) -> None:
        self.plan, self.effects = plan, effects
        lasts = plan.duration
        self._until = None if lasts is None else began + round(lasts * NS)

    def over(self, now: Time) -> bool:
        return self._until is not None and now >= self._until


def _due(plan: FaultPlan, conditions: Conditions) -> Callable[[Time], bool]:
    """Whether a fault that was not injected yet is to be, now."""
    if plan.when is not None:
        holds = conditions(plan.vehicle)(plan.when)
        return lambda _: holds()
    begins = round((plan.time or 0.0) * NS)
    return lambda now: now >= begins
