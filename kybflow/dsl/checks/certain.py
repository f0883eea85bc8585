"""Conditions whose answer is known before the flight, and times that never come: KYB253, KYB254 and
KYB259."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kybflow.core.units import DURATION, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.document import Transition
from kybflow.dsl.expressions import Always, Compare, Condition, Eventually, Finally, parse
from kybflow.dsl.expressions.reasoning import always_holds, never_holds
from kybflow.dsl.expressions.tree import Aggregate
from kybflow.dsl.reading.source import Text


class Asked(NamedTuple):
    """A condition as written and as understood. `own` is the vehicle that asks, None for an
    expectation, a callback and a flow."""

    text: Text
    meant: Condition
    own: str | None


def never_true(case: Case) -> Iterator[Diagnostic]:
    """KYB253: a condition that can never hold: what it asks of one value leaves none, or the value
    is never there.

    No speed, distance, age or time is below zero, no share outside 0 % to 100 %, no tilt above 180
    degrees, no time beyond the mission's `time_limit`, and no vehicle is in two states at once. An
    arrow with such a condition never fires, an estimator with such a `healthy` is never used, and
    an expectation fails whatever is flown.
    """
    for text, meant, _ in case.once(everything_asked):
        if never_holds(meant, case.nature):
            message = f"`{text.as_written}` can never hold"
            hint = "mend the bound, or write `or` where both can't hold at once"
            yield Diagnostic("KYB253", message, text.span, label="never true", help=hint)


def always_true(case: Case) -> Iterator[Diagnostic]:
    """KYB254: a condition that holds whenever it can be asked, so that it says nothing.

    An arrow with it fires in the first tick of its state; an expectation with it can't fail.
    """
    for text, meant, _ in case.once(everything_asked):
        if always_holds(meant, case.nature):
            message = f"`{text.as_written}` always holds"
            hint = "mend the bound, or leave the condition away"
            yield Diagnostic(
                "KYB254",
                message,
                text.span,
                label="always true",
                help=hint,
                severity=Severity.WARNING,
            )


def after_the_end(case: Case) -> Iterator[Diagnostic]:
    """KYB259: an arrow that waits for longer than the run lasts, so that it never fires.

    A run ends after `time_limit`, 600 s unless the mission says otherwise. Often a unit is wrong:
    `min` for `ms`.
    """
    limit = case.document.time_limit
    for arrow in _arrows(case):
        waits = max(arrow.after or 0.0, arrow.hold)
        if waits < limit:
            continue
        yield Diagnostic(
            "KYB259",
            f"`{arrow.target.text}` is never reached by a wait of {_seconds(waits)}",
            arrow.span,
            label="the run is over before",
            notes=(f"its `time_limit` is {_seconds(limit)}",),
            help="wait for less, or write a longer `time_limit`",
        )


def _seconds(value: float) -> str:
    return format_quantity(value, DURATION)


def _arrows(case: Case) -> Iterator[Transition]:
    for _, state in case.states():
        yield from state.transitions
    for flow in case.document.flows.values():
        for phase in flow.phases.values():
            yield from phase.transitions


def everything_asked(case: Case) -> Iterator[Asked]:
    """Every condition, `healthy` and expectation that can be understood."""
    yield from case.once(conditions_of)
    yield from health_of(case)
    yield from case.once(expectations_of)


def conditions_of(case: Case) -> Iterator[Asked]:
    """Every condition of an arrow, a callback, a phase and a fault that can be understood."""
    document, scopes = case.document, case.scopes
    asked = [
        (arrow.when, vehicle.name.text)
        for vehicle, state in case.states()
        for arrow in state.transitions
    ]
    asked += [(f.when, f.vehicle.text) for f in document.faults]
    shared = [callback.when for callback in document.callbacks]
    for flow in document.flows.values():
        shared += [arrow.when for phase in flow.phases.values() for arrow in phase.transitions]
    for text, own in asked:
        meant = case.condition(text, scopes.condition(own))
        if text is not None and meant is not None:
            yield Asked(text, meant, own)
    for text in shared:
        meant = case.condition(text, scopes.flow())
        if text is not None and meant is not None:
            yield Asked(text, meant, None)


def health_of(case: Case) -> Iterator[Asked]:
    """Every `healthy` that can be understood."""
    for vehicle in case.vehicles():
        own = vehicle.name.text
        for text in (estimator.healthy for estimator in vehicle.estimators):
            meant = case.condition(text, case.scopes.health(own))
            if text is not None and meant is not None:
                yield Asked(text, meant, own)


def expectations_of(case: Case) -> Iterator[Asked]:
    """What every expectation asks, without its `always`, `eventually` or `finally`."""
    for text in case.document.expect:
        match parse(text, case.scopes.expectation())[0]:
            case Always(meant) | Eventually(meant) | Finally(meant):
                yield Asked(text, meant, None)
            case Compare(left=Aggregate()) as meant:
                yield Asked(text, meant, None)
