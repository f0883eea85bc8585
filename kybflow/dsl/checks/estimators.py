"""Estimators that are missing, never used or not available for long: KYB255, KYB256, KYB305,
KYB361, KYB362, KYB419, KYB439, KYB566, KYB567 and KYB590 to KYB592."""

from __future__ import annotations

from collections.abc import Iterator
from math import floor, inf
from typing import NamedTuple

from kybflow.core.signals import Frame, Imu, Pose, Position
from kybflow.core.text import did_you_mean
from kybflow.core.units import DURATION, LENGTH
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.space import (
    footprints,
    shown_point,
    the_cameras,
    the_loop,
    the_measurements,
    the_part,
)
from kybflow.dsl.diagnostics import Diagnostic, Severity, Text
from kybflow.dsl.expressions.reasoning import Bounds, never_holds
from kybflow.dsl.expressions.tree import And, Compare, Condition, Quantity, Read, quantity
from kybflow.dsl.plan import EstimatorPlan, PartPlan, VehiclePlan
from kybflow.parts import Estimator
from kybflow.world.shapes import Box


def never_used(case: Case) -> Iterator[Diagnostic]:
    """KYB255: an estimator comes after one that is always used instead.

    The first healthy estimator of the list is used. An estimator without `healthy` is healthy as
    soon as it has an estimate, however old; without `for_at_most` it then stays in use. Vehicles
    with a behavior that reorders the estimators are not checked.
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
                f"`{later.alias}` is almost never used: `{first.part.alias}` comes first",
                later.span,
                label=f"any estimate of `{first.part.alias}` counts as healthy",
                help=f"give `{first.part.alias}` a `healthy`, such as `age < 250 ms`",
                severity=Severity.WARNING,
            )
            break


class LatePoses(NamedTuple):
    """A latency of a vehicle's driver that the mission sets so high that an estimator is never
    healthy. parameter: its name. allowed: the highest latency with which it is healthy, s."""

    vehicle: VehiclePlan
    use: EstimatorPlan
    healthy: Text
    parameter: str
    allowed: float


def late_poses(case: Case) -> Iterator[LatePoses]:
    """Yield each latency that makes an estimator useless."""
    for vehicle in case.plan.vehicles:
        driver = vehicle.driver
        if len(entries := driver.source.node.entries) < 2:  # nothing but its name
            continue
        written = [f for f in driver.fields if f.name in entries]
        inner = driver.cls.inner_loop(driver.params, vehicle.airframe) if written else None
        latency = 0.0 if inner is None else inner.pose_latency
        times = (f.name for f in written if latency > 0.0 and f.dimension is DURATION)
        name = next((n for n in times if getattr(driver.params, n) == latency), None)
        for use in vehicle.estimators if name is not None else ():
            condition = case.condition(use, "healthy", case.scopes.health(vehicle.name))
            healthy, ages = use.text_of("healthy"), _ages(vehicle, use)
            if name is None or condition is None or healthy is None or ages is None:
                continue
            period = ages[1] - ages[0]
            allowed, refused = 0.0, latency
            if ages[0] != latency or not never_holds(condition, _aged(*ages)):
                continue
            if never_holds(condition, _aged(0.0, period)):
                continue
            for _ in range(_HALVINGS):
                middle = 0.5 * (allowed + refused)
                if never_holds(condition, _aged(middle, middle + period)):
                    refused = middle
                else:
                    allowed = middle
            yield LatePoses(vehicle, use, healthy, name, allowed)
            break


_HALVINGS = 20
_ROUNDING = 1e-9
_MIN_SPREAD = 1e-4
"""A bound (m) below this, which no estimate meets, is reported as KYB410 or KYB416."""


def latency_allowed(case: Case, vehicle: VehiclePlan) -> float | None:
    """Return the latency with which to judge what else depends on a vehicle's latency, because the
    mission's own is reported already; None if it is not."""
    for late in case.cached(late_poses):
        if late.vehicle is vehicle:
            return late.allowed
    return None


def older_than_healthy(case: Case) -> Iterator[Diagnostic]:
    """KYB419: an estimator's `healthy` allows a smaller age than its estimate reaches between two
    measurements, so it is healthy only intermittently (a warning) or never (an error), or a smaller
    spread than its measurements have. If a latency that the mission sets is the reason, that is
    reported.

    That age is the measurement period plus the latency: for motion capture and positions as the
    driver declares them, for cameras the period of the slowest one. One measurement may be lost
    (a warning), which makes the estimate older by another period.
    """
    for late in case.cached(late_poses):
        driver, shown = late.vehicle.driver, floor(late.allowed * 1e3) / 1e3
        yield Diagnostic(
            "KYB419",
            f"with this `{late.parameter}`, `{late.use.part.alias}` is never healthy",
            driver.span_of(late.parameter),
            label="every pose is that old, or older",
            notes=(f"its `healthy` is `{late.healthy.as_written}`",),
            help=f"write at most `{late.parameter}: {quantity(shown, DURATION)}`",
        )
    for vehicle, use, (least, most), spread in case.cached(_measured):
        condition = case.condition(use, "healthy", case.scopes.health(vehicle.name))
        healthy, lost = use.text_of("healthy"), 2.0 * most - least
        if condition is None or healthy is None or latency_allowed(case, vehicle) is not None:
            continue
        if _MIN_SPREAD <= _allowed(condition, "estimate.spread") < spread:
            yield Diagnostic(
                "KYB419",
                f"`{use.part.alias}` is never healthy with `{healthy.as_written}`",
                healthy.span,
                label=f"the spread of its estimate is {_shown(spread)}",
                help=f"allow more: `spread < {_shown(1.5 * spread)}`",
                related=the_measurements(vehicle),
            )
        if not never_holds(condition, _aged(lost, lost)) or never_holds(condition, _aged(0.0, inf)):
            continue
        is_never = never_holds(condition, _aged(least, most))
        allowed = quantity(max(_USUAL, 3.0 * most), DURATION)
        often, old, when = "never" if is_never else "only intermittently", most, "before the next"
        if not never_holds(condition, _aged(most, most)):
            often, old, when = "not always", lost, "after one lost"
        yield Diagnostic(
            "KYB419",
            f"`{use.part.alias}` is {often} healthy with `{healthy.as_written}`",
            healthy.span,
            label=f"its estimate is {quantity(old, DURATION)} old {when} measurement",
            help=f"allow for missing measurements: `age < {allowed}`",
            severity=Severity.ERROR if is_never else Severity.WARNING,
            related=(*the_cameras(vehicle), *the_loop(vehicle)),
        )


class _Measured(NamedTuple):
    """An estimator, the least and largest age of its estimates in a normal flight, s, and their
    least spread, m."""

    vehicle: VehiclePlan
    use: EstimatorPlan
    ages: tuple[float, float]
    spread: float


def _measured(case: Case) -> Iterator[_Measured]:
    """Yield each estimator for which the ages of its estimates are known."""
    for vehicle in case.plan.vehicles:
        driver = vehicle.driver
        for use in vehicle.estimators:
            ages, error = _ages(vehicle, use), 0.0
            if ages is None:
                continue
            part = use.part
            needs = part.cls.uses(part.params)
            if Pose in needs:
                error = driver.cls.pose_error(driver.params)
            elif Position in needs and (positions := driver.cls.positions(driver.params)):
                error = positions.error
            yield _Measured(vehicle, use, ages, part.cls.least_spread(part.params, error))


def _ages(vehicle: VehiclePlan, use: EstimatorPlan) -> tuple[float, float] | None:
    """Return the least and largest age of an estimator's estimates in a normal flight, s; None if
    unknown."""
    driver, needs = vehicle.driver, use.part.cls.uses(use.part.params)
    if Frame in needs and vehicle.body.cameras:
        return 0.0, 1.0 / min(camera.rate for camera in vehicle.body.cameras)
    inner = driver.cls.inner_loop(driver.params, vehicle.airframe)
    if Pose in needs and Pose in driver.cls.provides and inner is not None:
        return inner.pose_latency, inner.pose_latency + inner.pose_period
    positions = driver.cls.positions(driver.params) if Position in needs else None
    if positions is not None:
        return positions.latency, positions.latency + positions.period
    return None


def _watched(vehicle: VehiclePlan) -> Iterator[tuple[PartPlan, float, float]]:
    """Yield each supervisor that ends the flight when the estimate is lost: from which age (s) and
    spread (m) on."""
    for part in vehicle.supervisors:
        ends = part.cls.ends_outside(part.params)
        if _AGE in ends:
            yield part, ends[_AGE][1], ends["estimate.spread"][1]


def falls_back_too_late(case: Case) -> Iterator[Diagnostic]:
    """KYB590: an estimator counts as healthy for so long, or with such a spread, that a supervisor
    ends the flight before the next estimator takes over (a warning)."""
    for vehicle in case.plan.vehicles:
        for use in vehicle.estimators[:-1]:
            condition = case.condition(use, "healthy", case.scopes.health(vehicle.name))
            healthy = use.text_of("healthy")
            if condition is None or healthy is None:
                continue
            age, spread = _allowed(condition, _AGE), _allowed(condition, "estimate.spread")
            for part, oldest, widest in _watched(vehicle):
                bounds = [("age", oldest, DURATION)] if age > oldest + _ROUNDING else []
                if widest + _ROUNDING < spread < inf:
                    bounds.append(("spread", widest, LENGTH))
                for what, bound, dimension in bounds[:1]:
                    shown = quantity(bound, dimension)
                    yield Diagnostic(
                        "KYB590",
                        f"nothing takes over from `{use.part.alias}` before `{part.alias}` acts",
                        healthy.span,
                        label=f"`{part.alias}` ends the flight once the {what} is above {shown}",
                        help=f"write a smaller bound here, such as `{what} < {shown}`, or a larger"
                        f" `{what}` for `{part.alias}`",
                        severity=Severity.WARNING,
                    )


def _shown(spread: float) -> str:
    return quantity(float(f"{spread:.2g}"), LENGTH)


def _allowed(condition: Condition, name: str) -> float:
    """Return the largest value that a `healthy` allows; infinite if it has no such bound."""
    parts = condition.parts if isinstance(condition, And) else (condition,)
    bounds = [inf]
    for part in parts:
        match part:
            case Compare("<" | "<=", Read(_, other), Quantity(bound)) if other == name:
                bounds.append(bound)
    return min(bounds)


def lost_in_order(case: Case) -> Iterator[Diagnostic]:
    """KYB591: a supervisor ends the flight although all sensors work: its bound for the estimate is
    below the age or the spread that the measurements of the only estimator reach (an error), or
    reach when one of them is lost (a warning)."""
    for vehicle, use, (least, most), spread in case.cached(_measured):
        others = [other for other in vehicle.estimators if other is not use]
        if not all(map(reckons, others)):
            continue
        part, lost = use.part, 2.0 * most - least
        for watching, oldest, widest in _watched(vehicle):
            is_bridged = oldest >= most and bool(others)
            is_sharp = _MIN_SPREAD <= widest < spread
            if not is_sharp and (oldest >= lost - _ROUNDING or oldest <= least or is_bridged):
                continue  # a bound that no estimate meets is reported as KYB416
            name, value = "age", quantity(most, DURATION)
            if is_sharp:
                name, value = "spread", _shown(spread)
            elif oldest >= most:
                value = f"{quantity(lost, DURATION)} after one lost measurement"
            causes = (*the_measurements(vehicle), *the_part(vehicle, watching))
            own = [cause.span for cause in causes if cause.span.file == vehicle.span.file]
            span = part.span if part.span.file == vehicle.span.file else [*own, part.span][0]
            yield Diagnostic(
                "KYB591",
                f"`{watching.alias}` ends the flight of `{vehicle.name}` although all sensors work",
                span,
                label=f"the {name} of `{part.alias}` reaches {value}",
                help=f"write a larger `{name}` for `{watching.alias}`, or measure better",
                severity=Severity.WARNING if value.endswith("measurement") else Severity.ERROR,
                related=tuple(cause for cause in causes if cause.span != span),
            )


def too_coarse_for_the_room(case: Case) -> Iterator[Diagnostic]:
    """KYB592: a vehicle that flies by positions comes closer to a side of the fence or an obstacle
    than twice their standard deviation (a warning)."""
    fence, touchable = case.plan.fence, case.plan.touchable
    for vehicle in case.plan.vehicles:
        use = vehicle.estimators[0] if vehicle.estimators else None
        if use is None or Position not in use.part.cls.uses(use.part.params):
            continue
        positions = vehicle.driver.cls.positions(vehicle.driver.params)
        solids = [shape for name, shape in case.plan.obstacles.items() if name not in touchable]
        for owner, state, _, footprint in case.cached(footprints) if positions else ():
            for point in footprint.points if owner is vehicle else ():
                rooms = [solid.distance(point) for solid in solids]
                if fence is not None:
                    (x, y, _), high = fence
                    rooms.append(-Box((x, y, -inf), high).outside_by(point))
                if positions is None or min(rooms, default=inf) >= 2.0 * positions.error:
                    continue
                room = quantity(round(min(rooms), 2), LENGTH)
                yield Diagnostic(
                    "KYB592",
                    f"the positions of `{use.part.alias}` are too coarse to fly here",
                    use.part.span,
                    label=f"their standard deviation is {quantity(positions.error, LENGTH)}",
                    notes=(f"`{state.name}` flies at {shown_point(point)}, with {room} of room",),
                    help="fly further away from everything, or by motion capture or tags",
                    severity=Severity.WARNING,
                )
                break


_AGE, _USUAL = "estimate.age", 0.25


def _aged(low: float, high: float) -> Bounds:
    """Return bounds that limit only the estimate's age: from `low` to `high`."""

    def bounds(value: object) -> tuple[float, float]:
        return (low, high) if isinstance(value, Read) and value.name == _AGE else (-inf, inf)

    return bounds


def unknown_first(case: Case) -> Iterator[Diagnostic]:
    """KYB361: a behavior prefers an estimator that its vehicle does not have."""
    for vehicle, state in case.states():
        known = [use.part.alias for use in vehicle.estimators]
        for name in state.texts_of("estimators"):
            if name.text not in known:
                message = f"`{vehicle.name}` has no estimator `{name.text}`"
                hint = did_you_mean(name.text, known) or "add it under `estimators` of the vehicle"
                yield Diagnostic("KYB361", message, name.span, help=hint)


def first_twice(case: Case) -> Iterator[Diagnostic]:
    """KYB362: a behavior lists a preferred estimator twice."""
    for _, state in case.states():
        for index, name in enumerate(state.texts_of("estimators")):
            if name.text in state.estimators[:index]:
                message = f"`{name.text}` is in this list already"
                hint = "remove the second one"
                yield Diagnostic("KYB362", message, name.span, help=hint, severity=Severity.WARNING)


def never_begins(case: Case) -> Iterator[Diagnostic]:
    """KYB305: every estimator of a vehicle is dead reckoning, which continues the estimate of
    another estimator: there is never a first estimate, and the vehicle never takes off."""
    for vehicle in case.plan.vehicles:
        if vehicle.estimators and all(reckons(use) for use in vehicle.estimators):
            part = vehicle.estimators[0].part
            yield Diagnostic(
                "KYB305",
                f"`{vehicle.name}` never has an estimate",
                part.span,
                label=f"`{part.alias}` only continues the estimate of another",
                help="add one that measures the position, such as `mocap`, before it",
            )


def continues_nothing(case: Case) -> Iterator[Diagnostic]:
    """KYB566: dead reckoning, which continues the estimate of another estimator, comes first. It is
    then used as soon as the other one has an estimate, although nothing is lost.

    Vehicles with a behavior that reorders the estimators are not checked.
    """
    for vehicle in case.plan.vehicles:
        if len(vehicle.estimators) < 2 or any(s.estimators for s in vehicle.states.values()):
            continue
        first, second = vehicle.estimators[:2]
        if reckons(first) and not reckons(second):
            name, other = first.part.alias, second.part.alias
            yield Diagnostic(
                "KYB566",
                f"`{name}` of `{vehicle.name}` replaces `{other}` as soon as that has an estimate",
                first.part.span,
                label="only continues the estimate of another",
                help=f"put `{name}` after `{other}`",
            )


def healthy_if_bad(case: Case) -> Iterator[Diagnostic]:
    """KYB567: an estimator's `healthy` holds only if its estimate is old or uncertain: the
    comparison is the wrong way round."""
    for vehicle in case.plan.vehicles:
        for use in vehicle.estimators:
            healthy = use.text_of("healthy")
            if healthy is None or not {"<", ">"} & set(healthy.text):
                continue
            condition = case.condition(use, "healthy", case.scopes.health(vehicle.name))
            parts = condition.parts if isinstance(condition, And) else (condition,)
            for part in parts:
                match part:
                    case Compare(">" | ">=", Read(_, name)) | Compare("<" | "<=", _, Read(_, name)):
                        value = name.removeprefix("estimate.")
                        yield Diagnostic(
                            "KYB567",
                            f"`{use.part.alias}` is healthy only if its {value} is large",
                            healthy.span,
                            help=f"turn the comparison round: `{value} < ...`",
                        )


def reckons(use: EstimatorPlan) -> bool:
    """Return whether an estimator continues another one's estimate and measures only its own
    motion."""
    cls, params = use.part.cls, use.part.params
    return cls.anchor is not Estimator.anchor and cls.uses(params) <= {Imu}


def alone_for_a_time(case: Case) -> Iterator[Diagnostic]:
    """KYB256: the only estimator of a vehicle is limited by `for_at_most`; after that time the
    vehicle has no estimate and lands blind."""
    for vehicle in case.plan.vehicles:
        if len(vehicle.estimators) == 1 and vehicle.estimators[0].for_at_most is not None:
            part = vehicle.estimators[0].part
            yield Diagnostic(
                "KYB256",
                f"`{vehicle.name}` has no estimate after the `for_at_most` of `{part.alias}`",
                part.span,
                label="its only estimator",
                help="remove `for_at_most`, or add an estimator before it",
                severity=Severity.WARNING,
            )


def never_again(case: Case) -> Iterator[Diagnostic]:
    """KYB439: an estimator that was lost is never used again, because its `recover_after` is longer
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
