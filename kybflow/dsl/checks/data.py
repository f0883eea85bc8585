"""Data from the estimators to the driver: KYB301 to KYB304, KYB306, KYB536 and KYB537.

measurement ─► estimator          behavior ─► processors ─► tracker ─► driver
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

from kybflow.core.signals import CommandKind, MeasurementKind, SetpointKind, kind_name
from kybflow.dsl.checks.case import Case, part_of
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity
from kybflow.dsl.expanding.targets import divides, provided
from kybflow.dsl.names import BUILT_IN
from kybflow.dsl.plan import EstimatorPlan, PartPlan, VehiclePlan


def chains_that_do_not_connect(case: Case) -> Iterator[Diagnostic]:
    """KYB301: a part outputs a kind of setpoint or command that the next part in the chain can't
    take.

    A behavior emits setpoints or commands, each processor takes and returns setpoints, the tracker
    turns setpoints into commands, and the driver takes commands. Take-offs and landings bypass all
    processors except safety processors.
    """
    for vehicle in case.plan.vehicles:
        driver, tracker = vehicle.driver, vehicle.tracker
        takes = driver.cls.takes(driver.params)
        refused = sorted(tracker.cls.kinds(tracker.params) - takes, key=_name)
        if refused:
            *first, last = map(_name, refused)
            kinds = f"{', '.join(first)} and {last}" if first else last
            gap = _gap(driver, f"{kinds} commands", tracker.name, takes)
            target = case.plan.target_text
            if target is not None and driver.span == target.span:  # the mission doesn't write it
                label = f"`{driver.name}` {gap.label}"
                gap = replace(gap, span=tracker.span, label=label)
            related = () if gap.span == tracker.span else (Related(tracker.span, "the tracker"),)
            yield replace(gap, help=_fitting_tracker(case, vehicle, takes), related=related)
        walked: dict[tuple[SetpointKind | CommandKind, bool], _Refusal | None] = {}
        for name in (*vehicle.states, *BUILT_IN):
            behavior = case.behavior(vehicle, name)
            kind = behavior.emits if behavior is not None else SetpointKind.IDLE
            key = kind, any(leg.start is leg.end for leg in case.legs(vehicle, name))
            if key not in walked:
                walked[key] = _refusal(vehicle, *key)
            # a vehicle may land blind in a mode of its own instead of in the built-in state
            lands_itself = isinstance(kind, CommandKind) and name in BUILT_IN
            lands_itself = lands_itself and driver.cls.lands_blind
            if (refusal := walked[key]) is not None and not lands_itself:
                origin = f"{name}` ({part_of(vehicle, name)})"
                yield _gap(refusal.part, refusal.what, origin, refusal.takes)


class _Refusal(NamedTuple):
    """The part in the chain that can't take its input. what: the input in words. takes: the kinds
    of input that the part takes."""

    part: PartPlan
    what: str
    takes: Collection[Enum]


def _refusal(
    vehicle: VehiclePlan, kind: SetpointKind | CommandKind, stays: bool
) -> _Refusal | None:
    """Return the first part in the chain that can't take `kind`, or None. stays: whether the
    behavior is neither a take-off nor a landing, so that every processor applies."""
    if isinstance(kind, CommandKind):
        driver = vehicle.driver
        accepted = driver.cls.takes(driver.params)
        return None if kind in accepted else _Refusal(driver, f"{kind.value} commands", accepted)
    if kind is SetpointKind.IDLE:
        return None
    for processor in vehicle.processors:
        if not (stays or processor.cls.safety):
            continue
        takes = processor.cls.takes(processor.params)
        if kind not in takes:
            return _Refusal(processor, f"{kind.value} setpoints", takes)
        kind = takes[kind]
    takes = vehicle.tracker.cls.accepts
    return None if kind in takes else _Refusal(vehicle.tracker, f"{kind.value} setpoints", takes)


def _fitting_tracker(case: Case, vehicle: VehiclePlan, takes: frozenset[CommandKind]) -> str:
    """Return a help line with a tracker that fits: the one that the driver asks for, or else one
    whose commands the driver takes and that needs no parameters. Empty if there is none."""
    asked = vehicle.driver.cls.tracker(vehicle.driver.params)
    if asked is not None:
        keys = ", ".join(f"{name}: {value}" for name, value in asked.items())
        return _with_tracker(case, vehicle, asked["use"] if len(asked) == 1 else f"{{{keys}}}")
    for spec in case.parts("trackers"):
        if any(field.required for field in spec.fields):
            continue
        if spec.cls.kinds(spec.params()) <= takes:
            return _with_tracker(case, vehicle, spec.name)
    return ""


def _with_tracker(case: Case, vehicle: VehiclePlan, tracker: str) -> str:
    own = f"{vehicle.name}: {{tracker: {tracker}}}"
    return f"write `targets: {{{case.plan.target}: {{{own}}}}}`"


def _gap(part: PartPlan, what: str, origin: str, takes: Collection[Enum]) -> Diagnostic:
    known = ", ".join(f"`{k.value}`" for k in sorted(takes, key=_name))
    source = origin if origin.endswith(")") else f"{origin}`"
    return Diagnostic(
        "KYB301",
        f"`{part.name}` can't take the {what} of `{source}",
        part.span,
        label=f"takes {known or 'nothing'}",
        help=f"remove `{part.name}`, or use another one that takes {what}",
    )


def _name(kind: Enum) -> str:
    return str(kind.value)


def undone_by_the_next(case: Case) -> Iterator[Diagnostic]:
    """KYB537: a processor undoes what one before it does: a limit slows down evasions, or an
    evasion leaves the bounds that a processor like `fence` keeps (a warning)."""
    for vehicle in case.plan.vehicles:
        evading = clamping = None
        for part in vehicle.processors:
            before, what = None, ""
            if evading is not None and part.cls.slows:
                before, what = evading, "slows down what it does to keep its distance"
            elif clamping is not None and part.cls.evades:
                before, what = clamping, "may lead the setpoint out again"
            if part.cls.evades or part.cls.keeps_off(part.params, vehicle.airframe) > 0.0:
                evading = part
            elif part.cls.clamps:
                clamping = part
            if before is not None:
                yield Diagnostic(
                    "KYB537",
                    f"`{part.alias}` of `{vehicle.name}` comes after `{before.alias}`",
                    part.span,
                    label=what,
                    help=f"put `{part.alias}` before `{before.alias}`",
                    severity=Severity.WARNING,
                    related=(Related(before.span, f"`{before.alias}`"),),
                )


def missing_measurements(case: Case) -> Iterator[Diagnostic]:
    """KYB302: an estimator needs measurements that neither the target's driver nor a sensor
    provides."""
    for vehicle in case.plan.vehicles:
        provides = provided(vehicle)
        parts = ", ".join(dict.fromkeys(f"`{use.part.name}`" for use in vehicle.sensors))
        sources = f"`{vehicle.driver.name}`" + (f" and {parts} provide" if parts else " provides")
        for use in vehicle.estimators:
            missing = use.part.cls.uses(use.part.params) - provides
            for kind in sorted(missing, key=kind_name):
                given = ", ".join(sorted(f"`{kind_name(k)}`" for k in provides)) or "nothing"
                yield Diagnostic(
                    "KYB302",
                    f"`{use.part.name}` needs {kind_name(kind)} measurements",
                    use.part.span,
                    label=f"{sources} {given}",
                    help=_way_out(case, vehicle, use, kind),
                )


def _way_out(case: Case, vehicle: VehiclePlan, use: EstimatorPlan, kind: MeasurementKind) -> str:
    """Return a help line with a sensor that would provide the measurements, or else general
    advice."""
    shows = vehicle.driver.cls.shows(vehicle.driver.params)
    for spec in case.parts("sensors"):
        if kind in spec.cls.provides and spec.cls.simulated <= shows:
            own = f"{vehicle.name}: {{sensors: {{{use.part.alias}: {{use: {spec.name}}}}}}}"
            return f"write `targets: {{{case.plan.target}: {{{own}}}}}`"
    return "use another estimator, or another driver in `targets`"


def drivers_not_as_told(case: Case) -> Iterator[Diagnostic]:
    """KYB306: a driver can't work with its parameters, such as an invalid address, or can't fly the
    vehicle, such as one with a payload."""
    for vehicle in case.plan.vehicles:
        driver = vehicle.driver
        objection = driver.cls.objection(driver.params, vehicle.start, vehicle.payload)
        if objection is not None:
            span, key = driver.span_of(objection.parameter), objection.parameter
            if vehicle.is_written(key) and not driver.is_written(key):
                span = vehicle.key_span(key)
            yield Diagnostic("KYB306", objection.reason, span, help=objection.hint)


def nothing_to_fly_by(case: Case) -> Iterator[Diagnostic]:
    """KYB304: a vehicle has a behavior that needs a state estimate, but no estimator."""
    for vehicle in case.plan.vehicles:
        if vehicle.estimators:
            continue
        behaviors = (s for s in vehicle.states.values() if s.behavior.cls.needs_estimate)
        state = next(behaviors, None)
        if state is not None:
            yield Diagnostic(
                "KYB304",
                f"`{vehicle.name}` has no estimator",
                vehicle.span,
                label=f"`{state.name}` ({state.behavior.name}) needs one",
                help="add one under `estimators`",
            )


def no_watchdog(case: Case) -> Iterator[Diagnostic]:
    """KYB536: nothing lands the vehicle if this program stops, so the preflight never passes."""
    for vehicle in case.plan.vehicles:
        driver = vehicle.driver
        reason = driver.cls.watchdog(driver.params)
        if reason is not None:
            yield Diagnostic(
                "KYB536",
                f"the preflight of `{vehicle.name}` never passes: {reason}",
                driver.span_of("watchdog"),
                help="a vehicle must land by itself if nothing commands it",
            )


def control_rates(case: Case) -> Iterator[Diagnostic]:
    """KYB303: the control rate does not divide the step rate of the driver, so control ticks would
    not fall on steps."""
    control = case.plan.control_rate
    for vehicle in case.plan.vehicles:
        driver = vehicle.driver
        rate = driver.cls.step_rate(driver.params)
        if rate is None or divides(control, rate):
            continue
        nearest = rate / max(1, round(rate / control))
        yield Diagnostic(
            "KYB303",
            f"control at {control} Hz does not divide `{driver.name}` at {rate:g} Hz",
            case.plan.span_of("control") if case.plan.entry("control") else driver.span,
            label=f"{rate:g} / {control} = {rate / control:.4g}",
            help=f"use {nearest:g} Hz",
        )
