"""Estimators that are never used, or not for long: KYB255, KYB256 and KYB305."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Diagnostic, Severity
from kybflow.dsl.document import EstimatorUse
from kybflow.parts import Estimator
from kybflow.signals import MeasurementKind


def never_used(case: Case) -> Iterator[Diagnostic]:
    """KYB255: an estimator stands behind one that never gives way.

    The first healthy one is used, from the top. One without `healthy` is healthy as long as it
    has an estimate, however old that is; without `for_at_most` it is then used for ever.
    """
    for vehicle in case.vehicles():
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


def _reckons(use: EstimatorUse) -> bool:
    """Whether it is told of the estimate in use, and measures nothing but its own motion."""
    cls = use.part.spec.cls
    return cls.anchor is not Estimator.anchor and cls.needs <= {MeasurementKind.IMU}


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
