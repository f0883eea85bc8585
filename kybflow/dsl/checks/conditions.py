"""Conditions, health and expectations, read and typed: KYB210 to KYB214
(`kybflow.dsl.expressions.errors`)."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.expressions import parse


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
