"""The faults of a rehearsed mission, which begin but have no effect.

The rehearsal thereby knows when they begin, which expectations fail for another reason, and which
faults come too late. A fault explains a failed expectation only if

- the expectation had not failed before the first fault began,
- it is about a vehicle that a fault affects, or flows and callbacks connect the vehicles, and
- it is not about a place that is further than `_ASTRAY` from the whole flight. A fault may end a
  flight early or push the vehicle, but sends it nowhere else if all its states were flown.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from kybflow.api.rehearsal import findings
from kybflow.core.params import named_in
from kybflow.core.signals import Event
from kybflow.dsl.checks.conditions import nodes
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.expressions import tree
from kybflow.dsl.plan import ExpectationPlan, FaultPlan, Plan
from kybflow.parts import Effect, Fault
from kybflow.runtime.engine import Engine
from kybflow.runtime.expectations import Verdict

_ASTRAY = 1.0
"""How far a fault may carry a vehicle off its path before the failsafe acts, m."""
_LATE_FACTOR, _LATE_S = 1.5, 10.0
"""A real flight lasts at most this factor and these seconds longer than the rehearsal's."""
_PLACES = ("state.x", "state.y", "state.altitude")


class Harmless(Fault[object]):
    """Stands for any fault; it begins, but has no effect."""

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {}


def harmless(plan: Plan) -> Plan:
    """Return the plan with faults that have no effect, and with an additional `eventually` for each
    `finally`, which tells how near its value came."""
    faults = (replace(f, part=replace(f.part, cls=Harmless)) for f in plan.faults)
    return plan.but(
        faults=tuple(faults), expectations=(*plan.expectations, *map(_nearest, plan.expectations))
    )


def _nearest(expectation: ExpectationPlan) -> ExpectationPlan:
    match expectation.expression:
        case tree.Finally(condition):
            return replace(expectation, expression=tree.Eventually(condition))
    return expectation


class FaultWatch:
    """Observes an engine whose faults are harmless."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._engine: Engine | None = None
        self._failed_before: frozenset[str] = frozenset()
        self._has_begun = False
        self._flown = set[tuple[str, str]]()
        self._landed: dict[str, float] = {}

    def begin(self, engine: Engine) -> None:
        """Attach to an engine. Called before the engine runs."""
        self._engine = engine

    def on_event(self, event: Event) -> None:
        engine = self._engine
        if engine is None:
            return
        match event.name:
            case "behavior_started":
                self._flown.add((event.vehicle, str(event.fields["behavior"])))
            case "landed":
                self._landed[event.vehicle] = engine.seconds()
            case "fault_injected" if not self._has_begun:
                self._has_begun = True
                paired = self._paired(engine.judge.verdicts(None))
                self._failed_before = frozenset(v.text for v, e in paired if _is_lost(v, e, engine))

    def _paired(self, verdicts: tuple[Verdict, ...]) -> Iterator[tuple[Verdict, tree.Expression]]:
        return zip(verdicts, (e.expression for e in self._plan.expectations), strict=False)

    def unexplained(self, verdicts: tuple[Verdict, ...]) -> Iterator[Verdict]:
        """Yield the failed verdicts that no fault can explain."""
        nearest = verdicts[len(self._plan.expectations) :]
        for (verdict, expression), near in zip(self._paired(verdicts), nearest, strict=True):
            if not verdict.held and not self._explains(verdict, expression, near):
                yield verdict

    def _explains(self, verdict: Verdict, expression: tree.Expression, near: Verdict) -> bool:
        plan = self._plan
        if not self._has_begun and not any(fault.when for fault in plan.faults):
            return False
        if verdict.text in self._failed_before:
            return False
        broken = {fault.vehicle for fault in plan.faults}
        broken |= {n for f in plan.faults for n in named_in(f.part.params, "vehicle").values()}
        about = set(_vehicles(expression))
        if about and about.isdisjoint(broken) and not (plan.flows or plan.callbacks):
            return False
        states = (
            (vehicle.name, state.name)
            for vehicle in plan.vehicles
            for state in vehicle.states.values()
            if vehicle.name in broken and not state.built_in
        )
        is_far = near.margin is not None and near.margin < -_ASTRAY
        return not (is_far and _is_of_a_place(expression) and self._flown.issuperset(states))

    def diagnostics(self, texts: Mapping[str, str]) -> Iterator[Diagnostic]:
        """Yield the findings about faults that come too late or never."""
        for fault in self._plan.faults:
            ended = self._landed.get(fault.vehicle)
            if fault.time is None or ended is None:
                continue
            if fault.time > _LATE_FACTOR * ended + _LATE_S:
                name = fault.part.name
                yield findings.comes_too_late(name, fault.vehicle, ended, fault.at, texts)
        if len(self._plan.faults) == 1 and not self._has_begun:
            (fault,) = self._plan.faults
            if fault.when is not None and _is_of_states(fault):
                condition = tree.describe(fault.when)
                yield findings.never_comes(fault.part.name, condition, fault.at, texts)


def _is_lost(verdict: Verdict, expression: tree.Expression, engine: Engine) -> bool:
    """Return whether an expectation has failed for good, whatever follows."""
    match expression:
        case tree.Always():
            return not verdict.held and verdict.unknown == 0.0
        case tree.Eventually(_, within) | tree.Finished(within):
            return not verdict.held and within is not None and engine.mission_seconds() > within
        case tree.Compare(operator, tree.Aggregate(function)):
            is_bound = (function, operator[0]) in (("max", "<"), ("min", ">"))
            return is_bound and verdict.value is not None and not verdict.held
    return False


def _vehicles(expression: tree.Expression) -> Iterator[str]:
    for node in nodes(expression):
        match node:
            case tree.Read(str(vehicle)) | tree.InState(vehicle) | tree.Location(str(vehicle)):
                yield vehicle
            case tree.GroupInState(_, _, vehicles) | tree.Separation(vehicles):
                yield from vehicles


def _is_of_a_place(expression: tree.Expression) -> bool:
    match expression:
        case tree.Eventually(tree.Compare(_, left)) | tree.Finally(tree.Compare(_, left)):
            is_read = isinstance(left, tree.Read) and left.name in _PLACES
            return is_read or isinstance(left, tree.Distance | tree.Separation)
    return False


def _is_of_states(fault: FaultPlan) -> bool:
    """Return whether the condition of a fault reads nothing that differs on ideal vehicles."""
    reads = (node for node in nodes(fault.when) if isinstance(node, tree.Read))
    return all(node.name in ("behavior", "elapsed") for node in reads)
