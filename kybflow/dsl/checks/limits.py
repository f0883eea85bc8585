"""What is asked of an airframe beyond its limits: KYB316 and KYB317."""

from __future__ import annotations

from collections.abc import Iterator
from math import atan

from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.space import footprints
from kybflow.dsl.diagnostics import Diagnostic
from kybflow.dsl.document import PartUse, Vehicle
from kybflow.geometry import GRAVITY
from kybflow.params import fields_of
from kybflow.site import Airframe
from kybflow.units import ANGLE, format_quantity

_ROUNDING = 1e-6
_LIMITS = frozenset({"tilt", "speed", "climb"})
"""The airframe's parameters that bound those of the same name in a tracker and a processor."""


def beyond_the_airframe(case: Case) -> Iterator[Diagnostic]:
    """KYB316: a tracker or a processor is given a `tilt`, `speed` or `climb` beyond the
    airframe's."""
    for vehicle in case.vehicles():
        for part in (vehicle.tracker, *vehicle.processors):
            yield from _beyond(vehicle, part)


def _beyond(vehicle: Vehicle, part: PartUse) -> Iterator[Diagnostic]:
    for field in fields_of(Airframe):
        name, dimension = field.name, field.dimension
        own = next((f for f in part.spec.fields if f.name == name), None)
        if name not in _LIMITS or name not in part.spans or own is None or dimension is None:
            continue
        value, limit = getattr(part.params, name), getattr(vehicle.airframe, name)
        if own.dimension is not dimension or value is None or value <= limit + _ROUNDING:
            continue
        yield Diagnostic(
            "KYB316",
            f"`{part.name.text}` asks for more {name} than `{vehicle.name.text}` has",
            part.spans[name],
            label=format_quantity(value, dimension),
            notes=(f"its airframe has {format_quantity(limit, dimension)}",),
        )


def too_steep(case: Case) -> Iterator[Diagnostic]:
    """KYB317: a behavior's curves need more tilt than the airframe has: atan(a / g) for the
    acceleration a."""
    for vehicle, state, _, footprint in footprints(case):
        limit, tilt = vehicle.airframe.tilt, atan(footprint.acceleration / GRAVITY)
        if tilt <= limit + _ROUNDING:
            continue
        yield Diagnostic(
            "KYB317",
            f"`{state.name.text}` ({state.part.name.text}) is too sharp for `{vehicle.name.text}`",
            state.part.name.span,
            label=f"needs a tilt of {format_quantity(tilt, ANGLE)}",
            notes=(f"its airframe may tilt {format_quantity(limit, ANGLE)}",),
            help="fly it slower or wider",
        )
