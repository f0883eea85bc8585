"""Estimators that are never used, not for long, or not there: KYB255, KYB256, KYB305, KYB361,
KYB362, KYB419 and KYB439."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from kybflow.core.signals import Frame, Imu, Pose
from kybflow.core.text import did_you_mean
from kybflow.core.units import DURATION
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.space import the_cameras
from kybflow.dsl.diagnostics.diagnostic import Diagnostic, Severity
from kybflow.dsl.expressions.describe import quantity
from kybflow.dsl.expressions.reasoning import Bounds, never_holds
from kybflow.dsl.expressions.tree import Read
from kybflow.dsl.plan import EstimatorPlan, VehiclePlan
from kybflow.parts import Estimator


def never_used(case: Case) -> Iterator[Diagnostic]:
    """KYB255: an estimator stands behind one that never gives way.

    The first healthy one is used, from the top. One without `healthy` is healthy as long as it
    has an estimate, however old that is; without `for_at_most` it is then used for ever. A behavior
    may bring others to the front; of a vehicle that has one, nothing is said.
    """
    for vehicle in case.plan.vehicles:
        if any(state.estimators for state in vehicle.states.values()):
            continue
        for index, first in enumerate(vehicle.estimators[:-1]):
            if first.healthy is not None or first.for_at_most is not None:
                continue
            later = vehicle.estimators[index + 1].part
            yield Diagnostic(
                "KYB255",
                f"`{later.alias}` is hardly ever used: `{first.part.alias}` comes first",
                later.span,
                label=f"`{first.part.alias}` counts as healthy with any estimate",
                help=f"give `{first.part.alias}` a `healthy`, such as `age < 250 ms`",
                severity=Severity.WARNING,
            )
            break


def older_than_healthy(case: Case) -> Iterator[Diagnostic]:
    """KYB419: an estimator's `healthy` allows less age than its estimate has before the next
    measurement comes, so that it is healthy now and then, or never (a warning, and an error).

    That age is the period of what it measures with and the time that a measurement takes to arrive:
    those of motion capture as the driver declares them, or the period of its slowest camera.
    """
    for vehicle in case.plan.vehicles:
        for use in vehicle.estimators:
            condition = case.condition(use, "healthy", case.scopes.health(vehicle.name))
            healthy, ages = use.text_of("healthy"), _ages(vehicle, use)
            if condition is None or healthy is None or ages is None:
                continue
            least, most = ages
            if not never_holds(condition, _aged(most, most)) or never_holds(
                condition, _aged(0.0, inf)
            ):
                continue
            is_never = never_holds(condition, _aged(least, most))
            often = "never" if is_never else "only now and then"
            yield Diagnostic(
                "KYB419",
                f"`{use.part.alias}` is {often} healthy with `{healthy.as_written}`",
                healthy.span,
                label=f"its estimate is {quantity(most, DURATION)} old before the next measurement",
                help=f"allow for some that are missing: `age < {_allowed(most)}`",
                severity=Severity.ERROR if is_never else Severity.WARNING,
                related=the_cameras(vehicle),
            )


def _allowed(most: float) -> str:
    return quantity(max(_USUAL, 3.0 * most), DURATION)


def _ages(vehicle: VehiclePlan, use: EstimatorPlan) -> tuple[float, float] | None:
    """The least and the largest age of its estimates in a flight that is in order, s."""
    driver, needs = vehicle.driver, use.part.cls.uses(use.part.params)
    if Frame in needs and vehicle.body.cameras:
        return 0.0, 1.0 / min(camera.rate for camera in vehicle.body.cameras)
    inner = driver.cls.inner_loop(driver.params, vehicle.airframe)
    if Pose in needs and Pose in driver.cls.provides and inner is not None:
        return inner.pose_latency, inner.pose_latency + inner.pose_period
    return None


_AGE, _USUAL = "estimate.age", 0.25


def _aged(low: float, high: float) -> Bounds:
    """The bounds of an estimate whose age is in this range."""

    def bounds(value: object) -> tuple[float, float]:
        return (low, high) if isinstance(value, Read) and value.name == _AGE else (-inf, inf)

    return bounds


def unknown_first(case: Case) -> Iterator[Diagnostic]:
    """KYB361: a behavior names an estimator to come first that its vehicle does not have."""
    for vehicle, state in case.states():
        known = [use.part.alias for use in vehicle.estimators]
        for name in state.texts_of("estimators"):
            if name.text not in known:
                message = f"`{vehicle.name}` has no estimator `{name.text}`"
                hint = did_you_mean(name.text, known) or "name it under `estimators` of the vehicle"
                yield Diagnostic("KYB361", message, name.span, help=hint)


def first_twice(case: Case) -> Iterator[Diagnostic]:
    """KYB362: a behavior names an estimator twice among those that come first."""
    for _, state in case.states():
        for index, name in enumerate(state.texts_of("estimators")):
            if name.text in state.estimators[:index]:
                message = f"`{name.text}` is in this list already"
                hint = "leave it away here"
                yield Diagnostic("KYB362", message, name.span, help=hint, severity=Severity.WARNING)


def never_begins(case: Case) -> Iterator[Diagnostic]:
    """KYB305: every estimator of a vehicle is dead reckoning, which goes on from the estimate of
    another: none of them ever has a first one, and the vehicle never takes off."""
    for vehicle in case.plan.vehicles:
        if vehicle.estimators and all(reckons(use) for use in vehicle.estimators):
            part = vehicle.estimators[0].part
            yield Diagnostic(
                "KYB305",
                f"`{vehicle.name}` never has an estimate",
                part.span,
                label=f"`{part.alias}` goes on from the estimate of another",
                help="name one that sees where the vehicle is, such as `mocap`, before it",
            )


def reckons(use: EstimatorPlan) -> bool:
    """Whether it is told of the estimate in use, and measures nothing but its own motion."""
    cls, params = use.part.cls, use.part.params
    return cls.anchor is not Estimator.anchor and cls.uses(params) <= {Imu}


def alone_for_a_time(case: Case) -> Iterator[Diagnostic]:
    """KYB256: the only estimator of a vehicle may be used for a time only, then the vehicle has
    none and goes down blind."""
    for vehicle in case.plan.vehicles:
        if len(vehicle.estimators) == 1 and vehicle.estimators[0].for_at_most is not None:
            part = vehicle.estimators[0].part
            yield Diagnostic(
                "KYB256",
                f"`{vehicle.name}` flies blind after the time of `{part.alias}`",
                part.span,
                label="its only estimator",
                help="leave `for_at_most` away, or put an estimator before it",
                severity=Severity.WARNING,
            )


def never_again(case: Case) -> Iterator[Diagnostic]:
    """KYB439: an estimator that was lost once is never used again: its `recover_after` is longer
    than the run (a warning)."""
    limit = case.plan.time_limit
    for vehicle in case.plan.vehicles:
        for use in vehicle.estimators if len(vehicle.estimators) > 1 else ():
            if use.recover_after >= limit:
                yield Diagnostic(
                    "KYB439",
                    f"`{use.part.alias}` of `{vehicle.name}` never recovers",
                    use.part.span,
                    label=f"must be healthy for {quantity(use.recover_after, DURATION)} first",
                    notes=(f"the mission's `time_limit` is {quantity(limit, DURATION)}",),
                    help="write a shorter `recover_after`, such as `1 s`",
                    severity=Severity.WARNING,
                )
