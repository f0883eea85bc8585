"""Checks conditions, estimator health and expectations: their syntax and types (KYB210 to KYB214,
`kybflow.dsl.expressions.parse`), waits longer than the run (KYB259), and states and values that
never occur (KYB257, KYB258)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import NamedTuple

from kybflow.core.signals import Battery, Sticks
from kybflow.core.units import DURATION, format_quantity
from kybflow.dsl.checks.case import Case, parsed_expectations, transitions_of
from kybflow.dsl.checks.space import the_time_limit
from kybflow.dsl.checks.transitions import reached_states
from kybflow.dsl.diagnostics import Diagnostic, Text
from kybflow.dsl.expressions import (
    Scope,
    parse,
    tree,
)
from kybflow.dsl.language.records import Record
from kybflow.dsl.plan import VehiclePlan
from kybflow.parts import GROUND
from kybflow.parts.observables import OBSERVABLES, chains_of


def conditions(case: Case) -> Iterator[Diagnostic]:
    """Every `when` of a behavior must be a valid condition."""
    for vehicle, state in case.states():
        scope = case.scopes.condition(vehicle.name)
        for transition in state.transitions:
            yield from _misread(transition, "when", scope)


def callback_conditions(case: Case) -> Iterator[Diagnostic]:
    """Every `when` of a callback must be a valid condition."""
    for callback in case.plan.callbacks:
        yield from _misread(callback, "when", case.scopes.flow())


def health(case: Case) -> Iterator[Diagnostic]:
    """Every `healthy` of an estimator must be a valid condition."""
    for vehicle in case.plan.vehicles:
        for estimator in vehicle.estimators:
            yield from _misread(estimator, "healthy", case.scopes.health(vehicle.name))


def _misread(owner: Record, key: str, scope: Scope) -> Iterator[Diagnostic]:
    """Yield the errors in the condition under a key of a record."""
    text = owner.text_of(key)
    if text is not None:
        yield from parse(text, scope)[1]


def expectations(case: Case) -> Iterator[Diagnostic]:
    """Every line of `expect` must be a valid expectation."""
    for _, _, errors in case.cached(parsed_expectations):
        yield from errors


class TypedCondition(NamedTuple):
    """A condition as written and as parsed. own: the vehicle that it belongs to; None for an
    expectation, a callback or a flow. key: the key under which it is written: `when`, `healthy` or
    `expect`."""

    text: Text
    condition: tree.Condition
    own: str | None
    key: str


def after_the_end(case: Case) -> Iterator[Diagnostic]:
    """KYB259: a transition waits longer than the run lasts, so it is never taken.

    A run ends after `time_limit`, 600 s by default. Often the unit is wrong: `min` instead of `ms`.
    """
    limit = case.plan.time_limit
    for transition in transitions_of(case.plan):
        waits = max(transition.after or 0.0, transition.hold)
        if waits < limit:
            continue
        yield Diagnostic(
            "KYB259",
            f"`{transition.target}` is never reached: the wait of {_seconds(waits)} is too long",
            transition.span,
            label="the run ends before that",
            notes=(f"its `time_limit` is {_seconds(limit)}",),
            help="shorten the wait, or write a longer `time_limit`",
            related=the_time_limit(case),
        )


def _seconds(value: float) -> str:
    return format_quantity(value, DURATION)


def all_conditions(case: Case) -> Iterator[TypedCondition]:
    """Yield every condition, `healthy` and expectation that can be parsed."""
    yield from case.cached(conditions_of)
    yield from health_conditions(case)
    yield from case.cached(expected_conditions)


def conditions_of(case: Case) -> Iterator[TypedCondition]:
    """Yield every condition of a transition, callback, phase or fault that can be parsed."""
    plan, scopes = case.plan, case.scopes
    asking: list[tuple[Record, str]] = [
        (transition, vehicle.name)
        for vehicle, state in case.states()
        for transition in state.transitions
    ]
    asking += [(fault, fault.vehicle) for fault in plan.faults]
    for owner, own in asking:
        yield from _typed(case, owner, "when", scopes.condition(own), own)
    phases = (phase for flow in plan.flows for phase in flow.phases.values())
    shared = (transition for phase in phases for transition in phase.transitions)
    for one in (*plan.callbacks, *shared):
        yield from _typed(case, one, "when", scopes.flow(), None)


def health_conditions(case: Case) -> Iterator[TypedCondition]:
    """Yield every `healthy` that can be parsed."""
    for vehicle in case.plan.vehicles:
        scope = case.scopes.health(vehicle.name)
        for estimator in vehicle.estimators:
            yield from _typed(case, estimator, "healthy", scope, vehicle.name)


def _typed(
    case: Case, owner: Record, key: str, scope: Scope, own: str | None
) -> Iterator[TypedCondition]:
    text, condition = owner.text_of(key), case.condition(owner, key, scope)
    if text is not None and condition is not None:
        yield TypedCondition(text, condition, own, key)


def expected_conditions(case: Case) -> Iterator[TypedCondition]:
    """Yield the condition of every expectation, without its `always`, `eventually` or `finally`."""
    for text, expression in case.expected():
        match expression:
            case tree.Always(condition) | tree.Eventually(condition) | tree.Finally(condition):
                yield TypedCondition(text, condition, None, "expect")
            case tree.Compare(left=tree.Aggregate()) as condition:
                yield TypedCondition(text, condition, None, "expect")


_STICKS = "sticks."
_ESTIMATED = ("state.", "estimate.", "position_error", "velocity_error", "estimator")


def never_entered(case: Case) -> Iterator[Diagnostic]:
    """KYB257: a condition or an expectation names a state that its vehicle never enters.

    The state exists because the vehicle inherits it through `like`, but no transition, callback or
    flow leads to it (other unreachable states are reported as KYB204). A statistic of such a state
    has no values, and an `eventually` of it fails.
    """
    never = {v.name: _never(v) for v in case.plan.vehicles}
    if not any(never.values()):
        return
    for typed in (*case.cached(conditions_of), *case.cached(expected_conditions)):
        for vehicle, state in named_states(typed.condition, typed.own):
            if state in never.get(vehicle, ()):
                yield Diagnostic(
                    "KYB257",
                    f"`{vehicle}` never enters `{state}`",
                    typed.text.span,
                    label="the state never occurs",
                    help=f"let a transition lead to `{state}`, or name another state",
                )


def _never(vehicle: VehiclePlan) -> frozenset[str]:
    reached = reached_states(vehicle)
    if not vehicle.states.keys() & reached:
        return frozenset()
    entered = {name for state in reached for name in (state, *chains_of(state))}
    inherited = [name for name, state in vehicle.states.items() if state.inherited]
    known = {name for state in inherited for name in (state, *chains_of(state))}
    return frozenset(known - entered)


def named_states(condition: tree.Condition, own: str | None) -> Iterator[tuple[str, str]]:
    """Yield (vehicle, state) for each state that a condition names. own: the vehicle that the
    condition belongs to."""
    for node in nodes(condition):
        match node:
            case tree.InState(vehicle, state):
                yield vehicle, state
            case tree.GroupInState(_, _, vehicles, state):
                yield from ((vehicle, state) for vehicle in vehicles)
            case tree.Aggregate(_, _, str(vehicle), str(state)):
                yield vehicle, state
            case tree.Compare(_, tree.Read(vehicle, "behavior"), tree.Word(state)):
                yield vehicle or own or "", state


def not_measured(case: Case) -> Iterator[Diagnostic]:
    """KYB258: a condition or an expectation reads a value that the vehicle never has.

    The battery and a pilot's sticks are known if the target's driver reports them; sticks are not
    checked if the mission has its own `targets`. The position and the position error are known if
    the vehicle has an estimator, and the errors only in the air. A comparison with an unknown value
    is false.
    """
    for typed in case.cached(expected_conditions):
        match typed.condition:
            case tree.Compare(left=tree.Aggregate(_, tree.Read(_, name), str(own), str(state))) if (
                OBSERVABLES[name].aloft
                and (legs := case.legs(case.plan.fleet[own], state))
                and all(leg == (GROUND, GROUND) for leg in legs)
            ):
                yield Diagnostic(
                    "KYB258",
                    f"`{name}` of `{own}` is never known in `{state}`",
                    typed.text.span,
                    label="it is known only in the air",
                    help="name a state in the air",
                )
    telling = ("battery.", *_ESTIMATED)
    is_blind = any(_lacking(case, v, name) for v in case.plan.vehicles for name in telling)
    for typed in (*case.cached(conditions_of), *case.cached(expected_conditions)):
        if not is_blind and _STICKS not in typed.text.text:
            continue
        for node in nodes(typed.condition):
            if not isinstance(node, tree.Read):
                continue
            vehicle = case.plan.fleet.get(node.vehicle or typed.own or "")
            if vehicle is not None and (lacking := _lacking(case, vehicle, node.name)):
                yield Diagnostic(
                    "KYB258",
                    f"`{node.name}` of `{vehicle.name}` is never known",
                    typed.text.span,
                    label=lacking,
                    help="use another value, or give the vehicle what provides it",
                )


def _lacking(case: Case, vehicle: VehiclePlan, name: str) -> str:
    """Return in words what the vehicle lacks so that a value is never known; empty if it lacks
    nothing."""
    driver = vehicle.driver
    if name.startswith("battery.") and Battery not in driver.cls.provides:
        return f"`{driver.name}` reports no battery"
    is_here_alone = not case.plan.is_written("targets")
    if name.startswith(_STICKS) and is_here_alone and Sticks not in driver.cls.provides:
        return f"`{driver.name}` reports no pilot"
    if name.startswith(_ESTIMATED) and not vehicle.estimators:
        return f"`{vehicle.name}` has no estimator"
    return ""


def nodes(node: object) -> Iterator[object]:
    """Yield a node of an expression and all nodes below it."""
    yield node
    if isinstance(node, tuple):
        for inner in node:
            yield from nodes(inner)
    elif is_dataclass(node):
        for field in fields(node):
            yield from nodes(getattr(node, field.name))
