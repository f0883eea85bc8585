"""What carries a payload and lets it go: KYB395 to KYB397."""

from __future__ import annotations

from collections.abc import Iterator
from math import floor

from kybflow.core.geometry import GRAVITY
from kybflow.core.units import FORCE, MASS, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.diagnostics.diagnostic import Diagnostic
from kybflow.dsl.document import State, Vehicle
from kybflow.world.vehicle_context import Parcel

_SPARE = 1.1
_GRAMS = 10.0
"""From so many kilograms on, a mass is one of grams without its unit."""


def nothing_to_hold(case: Case) -> Iterator[Diagnostic]:
    """KYB395: a behavior loads or releases a payload, and its vehicle carries none."""
    for vehicle, state in _gripping(case):
        if vehicle.payload is None:
            yield Diagnostic(
                "KYB395",
                f"`{state.part.name.text}` needs a payload, and `{vehicle.name.text}` has none",
                state.part.name.span,
                help=f"give `{vehicle.name.text}` one: `payload: {{mass: 200 g, size: 10 cm}}`",
            )


def no_servo(case: Case) -> Iterator[Diagnostic]:
    """KYB396: a behavior loads or releases a payload, and the driver of the target moves no
    servo."""
    for vehicle, state in _gripping(case):
        driver = vehicle.driver
        if vehicle.payload is not None and not driver.spec.cls.grips:
            yield Diagnostic(
                "KYB396",
                f"`{state.part.name.text}` needs a servo, and `{driver.name.text}` moves none",
                state.part.name.span,
                label=f"`{vehicle.name.text}` flies on `{driver.name.text}`",
                help="fly it on a target whose driver has one, or leave the behavior out",
            )


def too_heavy_to_lift(case: Case) -> Iterator[Diagnostic]:
    """KYB397: four rotors at their largest thrust can't lift the vehicle and its payload with a
    tenth to spare."""
    for vehicle in case.vehicles():
        if vehicle.payload is None:
            continue
        most = vehicle.airframe.max_thrust
        weight = (vehicle.airframe.mass + vehicle.payload.mass) * GRAVITY
        if most < _SPARE * weight:
            yield Diagnostic(
                "KYB397",
                f"`{vehicle.name.text}` can't fly with its payload: its rotors lift {most:.3g} N",
                vehicle.spans.get("payload", vehicle.span),
                label=f"together they weigh {format_quantity(weight, FORCE)}",
                notes=("a tenth more than the weight is needed to steer",),
                help=_lighter(vehicle, vehicle.payload),
            )


def _lighter(vehicle: Vehicle, payload: Parcel) -> str:
    """What it can carry: the same number of grams, where that could be meant, or how much at
    most."""
    most = vehicle.airframe.max_thrust / (_SPARE * GRAVITY) - vehicle.airframe.mass
    if _GRAMS <= payload.mass <= 1000.0 * most:
        return f"did you mean `mass: {payload.mass:g} g`?"
    if most <= 0.0:
        return "fly another airframe: this one has nothing to spare"
    grams = floor(most * 1000.0)
    return f"carry {format_quantity(grams / 1000.0, MASS)} at most, or fly a stronger airframe"


def _gripping(case: Case) -> Iterator[tuple[Vehicle, State]]:
    """Every state that asks for the servo."""
    for vehicle, state in case.states():
        if state.part.spec.cls.grips:
            yield vehicle, state
