"""Conditions, health and expectations: read and typed (KYB210 to KYB214,
`kybflow.dsl.expressions.parse`), times that never come (KYB259), and what no flight can answer
(KYB257, KYB258)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import NamedTuple

from kybflow.core.signals import Battery, Sticks
from kybflow.core.units import DURATION, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.space import the_time_limit
from kybflow.dsl.checks.transitions import reached_states
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.diagnostics.spans import Text
from kybflow.dsl.document import TransitionEntry, VehicleEntry
from kybflow.dsl.expressions import (
    Always,
    Compare,
    Condition,
    Eventually,
    Finally,
    GroupInState,
    InState,
    Read,
    Word,
    parse,
)
from kybflow.dsl.expressions.tree import Aggregate
from kybflow.parts.observables import chains_of


def conditions(case: Case) -> Iterator[Diagnostic]:
    """Every `when` of every behavior."""
    for vehicle, state in case.states():
        scope = case.scopes.condition(vehicle.name.text)
        for transition in state.transitions:
            if transition.when is not None:
                yield from parse(transition.when, scope)[1]


def callback_conditions(case: Case) -> Iterator[Diagnostic]:
    """Every `when` of every callback."""
    for callback in case.document.callbacks:
        if callback.when is not None:
            yield from parse(callback.when, case.scopes.flow())[1]


def health(case: Case) -> Iterator[Diagnostic]:
    """Every estimator's `healthy`."""
    for vehicle in case.vehicles():
        for estimator in vehicle.estimators:
            if estimator.healthy is not None:
                yield from parse(estimator.healthy, case.scopes.health(vehicle.name.text))[1]


def expectations(case: Case) -> Iterator[Diagnostic]:
    """Every line of `expect`."""
    scope = case.scopes.expectation()
    for expectation in case.document.expect:
        yield from parse(expectation, scope)[1]


class TypedCondition(NamedTuple):
    """A condition as written and as understood. `own` is the vehicle that asks, None for an
    expectation, a callback and a flow."""

    text: Text
    condition: Condition
    own: str | None
    is_expected: bool = False


def after_the_end(case: Case) -> Iterator[Diagnostic]:
    """KYB259: a transition that waits for longer than the run lasts, so that it never fires.

    A run ends after `time_limit`, 600 s unless the mission says otherwise. Often a unit is wrong:
    `min` for `ms`.
    """
    limit = case.document.time_limit
    for transition in _transitions(case):
        waits = max(transition.after or 0.0, transition.hold)
        if waits < limit:
            continue
        yield Diagnostic(
            "KYB259",
            f"`{transition.target.text}` is never reached by a wait of {_seconds(waits)}",
            transition.span,
            label="the run is over before",
            notes=(f"its `time_limit` is {_seconds(limit)}",),
            help="wait for less, or write a longer `time_limit`",
            related=the_time_limit(case),
        )


def _seconds(value: float) -> str:
    return format_quantity(value, DURATION)


def _transitions(case: Case) -> Iterator[TransitionEntry]:
    for _, state in case.states():
        yield from state.transitions
    for flow in case.document.flows.values():
        for phase in flow.phases.values():
            yield from phase.transitions


def all_conditions(case: Case) -> Iterator[TypedCondition]:
    """Every condition, `healthy` and expectation that parses."""
    yield from case.cached(conditions_of)
    yield from health_conditions(case)
    yield from case.cached(expected_conditions)


def conditions_of(case: Case) -> Iterator[TypedCondition]:
    """Every condition of a transition, a callback, a phase and a fault that parses."""
    document, scopes = case.document, case.scopes
    written = [
        (transition.when, vehicle.name.text)
        for vehicle, state in case.states()
        for transition in state.transitions
    ]
    written += [(f.when, f.vehicle.text) for f in document.faults]
    shared = [callback.when for callback in document.callbacks]
    for flow in document.flows.values():
        shared += [
            transition.when for phase in flow.phases.values() for transition in phase.transitions
        ]
    for text, own in written:
        condition = case.condition(text, scopes.condition(own))
        if text is not None and condition is not None:
            yield TypedCondition(text, condition, own)
    for text in shared:
        condition = case.condition(text, scopes.flow())
        if text is not None and condition is not None:
            yield TypedCondition(text, condition, None)


def health_conditions(case: Case) -> Iterator[TypedCondition]:
    """Every `healthy` that parses."""
    for vehicle in case.vehicles():
        own = vehicle.name.text
        for text in (estimator.healthy for estimator in vehicle.estimators):
            condition = case.condition(text, case.scopes.health(own))
            if text is not None and condition is not None:
                yield TypedCondition(text, condition, own)


def expected_conditions(case: Case) -> Iterator[TypedCondition]:
    """The condition of every expectation, without its `always`, `eventually` or `finally`."""
    for text in case.document.expect:
        match parse(text, case.scopes.expectation())[0]:
            case Always(condition) | Eventually(condition) | Finally(condition):
                yield TypedCondition(text, condition, None, is_expected=True)
            case Compare(left=Aggregate()) as condition:
                yield TypedCondition(text, condition, None, is_expected=True)


_STICKS = "sticks."
_ESTIMATED = ("state.", "estimate.", "position_error", "velocity_error", "estimator")


def never_entered(case: Case) -> Iterator[Diagnostic]:
    """KYB257: a condition or an expectation asks for a state that its vehicle never enters.

    The state exists, but no transition, callback or flow leads to it; it came through `like`, else
    KYB204 would say so. A statistic of it is of no tick, an `eventually` of it fails.
    """
    never = {v.name.text: _never(v) for v in case.vehicles()}
    if not any(never.values()):
        return
    for typed in (*case.cached(conditions_of), *case.cached(expected_conditions)):
        for vehicle, state in named_states(typed.condition, typed.own):
            if state in never.get(vehicle, ()):
                yield Diagnostic(
                    "KYB257",
                    f"`{vehicle}` never enters `{state}`",
                    typed.text.span,
                    label="nothing to look at",
                    help=f"let a transition lead to `{state}`, or ask for another state",
                )


def _never(vehicle: VehicleEntry) -> frozenset[str]:
    reached = reached_states(vehicle)
    if not vehicle.states.keys() & reached:
        return frozenset()
    entered = {name for state in reached for name in (state, *chains_of(state))}
    inherited = [name for name, state in vehicle.states.items() if state.inherited]
    known = {name for state in inherited for name in (state, *chains_of(state))}
    return frozenset(known - entered)


def named_states(condition: Condition, own: str | None) -> Iterator[tuple[str, str]]:
    """(vehicle, state) of each state that a condition names; `own` is the vehicle that asks."""
    for node in nodes(condition):
        match node:
            case InState(vehicle, state):
                yield vehicle, state
            case GroupInState(_, _, vehicles, state):
                yield from ((vehicle, state) for vehicle in vehicles)
            case Aggregate(_, _, str(vehicle), str(state)):
                yield vehicle, state
            case Compare(_, Read(vehicle, "behavior"), Word(state)):
                yield vehicle or own or "", state


def not_measured(case: Case) -> Iterator[Diagnostic]:
    """KYB258: a condition or an expectation asks for a value that the vehicle never has.

    The battery is known where the target's driver reports it, as are a pilot's sticks, of which
    nothing is said where the mission has `targets` of its own; where the vehicle is, and how far
    from its setpoint, where it has an estimator. A comparison with a value that is not known is
    false.
    """
    telling = ("battery.", *_ESTIMATED)
    is_blind = any(_lacking(case, v, name) for v in case.vehicles() for name in telling)
    for typed in (*case.cached(conditions_of), *case.cached(expected_conditions)):
        if not is_blind and _STICKS not in typed.text.text:
            continue
        for node in nodes(typed.condition):
            vehicle = case.document.vehicles.get(_subject(node, typed))
            if vehicle is None or not isinstance(node, Read):
                continue
            lacking = _lacking(case, vehicle, node.name)
            if lacking:
                yield Diagnostic(
                    "KYB258",
                    f"`{node.name}` of `{vehicle.name.text}` is never known",
                    typed.text.span,
                    label=lacking,
                    help="ask for something else, or change what the vehicle has",
                )


def _subject(node: object, typed: TypedCondition) -> str:
    return (node.vehicle or typed.own or "") if isinstance(node, Read) else ""


def _lacking(case: Case, vehicle: VehicleEntry, name: str) -> str:
    """What the vehicle lacks to know a value, for the report; empty when it lacks nothing."""
    driver = vehicle.driver
    if name.startswith("battery.") and Battery not in driver.spec.cls.provides:
        return f"`{driver.name.text}` reports no battery"
    is_here_alone = "targets" not in case.document.spans
    if name.startswith(_STICKS) and is_here_alone and Sticks not in driver.spec.cls.provides:
        return f"`{driver.name.text}` reports no pilot"
    if name.startswith(_ESTIMATED) and not vehicle.estimators:
        return f"`{vehicle.name.text}` has no estimator"
    return ""


def nodes(node: object) -> Iterator[object]:
    """A node of an expression and all below it."""
    yield node
    if isinstance(node, tuple):
        for inner in node:
            yield from nodes(inner)
    elif is_dataclass(node):
        for field in fields(node):
            yield from nodes(getattr(node, field.name))
