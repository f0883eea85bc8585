"""Estimators that are never used, not for long, or not there: KYB255, KYB256, KYB305, KYB361 and
KYB362."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.signals import Imu
from kybflow.core.text import did_you_mean
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.document import EstimatorEntry
from kybflow.parts import Estimator


def never_used(case: Case) -> Iterator[Diagnostic]:
    """KYB255: an estimator stands behind one that never gives way.

    The first healthy one is used, from the top. One without `healthy` is healthy as long as it
    has an estimate, however old that is; without `for_at_most` it is then used for ever. A behavior
    may bring others to the front; of a vehicle that has one, nothing is said.
    """
    for vehicle in case.vehicles():
        if any(state.estimators for state in vehicle.states.values()):
            continue
        for index, first in enumerate(vehicle.estimators[:-1]):
            if first.healthy is not None or first.for_at_most is not None:
                continue
            later = vehicle.estimators[index + 1].part
            yield Diagnostic(
                "KYB255",
                f"`{later.label}` is hardly ever used: `{first.part.label}` comes first",
                later.span,
                label=f"`{first.part.label}` counts as healthy with any estimate",
                help=f"give `{first.part.label}` a `healthy`, such as `age < 250 ms`",
                severity=Severity.WARNING,
            )
            break


def unknown_first(case: Case) -> Iterator[Diagnostic]:
    """KYB361: a behavior names an estimator to come first that its vehicle does not have."""
    for vehicle, state in case.states():
        known = [use.part.label for use in vehicle.estimators]
        for name in state.estimators:
            if name.text not in known:
                message = f"`{vehicle.name.text}` has no estimator `{name.text}`"
                hint = did_you_mean(name.text, known) or "name it under `estimators` of the vehicle"
                yield Diagnostic("KYB361", message, name.span, help=hint)


def first_twice(case: Case) -> Iterator[Diagnostic]:
    """KYB362: a behavior names an estimator twice among those that come first."""
    for _, state in case.states():
        for index, name in enumerate(state.estimators):
            if name.text in (other.text for other in state.estimators[:index]):
                message = f"`{name.text}` is in this list already"
                hint = "leave it away here"
                yield Diagnostic("KYB362", message, name.span, help=hint, severity=Severity.WARNING)


def never_begins(case: Case) -> Iterator[Diagnostic]:
    """KYB305: every estimator of a vehicle is dead reckoning, which goes on from the estimate of
    another: none of them ever has a first one, and the vehicle never takes off."""
    for vehicle in case.vehicles():
        if vehicle.estimators and all(_reckons(use) for use in vehicle.estimators):
            part = vehicle.estimators[0].part
            yield Diagnostic(
                "KYB305",
                f"`{vehicle.name.text}` never has an estimate",
                part.span,
                label=f"`{part.label}` goes on from the estimate of another",
                help="name one that sees where the vehicle is, such as `mocap`, before it",
            )


def _reckons(use: EstimatorEntry) -> bool:
    """Whether it is told of the estimate in use, and measures nothing but its own motion."""
    cls, params = use.part.spec.cls, use.part.params
    return cls.anchor is not Estimator.anchor and cls.uses(params) <= {Imu}


def alone_for_a_time(case: Case) -> Iterator[Diagnostic]:
    """KYB256: the only estimator of a vehicle may be used for a time only, then the vehicle has
    none and goes down blind."""
    for vehicle in case.vehicles():
        if len(vehicle.estimators) == 1 and vehicle.estimators[0].for_at_most is not None:
            part = vehicle.estimators[0].part
            yield Diagnostic(
                "KYB256",
                f"`{vehicle.name.text}` flies blind after the time of `{part.label}`",
                part.span,
                label="its only estimator",
                help="leave `for_at_most` away, or put an estimator before it",
                severity=Severity.WARNING,
            )
