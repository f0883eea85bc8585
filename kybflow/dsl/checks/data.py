"""Data from the estimators to the driver: KYB301 to KYB303.

measurement ─► estimator          behavior ─► processors ─► tracker ─► driver
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from enum import Enum
from typing import Any

from kybflow.dsl.built_in import BUILT_IN
from kybflow.dsl.checks.case import Case, part_of
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.document import EstimatorUse, PartUse, Vehicle
from kybflow.dsl.sensors import provided
from kybflow.errors import PartError
from kybflow.parts import Leg, Sensor
from kybflow.signals import CommandKind, MeasurementKind, SetpointKind


def chains_that_do_not_connect(case: Case) -> Iterator[Diagnostic]:
    """KYB301: a part gives a kind of setpoint or command that the next one in the chain can't take.

    A behavior emits a kind of setpoint, each processor takes kinds and returns kinds, the tracker
    turns setpoints into a kind of command, and the driver takes kinds of command. Processors that
    are no safety parts are passed over in take-off and landing.
    """
    for vehicle in case.vehicles():
        driver, gives = vehicle.driver, vehicle.tracker.spec.cls.gives
        if gives not in driver.spec.cls.accepts:
            yield _gap(driver, f"{gives.value} commands", vehicle.tracker.name.text)
        for name in (*vehicle.states, *BUILT_IN):
            yield from _chain(case, vehicle, name)


def _chain(case: Case, vehicle: Vehicle, state: str) -> Iterator[Diagnostic]:
    behavior = case.behavior(vehicle, state)
    kind = behavior.emits if behavior is not None else SetpointKind.IDLE
    origin = f"{state}` ({part_of(vehicle, state)})"
    if isinstance(kind, CommandKind):
        if kind not in vehicle.driver.spec.cls.accepts:
            yield _gap(vehicle.driver, f"{kind.value} commands", origin)
        return
    if kind is SetpointKind.IDLE:
        return
    for processor in vehicle.processors:
        if not _applies(processor, case.legs(vehicle, state)):
            continue
        takes = processor.spec.cls.takes(processor.params)
        if kind not in takes:
            yield _gap(processor, f"{kind.value} setpoints", origin, takes)
            return
        kind = takes[kind]
    if kind not in vehicle.tracker.spec.cls.accepts:
        yield _gap(vehicle.tracker, f"{kind.value} setpoints", origin)


def _applies(processor: PartUse, legs: tuple[Leg, ...]) -> bool:
    return processor.spec.cls.safety or any(leg.start is leg.end for leg in legs)


def _gap(
    part: PartUse, what: str, origin: str, takes: Collection[Enum] | None = None
) -> Diagnostic:
    kinds = part.spec.cls.accepts if takes is None else takes
    known = ", ".join(f"`{k.value}`" for k in sorted(kinds, key=lambda k: str(k.value)))
    source = origin if origin.endswith(")") else f"{origin}`"
    return Diagnostic(
        "KYB301",
        f"`{part.name.text}` can't take the {what} of `{source}",
        part.name.span,
        label=f"takes {known or 'nothing'}",
    )


def missing_measurements(case: Case) -> Iterator[Diagnostic]:
    """KYB302: an estimator needs measurements that neither the target's driver nor a sensor
    provides."""
    for vehicle in case.vehicles():
        provides = provided(vehicle)
        for use in vehicle.estimators:
            missing = use.part.spec.cls.uses(use.part.params) - provides
            for kind in sorted(missing, key=lambda k: str(k.value)):
                given = ", ".join(sorted(f"`{k.value}`" for k in provides)) or "nothing"
                yield Diagnostic(
                    "KYB302",
                    f"`{use.part.name.text}` needs {kind.value} measurements",
                    use.part.name.span,
                    label=f"{_sources(vehicle)} {given}",
                    help=_way_out(case, vehicle, use, kind),
                )


def _sources(vehicle: Vehicle) -> str:
    parts = dict.fromkeys(f"`{use.part.name.text}`" for use in vehicle.sensors)
    if not parts:
        return f"`{vehicle.driver.name.text}` provides"
    return f"`{vehicle.driver.name.text}` and {', '.join(parts)} provide"


def _way_out(case: Case, vehicle: Vehicle, use: EstimatorUse, kind: MeasurementKind) -> str:
    """A sensor that would do, where there is one."""
    simulated = vehicle.driver.spec.cls.simulated
    for name in case.catalog.names("sensors"):
        sensor = _loaded(case, name)
        if sensor is not None and kind in sensor.provides and sensor.simulated <= simulated:
            own = f"{vehicle.name.text}: {{sensors: {{{use.part.label}: {{use: {name}}}}}}}"
            return f"write `targets: {{{case.document.target.text}: {{{own}}}}}`"
    return "use another estimator, or another driver in `targets`"


def _loaded(case: Case, name: str) -> type[Sensor[Any]] | None:
    """The class of a sensor; None for one that can't be loaded, which is told where it is used."""
    try:
        cls: type[Sensor[Any]] = case.catalog.get("sensors", name).cls
    except PartError:
        return None
    return cls


def nothing_to_fly_by(case: Case) -> Iterator[Diagnostic]:
    """KYB304: a vehicle has a behavior that needs an estimate of its state, and no estimator."""
    for vehicle in case.vehicles():
        if vehicle.estimators:
            continue
        behaviors = (s for s in vehicle.states.values() if s.part.spec.cls.needs_estimate)
        state = next(behaviors, None)
        if state is not None:
            yield Diagnostic(
                "KYB304",
                f"`{vehicle.name.text}` has no estimator",
                vehicle.span,
                label=f"`{state.name.text}` ({state.part.name.text}) needs one",
                help="name one under `estimators`",
            )


def control_rates(case: Case) -> Iterator[Diagnostic]:
    """KYB303: the control rate does not divide the rate of the driver's own steps, so that a tick
    would not fall on a step."""
    control = case.document.control_rate
    for vehicle in case.vehicles():
        driver = vehicle.driver
        rate = driver.spec.cls.step_rate(driver.params)
        if rate is None or _divides(control, rate):
            continue
        yield Diagnostic(
            "KYB303",
            f"control at {control} Hz does not divide `{driver.name.text}` at {rate:g} Hz",
            case.document.control_span or driver.span,
            label=f"{rate:g} / {control} = {rate / control:.4g}",
            help=f"use {_divisor(rate, control)} Hz",
        )


def _divides(control: int, rate: float) -> bool:
    steps = round(rate / control)
    return steps >= 1 and abs(rate / control - steps) < 1e-9


def _divisor(rate: float, control: int) -> str:
    """The rate nearest to `control` that divides `rate`."""
    steps = max(1, round(rate / control))
    return f"{rate / steps:g}"
