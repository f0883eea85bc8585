"""Checks the sensors that are not part of a driver, and the things that they observe: KYB387,
KYB388, KYB391 to KYB394."""

from __future__ import annotations

from collections.abc import Iterator

from kybflow.core.signals import Frame, MeasurementKind, kind_name
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics import Diagnostic, Severity
from kybflow.dsl.plan import SensorPlan, VehiclePlan


def of_no_use(case: Case) -> Iterator[Diagnostic]:
    """KYB391: a sensor measures nothing that the estimator it is assigned to needs."""
    for vehicle, use in _written(case):
        estimator = next(
            (e.part for e in vehicle.estimators if e.part.alias in use.estimators), None
        )
        if estimator is None:
            continue
        uses = estimator.cls.uses(estimator.params)
        if uses & use.part.cls.provides:
            continue
        yield Diagnostic(
            "KYB391",
            f"`{use.part.name}` measures nothing that `{estimator.alias}` needs",
            use.part.span,
            label=f"provides {_kinds(use.part.cls.provides)}",
            help=f"`{estimator.alias}` needs {_kinds(uses)}",
        )


def _kinds(kinds: frozenset[MeasurementKind]) -> str:
    return ", ".join(sorted(f"`{kind_name(kind)}`" for kind in kinds)) or "nothing"


def not_simulated(case: Case) -> Iterator[Diagnostic]:
    """KYB392: a sensor observes simulated vehicles, but the vehicle's driver simulates none."""
    for vehicle, use in _written(case):
        driver = vehicle.driver
        if use.part.cls.simulated and not driver.cls.shows(driver.params):
            yield Diagnostic(
                "KYB392",
                f"`{use.part.name}` observes only simulated vehicles",
                use.part.span,
                label=f"`{vehicle.name}` flies on `{vehicle.driver.name}`",
                help="use a real sensor here, and this one only for a simulated target",
            )


def not_as_told(case: Case) -> Iterator[Diagnostic]:
    """KYB393: a sensor can't work with its parameters: the airframe has no such camera, or the
    address of its server is invalid. It is a warning if the sensor can work, but hardly."""
    for vehicle, use in _written(case):
        objection = use.part.cls.objection(use.part.params, vehicle.own_cameras)
        if objection is not None:
            span = use.part.span_of(objection.parameter)
            severity = Severity.WARNING if objection.is_doubt else Severity.ERROR
            yield Diagnostic(
                "KYB393", objection.reason, span, help=objection.hint, severity=severity
            )


def two_of_the_same(case: Case) -> Iterator[Diagnostic]:
    """KYB394: two sensors give a vehicle the same measurements. An estimator receives the
    measurements of all sensors of its vehicle, whatever name a sensor is listed under, so they
    would be mixed."""
    given: dict[tuple[str, str], SensorPlan] = {}
    for vehicle, use in _written(case):
        for what in use.part.cls.claims(use.part.params, vehicle.own_cameras):
            first = given.setdefault((vehicle.name, what), use)
            a, b = first.part, use.part
            is_same = (a.name, a.params) == (b.name, b.params)
            if first is use or (is_same and first.estimators != use.estimators):
                continue
            beside = f"listed for `{use.estimators[0]}`, the other for `{first.estimators[0]}`"
            yield Diagnostic(
                "KYB394",
                f"`{vehicle.name}` gets {what} from two sensors",
                use.part.span,
                label="" if first.estimators == use.estimators else beside,
                notes=(f"the other is at {first.part.span.at}",),
                help="remove one: every estimator of the vehicle receives what the other measures",
            )
            break


def _written(case: Case) -> Iterator[tuple[VehiclePlan, SensorPlan]]:
    """Yield every sensor that the mission names, without those that a driver adds itself."""
    for vehicle in case.plan.vehicles:
        yield from ((vehicle, use) for use in vehicle.sensors if use.estimators)


def nothing_to_see_with(case: Case) -> Iterator[Diagnostic]:
    """KYB387: an estimator needs camera frames, but the airframe has no camera."""
    for vehicle in case.plan.vehicles:
        for use in () if vehicle.body.cameras else vehicle.estimators:
            if Frame not in use.part.cls.uses(use.part.params):
                continue
            camera = "{down: {at: [0, 0, 0], width: 640, height: 480, field_of_view: 70 deg}}"
            yield Diagnostic(
                "KYB387",
                f"`{use.part.name}` needs a camera, but the airframe has none",
                use.part.span,
                notes=(f"`{vehicle.name}` is at {vehicle.span.at}",),
                help=f"give the airframe `cameras: {camera}`",
            )


def nothing_to_see(case: Case) -> Iterator[Diagnostic]:
    """KYB388: an estimator locates the vehicle by printed tags, but the world has none."""
    for vehicle in case.plan.vehicles:
        for use in () if case.plan.world.tags else vehicle.estimators:
            cls = use.part.cls
            if cls.needs_tags and Frame in cls.uses(use.part.params):
                grid = "{grid: {family: 36h11, count: [10, 10], size: 19.5 cm, spacing: 2 cm}}"
                yield Diagnostic(
                    "KYB388",
                    f"`{use.part.name}` needs tags, but the world has none",
                    use.part.span,
                    help=f"write `world: {{tags: {{floor: {grid}}}}}`",
                )
