"""Conditions and expectations whose result is known before the flight: KYB253, KYB254, KYB410 to
KYB414, KYB423 to KYB425, KYB569 and KYB576."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from math import inf
from typing import NamedTuple

from kybflow.core.units import DURATION, LENGTH, Dimension, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.conditions import TypedCondition, all_conditions, named_states, nodes
from kybflow.dsl.checks.durations import disturbances, longest_time
from kybflow.dsl.checks.envelopes import reaches_of
from kybflow.dsl.checks.flows import phases
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity, Span, Text
from kybflow.dsl.expanding.flows import written
from kybflow.dsl.expressions import (
    tree,
)
from kybflow.dsl.expressions.reasoning import (
    Bounds,
    always_holds,
    never_holds,
    physical_bounds,
)
from kybflow.dsl.expressions.tree import Value, quantity, shown_value
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import StatePlan, TransitionPlan, VehiclePlan
from kybflow.parts import AIR

_OF_STATES = re.compile(r"\b(?:in|behavior|elapsed)\b")
"""Words of a condition whose result may depend on the state that evaluates it."""


_FAILING = frozenset({"failed", "within"})
"""The causes of transitions that follow a failure."""


class _Decided(NamedTuple):
    """A condition whose result is known before the flight. holds: whether it always or never holds.
    is_certain: whether this is true of every flight, and not only of normal ones."""

    typed: TypedCondition
    holds: bool
    is_certain: bool


def _decided(case: Case) -> Iterator[_Decided]:
    reaches = reaches_of(case)
    for typed in case.cached(all_conditions):
        usual, certain, _ = reaches(typed.own)
        for holds, is_known in ((False, never_holds), (True, always_holds)):
            if is_known(typed.condition, usual):
                yield _Decided(typed, holds, is_known(typed.condition, certain))
                break


class _Asked(NamedTuple):
    """The result of a condition in the state that evaluates it. holds: True if it always holds
    there, False if it never does, None if unknown. why: the explanation. hint: the help if it never
    holds."""

    text: Text
    holds: bool | None
    why: str = ""
    hint: str = ""


def _decided_in_states(case: Case) -> Iterator[_Asked]:
    """Yield the conditions whose result is known and equal in all states that evaluate them."""
    found: dict[Span, list[_Asked]] = {}
    told = {one.typed.text.span for one in case.cached(_decided)}
    for vehicle, state in case.states():
        for transition in state.transitions:
            text = transition.text_of("when")
            if text is not None and _OF_STATES.search(text.text):
                one = _asked_in(case, vehicle, state, transition, text)
                found.setdefault(text.span, []).append(one)
    for span, several in found.items():
        answers = {one.holds for one in several}
        if span not in told and len(answers) == 1 and None not in answers:
            yield several[0]


def _asked_in(
    case: Case, vehicle: VehiclePlan, state: StatePlan, transition: TransitionPlan, text: Text
) -> _Asked:
    own, where = vehicle.name, transition.since or state.name
    condition = case.condition(transition, "when", case.scopes.condition(own))
    longest = inf if transition.since else _longest(case, vehicle, state)
    if condition is None:
        return _Asked(text, None)
    here = _is_in(own, where)
    bounds = _within(own, longest, reaches_of(case)(own).usual)
    why = f"evaluated in `{where}`, and a vehicle is in one state at a time"
    hint = "test another vehicle's state or an event, or remove this transition"
    if longest < inf and "elapsed" in text.text:
        why = f"`{where}` has ended by then: it lasts at most {quantity(longest, DURATION)}"
        hint = "shorten the time, or let the behavior last longer"
    if never_holds(tree.And((condition, here)), bounds):
        return _Asked(text, False, why, hint)
    always = never_holds(tree.And((tree.Not(condition), here)), bounds)
    return _Asked(text, True if always else None, why)


def _longest(case: Case, vehicle: VehiclePlan, state: StatePlan) -> float:
    """Return the seconds after which a state has certainly ended; infinite if unknown, as when
    callbacks or requests with values may change how long it lasts."""
    if case.cached(disturbances) or (vehicle.requested and any(case.cached(_valued))):
        return inf
    return longest_time(vehicle, state)


def _is_in(vehicle: str, state: str) -> tree.Condition:
    """Return the condition that a vehicle is in a state."""
    behavior = tree.Compare("==", tree.Read(None, "behavior"), tree.Word(state))
    return tree.And((tree.InState(vehicle, state), behavior))


def _valued(case: Case) -> Iterator[bool]:
    """Yield for each phase whether it passes values to states."""
    return (any(map(written, phase.run.values())) for _, phase in phases(case.plan))


def _within(own: str, longest: float, usual: Bounds) -> Bounds:
    """Return the bounds of values in a normal flight, with `elapsed` limited to `longest`."""

    def bounds(value: object) -> tuple[float, float]:
        match value:
            case tree.Read(who, "elapsed") if who in (None, own):
                return 0.0, min(longest, usual(value)[1])
        return usual(value)

    return bounds


def never_true_there(case: Case) -> Iterator[Diagnostic]:
    """KYB423: the `when` of a transition can't hold in the state that it leaves: it requires its
    vehicle to be in another state, or to be in this one for longer than the state lasts."""
    for asked in case.cached(_decided_in_states):
        if asked.holds is False:
            yield Diagnostic(
                "KYB423",
                f"`{asked.text.as_written}` never holds here",
                asked.text.span,
                label="this transition is never taken",
                notes=(asked.why,),
                help=asked.hint,
            )


def never_injected(case: Case) -> Iterator[Diagnostic]:
    """KYB576: the `when` of a fault can't hold in any state of its vehicle: it requires the vehicle
    to be in a state for longer than that lasts."""
    told = {one.typed.text.span for one in case.cached(_decided)}
    for fault in case.plan.faults:
        text, vehicle = fault.text_of("when"), case.plan.fleet.get(fault.vehicle)
        if text is None or vehicle is None or text.span in told or "elapsed" not in text.text:
            continue
        condition = case.condition(fault, "when", case.scopes.condition(fault.vehicle))
        if condition is None:
            continue
        usual = reaches_of(case)(fault.vehicle).usual
        longest = dict.fromkeys(BUILT_IN, inf)
        longest |= {name: _longest(case, vehicle, s) for name, s in vehicle.states.items()}
        if all(
            never_holds(
                tree.And((condition, _is_in(vehicle.name, state))),
                _within(vehicle.name, seconds, usual),
            )
            for state, seconds in longest.items()
        ):
            yield Diagnostic(
                "KYB576",
                f"`{text.as_written}` holds in no state of `{vehicle.name}`",
                text.span,
                label="the fault is never injected",
                notes=("each state has ended by then",),
                help="shorten the time, or let the behavior last longer",
            )


def of_failures_only(case: Case) -> Iterator[Diagnostic]:
    """KYB569: an expectation is about a state to which only failures lead, in a mission without
    faults, so that it says nothing of a normal flight (a warning)."""
    if case.plan.faults:
        return
    for text, expression in case.expected():
        match expression:
            case tree.Compare(left=tree.Aggregate(_, _, str(name), str(state))):
                vehicle = case.plan.fleet[name]
                if state not in vehicle.states or state in _in_order(vehicle):
                    continue
                if vehicle.requested or case.cached(disturbances):
                    continue
                yield Diagnostic(
                    "KYB569",
                    f"`{name}` is in `{state}` only after a failure",
                    text.span,
                    label="says nothing of a normal flight",
                    help="name another state, or add a fault that leads there",
                    severity=Severity.WARNING,
                    related=(Related(vehicle.states[state].behavior.span, f"`{state}`"),),
                )


def _in_order(vehicle: VehiclePlan) -> frozenset[str]:
    """Return the states to which more than failures lead, and those that nothing leads to."""
    if "in order" not in vehicle.known:
        every = [(t.target, t.cause) for s in vehicle.states.values() for t in s.transitions]
        usual = {target for target, cause in every if cause not in _FAILING}
        failing = {target for target, _ in every} - usual - {vehicle.begin}
        vehicle.known["in order"] = frozenset(vehicle.states.keys() - failing)
    found: frozenset[str] = vehicle.known["in order"]
    return found


def always_true_there(case: Case) -> Iterator[Diagnostic]:
    """KYB424: the `when` of a transition always holds in the state that it leaves, so the vehicle
    leaves the state in its first tick (a warning)."""
    for asked in case.cached(_decided_in_states):
        if asked.holds:
            yield Diagnostic(
                "KYB424",
                f"`{asked.text.as_written}` always holds here",
                asked.text.span,
                label="the state is left at once",
                notes=(asked.why,),
                help="test something that changes in this state, such as `elapsed > 3 s`",
                severity=Severity.WARNING,
            )


def never_true(case: Case) -> Iterator[Diagnostic]:
    """KYB253: a condition can never hold: its bounds on a value contradict each other, or the value
    can't get there.

    Speeds, distances, ages and times are never below zero, shares stay between 0 % and 100 %, tilt
    is at most 180 degrees, time is at most the mission's `time_limit`, and a vehicle is in one
    state at a time. A vehicle gets no further outside the fence than the fence is long, no faster
    than three times its airframe's speed plus a fall from there, and it begins at its start. A
    transition with such a condition is never taken, an estimator with such a `healthy` is never
    used, and such an expectation always fails.
    """
    for found in case.cached(_decided):
        if not found.holds and found.is_certain:
            hint = "correct the bound"
            match found.typed.condition:
                case tree.And():
                    hint += ", or write `or` where both can't hold at once"
                case tree.Compare(_, tree.Aggregate("min" | "max", inner, _, None)):
                    shown = shown_value(inner)
                    hint += f", or check one state, such as `min({shown} in hold)`"
                case _ if found.typed.key == "healthy":
                    hint = "write a bound that it can reach, such as `age < 250 ms`"
            label = _NEVER[found.typed.key]
            yield _told(case, found, "KYB253", "can never hold", label, hint)


_NEVER = {
    "when": "never triggers",
    "healthy": "the estimator is never used",
    "expect": "always fails",
}
"""What follows from a condition that never holds, by the key under which it is written."""
_ALWAYS = {"when": "triggers at once", "healthy": "is always healthy", "expect": "can't fail"}


def always_true(case: Case) -> Iterator[Diagnostic]:
    """KYB254: a condition always holds, so it has no effect.

    A transition with it is taken in the first tick of its state (a warning). An expectation with it
    can't fail, which is an error, unless it is a statistic of a state that may never be entered.
    """
    for found in case.cached(_decided):
        if found.holds and found.is_certain:
            hint = "correct the bound, or remove the condition"
            label = _ALWAYS[found.typed.key]
            told = _told(case, found, "KYB254", "always holds", label, hint)
            asked = nodes(found.typed.condition)
            of_a_state = any(isinstance(node, tree.Aggregate) and node.state for node in asked)
            is_empty = found.typed.key == "expect" and not of_a_state
            yield told if is_empty else replace(told, severity=Severity.WARNING)


def not_in_order(case: Case) -> Iterator[Diagnostic]:
    """KYB410: a condition can't hold in a normal flight (a warning).

    It requires a position outside the fence by more than a fifth of its size, three times the
    airframe's speed, an estimate that is 10 s old, or a spread below 0.1 mm.
    """
    for found in case.cached(_decided):
        if not found.holds and not found.is_certain:
            hint = "choose a bound within reach, or remove the condition"
            told = _told(case, found, "KYB410", "holds in no normal flight", "out of reach", hint)
            yield replace(told, severity=Severity.WARNING)


def generous(case: Case) -> Iterator[Diagnostic]:
    """KYB411: a condition holds throughout every normal flight, so it checks almost nothing (a
    warning).

    The bounds are those of KYB410; for example, a position error below 10 m where the fence is 6 m
    wide.
    """
    for found in case.cached(_decided):
        if found.holds and not found.is_certain:
            hint = "choose a tighter bound, or remove the condition"
            what, label = "holds in every normal flight", "checks almost nothing"
            told = _told(case, found, "KYB411", what, label, hint)
            yield replace(told, severity=Severity.WARNING)


def _told(case: Case, found: _Decided, code: str, what: str, label: str, hint: str) -> Diagnostic:
    text = found.typed.text
    message, notes = f"`{text.as_written}` {what}", tuple(_limits(case, found))
    return Diagnostic(code, message, text.span, label, notes, hint)


def _limits(case: Case, found: _Decided) -> Iterator[str]:
    """Yield notes with the range of each value that decides a condition, and with what limits
    it."""
    usual, certain, _ = reaches_of(case)(found.typed.own)
    bounds, nature = (certain if found.is_certain else usual), physical_bounds(inf)
    is_known = always_holds if found.holds else never_holds
    for node in nodes(found.typed.condition):
        match node:
            case tree.Compare(
                operator,
                (
                    tree.Read()
                    | tree.Distance()
                    | tree.Separation()
                    | tree.Clearance()
                    | tree.Aggregate()
                ) as value,
                tree.Quantity(_, unit),
            ) if is_known(node, bounds):
                is_high = (operator in (">", ">=")) is not found.holds
                if is_known(node, nature):
                    limit = quantity(nature(value)[is_high], unit)
                    side = "above" if is_high else "below"
                    yield f"`{shown_value(value)}` is never {side} {limit}"
                    continue
                low, high = (quantity(bound, unit) for bound in usual(value))
                why = _limited_by(value, unit, is_high, usual)
                is_open = usual(value)[0] == -inf
                stays = f"is never above {high}" if is_open else f"stays between {low} and {high}"
                yield f"`{shown_value(value)}` {stays}, because {why}"


def _limited_by(
    value: Value | tree.Aggregate, dimension: Dimension, is_high: bool, usual: Bounds
) -> str:
    """Return what limits a value to the bounds `usual`, to be read after `because`. is_high:
    whether the upper limit is meant."""
    if isinstance(value, tree.Aggregate):
        if usual(value)[is_high] != usual(value.value)[is_high] and value.function != "rms":
            return "every vehicle begins at its start"
        value = value.value
    match value:
        case tree.Read(_, "estimate.age"):
            return "no vehicle flies on an older estimate"
        case tree.Read(_, "estimate.spread") if not is_high:
            return "no estimate is more certain"
    if dimension is DURATION:
        return "the run ends at its `time_limit`"
    return "of the fence" if dimension is LENGTH else "of the airframe"


_AT_FIRST = {
    True: "the vehicles are still at their starts",
    False: "the vehicles are still in their first states",
}


def false_at_first(case: Case) -> Iterator[Diagnostic]:
    """KYB412: an `always` is false in the first tick, when the vehicles are at their starts and in
    their first states, so it fails in every flight."""
    for text, expression in case.expected():
        if not isinstance(expression, tree.Always):
            continue
        usual, _, at_first = reaches_of(case)(None)
        condition = expression.condition
        if never_holds(_begun(case, text, condition), at_first) and not never_holds(
            condition, usual
        ):
            yield Diagnostic(
                "KYB412",
                f"`{text.as_written}` is false from the start",
                text.span,
                label=_AT_FIRST[never_holds(condition, at_first)],
                help="check one state: `min(a.state.altitude in hold) > 1 m`",
            )


def true_at_first(case: Case) -> Iterator[Diagnostic]:
    """KYB413: an `eventually` is true in the first tick, when the vehicles are at their starts and
    in their first states, so it checks nothing of the flight (a warning)."""
    for text, expression in case.expected():
        if not isinstance(expression, tree.Eventually):
            continue
        usual, _, at_first = reaches_of(case)(None)
        condition = expression.condition
        begun = _begun(case, text, tree.Not(condition))
        if never_holds(begun, at_first) and not always_holds(condition, usual):
            yield Diagnostic(
                "KYB413",
                f"`{text.as_written}` is true from the start",
                text.span,
                label=_AT_FIRST[always_holds(condition, at_first)],
                help="write `finally` to check the end of the run",
                severity=Severity.WARNING,
            )


def _begun(case: Case, text: Text, condition: tree.Condition) -> tree.Condition:
    """Return a condition with the states in which its vehicles begin."""
    if not _OF_STATES.search(text.text):
        return condition
    named = sorted({vehicle for vehicle, _ in named_states(condition, None)})
    return tree.And((condition, *(_is_in(name, case.plan.fleet[name].begin) for name in named)))


def ends_in_the_air(case: Case) -> Iterator[Diagnostic]:
    """KYB425: a `finally` has the same result in every flight, because a run ends only when all
    vehicles are on the ground: none is then in a state that it flies in the air."""
    for text, expression in case.expected():
        if isinstance(expression, tree.Finally):
            condition = expression.condition
            aloft = tuple(
                tree.Not(tree.InState(vehicle, state))
                for vehicle, state in named_states(condition, None)
                if (legs := case.legs(case.plan.fleet[vehicle], state))
                and all(leg.end is AIR for leg in legs)
            )
            is_false = bool(aloft) and never_holds(tree.And((condition, *aloft)), _unknown)
            is_true = bool(aloft) and never_holds(tree.And((tree.Not(condition), *aloft)), _unknown)
            if is_false or is_true:
                yield Diagnostic(
                    "KYB425",
                    f"`{text.as_written}` {'fails' if is_false else 'holds'} in every flight",
                    text.span,
                    label="a run ends on the ground",
                    help="test `landed`, or a state during the flight: `eventually a in hold`",
                )


def _unknown(_: object) -> tuple[float, float]:
    return -inf, inf


def longer_than_the_run(case: Case) -> Iterator[Diagnostic]:
    """KYB414: an expectation allows more time than the run has, so its `within` has no effect (a
    warning)."""
    limit = case.plan.time_limit
    for text, expression in case.expected():
        match expression:
            case tree.Eventually(_, within) | tree.Finished(within) if (
                within is not None and within > limit
            ):
                yield Diagnostic(
                    "KYB414",
                    f"`{text.as_written}` allows more time than the run has",
                    text.span,
                    label="the run ends before that",
                    notes=(f"its `time_limit` is {format_quantity(limit, DURATION)}",),
                    help="allow less, or write a longer `time_limit`",
                    severity=Severity.WARNING,
                )
