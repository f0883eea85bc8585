"""Faults: what they break, when, and on which targets that is possible: KYB330 to KYB336, KYB438
and KYB457; and the air of a simulated lab: KYB562."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot, tan
from random import Random

from kybflow.core.geometry import GRAVITY, add
from kybflow.core.params import Named, named_in
from kybflow.core.signals import NS, Time, kind_name
from kybflow.core.text import did_you_mean
from kybflow.core.units import DURATION, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Diagnostic, Severity, Span
from kybflow.dsl.expressions import parse
from kybflow.dsl.plan import FaultPlan, PartPlan
from kybflow.dsl.reading.nodes import entries_of
from kybflow.parts.fault import ActiveFaults
from kybflow.world.cameras import SOUND
from kybflow.world.vehicle_context import Airframe

_FULL_STRENGTH_NS: Time = 1000 * NS
"""A time by which every effect has reached full strength."""
_DEVIATIONS = 2.0
"""Gusts are stronger than this many standard deviations only for moments."""


def unknown_vehicles(case: Case) -> Iterator[Diagnostic]:
    """KYB330: a fault names a vehicle that the mission does not have."""
    known = case.plan.fleet
    for fault in case.plan.faults:
        for name, span in _vehicles(fault):
            if name not in known:
                message, hint = f"there is no vehicle `{name}`", did_you_mean(name, known)
                group = case.plan.groups.get(name)
                if group is not None:
                    members = ", ".join(f"`{member}`" for member in group)
                    message = f"`{name}` is a group, but a fault affects one vehicle"
                    hint = f"write one fault for each of {members}"
                yield Diagnostic("KYB330", message, span, help=hint)


def not_simulated(case: Case) -> Iterator[Diagnostic]:
    """KYB331: the mission has a fault, but the target is not a simulation, so nothing can be broken
    on purpose. With a firmware's own simulator, only what kybflow itself provides can be broken."""
    target = case.plan.target
    for fault in case.plan.faults:
        for name, _ in _vehicles(fault):
            vehicle = case.plan.fleet.get(name)
            if vehicle is None or vehicle.driver.cls.simulated:
                continue
            shows = vehicle.driver.cls.shows(vehicle.driver.params)
            if shows and fault.part.cls.ours and not any(_named(fault, "object")):
                continue
            where = "no simulation"
            if shows:
                where = (
                    "another program's simulator: only what kybflow receives from it can be broken"
                )
            yield Diagnostic(
                "KYB331",
                f"`{fault.part.name}` can't be injected on the target `{target}`",
                fault.span,
                label=f"`{name}` flies on `{vehicle.driver.name}`, which is {where}",
                help="fly this mission in simulation, or remove the fault",
            )
            break


def too_late(case: Case) -> Iterator[Diagnostic]:
    """KYB332: a fault begins at or after the mission's time limit."""
    limit = case.plan.time_limit
    for fault in case.plan.faults:
        if fault.time is not None and fault.time >= limit:
            yield Diagnostic(
                "KYB332",
                f"`{fault.part.name}` is never injected",
                fault.span,
                label=f"at {format_quantity(fault.time, DURATION)}",
                notes=(f"the mission's `time_limit` is {format_quantity(limit, DURATION)}",),
                help="inject it earlier, or write a longer `time_limit`",
                severity=Severity.WARNING,
            )


def twice(case: Case) -> Iterator[Diagnostic]:
    """KYB333: the list contains the same fault twice."""
    first: dict[object, Span] = {}
    for fault in case.plan.faults:
        when = fault.text_of("when")
        key = (fault.part.name, fault.part.params, fault.vehicle, fault.time, when and when.text)
        place = first.setdefault(key, fault.span)
        if place is not fault.span:
            message = f"`{fault.part.name}` is listed twice"
            note = f"the first is at {place.at}"
            yield Diagnostic("KYB333", message, fault.span, notes=(note,), help="remove one")


def itself(case: Case) -> Iterator[Diagnostic]:
    """KYB334: a fault between two vehicles names one vehicle twice."""
    for fault in case.plan.faults:
        for name, span in _named(fault, "vehicle"):
            if name == fault.vehicle:
                message = f"`{fault.part.name}` needs two different vehicles"
                hint = "name another vehicle"
                yield Diagnostic("KYB334", message, span, "already named by `on`", help=hint)


def unknown_estimators(case: Case) -> Iterator[Diagnostic]:
    """KYB335: a fault names an estimator that its vehicle does not have, or an object that does not
    exist or is a part of another one."""
    moving = [name for name, one in case.plan.objects.items() if one.moves]
    for fault in case.plan.faults:
        for name, span in _named(fault, "object"):
            if name not in moving:
                hint = did_you_mean(name, moving) if moving else "declare one in `world.objects`"
                message = f"no object that moves is called `{name}`"
                yield Diagnostic("KYB335", message, span, help=hint)
        vehicle = case.plan.fleet.get(fault.vehicle)
        known = [] if vehicle is None else [use.part.alias for use in vehicle.estimators]
        for name, span in _named(fault, "estimator"):
            if known and name not in known:
                message = f"`{fault.vehicle}` has no estimator `{name}`"
                hint = did_you_mean(name, known) or f"it has {', '.join(known)}"
                yield Diagnostic("KYB335", message, span, help=hint)


def of_no_effect(case: Case) -> Iterator[Diagnostic]:
    """KYB336: a fault of the camera, the tags or motion capture is applied to a vehicle that uses
    none of them, or the messages of a vehicle are lost that no other vehicle hears."""
    for fault in case.plan.faults:
        vehicle, kind = case.plan.fleet.get(fault.vehicle), fault.part.cls.spoils
        if vehicle is not None and _active_under(fault).silent:
            others = (state.behavior for own, state in case.states() if own is not vehicle)
            if not any(behavior.cls.hears for behavior in others):
                yield Diagnostic(
                    "KYB336",
                    f"`{fault.part.name}` has no effect: no other vehicle hears `{vehicle.name}`",
                    fault.part.span,
                    label="none follows it or flies with it",
                    help="remove the fault",
                )
        if vehicle is None or kind is None or any(_named(fault, "object")):
            continue
        parts = [use.part for use in vehicle.estimators]
        if any(kind in part.cls.uses(part.params) for part in parts):
            continue
        known = ", ".join(f"`{part.alias}`" for part in parts) or "nothing"
        yield Diagnostic(
            "KYB336",
            f"`{fault.part.name}` can't affect `{vehicle.name}`: none of its estimators needs "
            f"{kind_name(kind)}s",
            fault.part.span,
            label=f"its estimators: {known}",
            help="apply it to another vehicle, or remove the fault",
        )


def of_no_size(case: Case) -> Iterator[Diagnostic]:
    """KYB438: a fault's parameters leave it without any effect, such as a gust of `[0, 0, 0]` (a
    warning). Each kind of fault decides that for itself."""
    for fault in case.plan.faults:
        part = fault.part
        if part.cls.is_nothing(part.params):
            yield Diagnostic(
                "KYB438",
                f"`{part.name}` has no effect",
                _first_span(part),
                label="changes nothing",
                help="choose values that have an effect, or remove the fault",
                severity=Severity.WARNING,
            )


def too_strong(case: Case) -> Iterator[Diagnostic]:
    """KYB457: a fault is stronger than the vehicle can withstand (a warning).

    The rotors must lift the vehicle with what the fault adds, and its largest tilt must withstand
    the horizontal push: g tan(tilt) against the drag of the wind plus a push. If a rotor is weak,
    the other three can give no more thrust than this one, or the vehicle would tip or spin. Wrong
    sensors are not judged, because such missions test their effect.
    """
    for fault in case.plan.faults:
        vehicle = case.plan.fleet.get(fault.vehicle)
        if vehicle is None:
            continue
        frame, active = vehicle.airframe, _active_under(fault)
        air, (px, py, up) = vehicle.driver.cls.air(vehicle.driver.params), active.push
        wx, wy, _ = add(air.wind, active.wind(_FULL_STRENGTH_NS))
        heavy = (active.mass * frame.mass * (1.0 - up / GRAVITY) + active.payload) * GRAVITY
        why = _pushed(frame, hypot(frame.drag * wx + px, frame.drag * wy + py))
        lift = frame.max_thrust * min(active.rotors)
        if heavy > lift:
            balanced = "" if lift == frame.max_thrust else "in balance with the weak one, "
            why = f"{balanced}its rotors lift {lift:.3g} N, but it weighs {heavy:.3g} N"
        if not why:
            continue
        yield Diagnostic(
            "KYB457",
            f"`{vehicle.name}` can't withstand `{fault.part.name}`",
            _first_span(fault.part),
            label=why,
            help="make the fault weaker, unless the mission is meant to show this",
            severity=Severity.WARNING,
        )


def _pushed(frame: Airframe, across: float) -> str:
    """Return why an airframe can't withstand a horizontal push, m/s^2; empty if it can."""
    able = GRAVITY * tan(frame.tilt)
    if across <= able:
        return ""
    return f"it is pushed with {across:.3g} m/s^2, but its tilt withstands {able:.3g} m/s^2"


def too_windy(case: Case) -> Iterator[Diagnostic]:
    """KYB562: the simulated lab's air pushes a vehicle harder than its largest tilt can withstand,
    so it drifts away: an error for the steady wind alone, a warning for gusts and other random
    forces.

    It is pushed by the drag of the wind, and by gusts of two standard deviations.
    """
    for vehicle in case.plan.vehicles:
        driver, frame = vehicle.driver, vehicle.airframe
        air = driver.cls.air(driver.params)
        steady = frame.drag * hypot(*air.wind[:2])
        random = _DEVIATIONS * hypot(frame.drag * air.gust, air.force)
        why = _pushed(frame, steady) or _pushed(frame, steady + random)
        if why:
            written = (driver.span_of(name) for name in driver.source.node.entries)
            yield Diagnostic(
                "KYB562",
                f"`{vehicle.name}` can't withstand the air of its lab",
                next(written, driver.span),
                label=why,
                help="make the wind weaker",
                severity=Severity.ERROR if _pushed(frame, steady) else Severity.WARNING,
            )


def _first_span(part: PartPlan) -> Span:
    """Return the source location of a part's first parameter, or else of its name."""
    written = entries_of(part.source.node).values()
    return next((entry.value.span for entry in written), part.span)


def _active_under(fault: FaultPlan) -> ActiveFaults:
    """Return the active faults of a vehicle that has only this fault's effects."""
    active = ActiveFaults(fault.vehicle)
    try:
        effects = fault.part.cls(fault.part.params, Random(0)).effects(active.vehicle)
    except Exception:  # a part may raise anything; `fault_failed` reports it in flight
        return active
    if active.vehicle in effects:
        active.begin(effects[active.vehicle], 0)
    return active


def misleads(fault: FaultPlan) -> bool:
    """Return whether a fault can make the vehicle believe that it is elsewhere."""
    active = _active_under(fault)
    biased = any(active.gyro_bias) or any(active.accelerometer_bias)
    seen = active.body != active.vehicle or active.view != active.vehicle
    return bool(active.filters or active.estimators or biased or seen or active.camera != SOUND)


def conditions(case: Case) -> Iterator[Diagnostic]:
    """Every `when` of a fault must be a valid condition in the scope of its vehicle: KYB210 to
    KYB214."""
    for fault in case.plan.faults:
        when = fault.text_of("when")
        if when is not None and fault.vehicle in case.plan.fleet:
            yield from parse(when, case.scopes.condition(fault.vehicle))[1]


def _vehicles(fault: FaultPlan) -> Iterator[tuple[str, Span]]:
    name = fault.text_of("on")
    yield fault.vehicle, fault.span if name is None else name.span
    yield from _named(fault, "vehicle")


def _named(fault: FaultPlan, what: Named) -> Iterator[tuple[str, Span]]:
    """Yield (name, span) for the fault's parameters that are names of the kind `what`."""
    for parameter, name in named_in(fault.part.params, what).items():
        yield name, fault.part.span_of(parameter)
