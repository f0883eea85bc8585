"""Parameters of implausible size, such as angles of many turns and distances larger than the room:
KYB426 to KYB429, KYB444, KYB564 and KYB565; and parameters without effect: KYB568."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from itertools import pairwise
from math import pi, tan
from typing import Any, NamedTuple

from kybflow.core.geometry import GRAVITY
from kybflow.core.params import Field, fields_of, fields_with
from kybflow.core.units import ACCELERATION, ANGLE, ANGULAR_RATE, DURATION, LENGTH, SPEED
from kybflow.dsl.checks.case import Case, bounded_parameters
from kybflow.dsl.checks.flow_places import entered_by_flows
from kybflow.dsl.checks.limits import LIMITS
from kybflow.dsl.checks.reachability import entries_of
from kybflow.dsl.checks.space import footprints, shown_point
from kybflow.dsl.diagnostics import Diagnostic, Severity, Span
from kybflow.dsl.expressions.tree import quantity
from kybflow.dsl.plan import PartPlan, VehiclePlan
from kybflow.dsl.reading.nodes import entries_of as entries_of_node
from kybflow.dsl.reading.nodes import items_of
from kybflow.parts import AIR, GROUND

_ROUNDING = 1e-6
_TURN = 2.0 * pi
_MIN_SPEED = 0.02
"""The least speed that makes sense for a flight, m/s: nearly a minute per metre."""
_MIN_RATE = pi / 180.0
"""The least rate of turning that makes sense, rad/s: six minutes a turn."""
_MIN_TILT = 0.5 * pi / 180.0
"""The least tilt that makes sense, rad: it accelerates by less than 0.1 m/s^2."""
_MIN_TOLERANCE = 0.001
"""Distance from its goal within which no vehicle stays, m."""
_MIN_CLIMB = 0.1
"""The least climb of a take-off, m. After a smaller one the vehicle may still be on the ground."""


def several_turns(case: Case) -> Iterator[Diagnostic]:
    """KYB426: an angle is larger than one turn, such as `90 rad` instead of `90 deg`, or a rate is
    more than one turn a second (a warning)."""
    angles = [(v.span_of("start", "heading"), "heading", v.heading) for v in case.plan.vehicles]
    rates: list[tuple[Span, str, float]] = []
    for number in case.cached(_written):
        name = number.field.name
        if number.field.dimension is ANGLE:
            angles.append((number.part.span_of(name), name, number.value))
        elif number.field.dimension is ANGULAR_RATE:
            rates.append((number.part.span_of(name), name, number.value))
    told = [(a, "", f"did you mean `{a[2]:g} deg`?") for a in angles]
    told += [(rate, " a second", "write at most `360 deg/s`") for rate in rates]
    for (span, name, value), unit, hint in told:
        if abs(value) > _TURN + _ROUNDING:
            yield Diagnostic(
                "KYB426",
                f"`{name}` is more than one turn{unit}",
                span,
                label=f"{abs(value) / _TURN:.3g} turns{unit}",
                help=hint,
                severity=Severity.WARNING,
            )


class _Number(NamedTuple):
    """A number that the mission gives to a parameter of a behavior."""

    vehicle: VehiclePlan
    part: PartPlan
    field: Field

    @property
    def value(self) -> float:
        value: float | None = getattr(self.part.params, self.field.name)
        return 0.0 if value is None else value


def _written(case: Case) -> Iterator[_Number]:
    """Yield every angle, rate and acceleration that the mission gives to a behavior."""
    for vehicle, state in case.states():
        part = state.behavior
        for field in _judged(part.params.__class__):
            if part.is_written(field.name):
                yield _Number(vehicle, part, field)


@functools.cache
def _judged(params: Any) -> tuple[Field, ...]:
    kinds = (ANGLE, ANGULAR_RATE, ACCELERATION)
    return tuple(f for f in fields_of(params) if f.dimension in kinds and f.shape == "scalar")


def larger_than_the_room(case: Case) -> Iterator[Diagnostic]:
    """KYB427: a length is too large to have any effect inside the fence, or a tolerance is too
    small to be met (a warning).

    A tolerance or a clearance is more than half of the fence's longest side, a height is above its
    top, or a tolerance is below 1 mm.
    """
    fence = case.plan.fence
    for _, _, part, field in case.cached(bounded_parameters):
        if field.room is None or not part.is_written(field.name):
            continue
        is_height, value = field.room != "across", getattr(part.params, field.name)
        if field.name == "tolerance" and value is not None and value < _MIN_TOLERANCE:
            yield Diagnostic(
                "KYB427",
                f"with a `tolerance` of {quantity(value, LENGTH)}, `{part.alias}` hardly ever ends",
                part.span_of(field.name),
                label="no vehicle is that exact",
                help=f"write more, such as `tolerance: {quantity(_usual(field), LENGTH)}`",
                severity=Severity.WARNING,
            )
        if fence is None:
            continue
        extent = fence.size[2] if is_height else max(fence.size)
        if value is None or value <= (extent if is_height else 0.5 * extent):
            continue
        usual, size = quantity(_usual(field), LENGTH), quantity(extent, LENGTH)
        what = f"`{field.name}` of {quantity(value, LENGTH)}"
        message = f"{what} leaves no room to fly inside the fence"
        note = f"that is more than half of the fence's longest side, {size}"
        if is_height:
            message, note = f"{what} is higher than the fence", f"the fence is {size} high"
        elif field.name == "tolerance":
            message = f"with a {what}, `{part.alias}` is done almost anywhere inside the fence"
        yield Diagnostic(
            "KYB427",
            message,
            part.span_of(field.name),
            notes=(note,),
            help=f"write a smaller value, such as `{field.name}: {usual}`",
            severity=Severity.WARNING,
        )


def without_effect(case: Case) -> Iterator[Diagnostic]:
    """KYB568: a parameter has no effect because another one is missing or has another value, such
    as a `turn_rate` without a `heading`, or a `tilt` where the sticks command velocities (a
    warning)."""
    for _, _, part, field in case.cached(bounded_parameters):
        other = field.only_with
        if other is None:
            continue
        given = getattr(part.params, other)
        if given in field.only_for if field.only_for else given is not None:
            continue
        if getattr(part.params, field.name) != field.default:
            needed = " or ".join(f"`{other}: {value}`" for value in field.only_for) or f"`{other}`"
            yield Diagnostic(
                "KYB568",
                f"`{field.name}` has no effect without {needed}",
                part.span_of(field.name),
                help=f"add {needed}, or remove `{field.name}`",
                severity=Severity.WARNING,
            )


def corner_twice(case: Case) -> Iterator[Diagnostic]:
    """KYB564: a path has the same corner twice in a row, so the second does nothing (a warning)."""
    for _, state in case.states():
        part = state.behavior
        for name in _paths(part.params.__class__) if not state.built_in else ():
            corners = getattr(part.params, name) or ()
            index = next((i for i, (a, b) in enumerate(pairwise(corners), 1) if a == b), None)
            if index is None or not part.is_written(name):
                continue
            items = items_of(entries_of_node(part.source.node)[name].value)
            yield Diagnostic(
                "KYB564",
                f"`{name}` of `{state.name}` has a corner twice in a row",
                items[index].span if index < len(items) else part.span_of(name),
                label=f"{shown_point(corners[index])} again",
                help="correct the corner, or remove it",
                severity=Severity.WARNING,
            )


@functools.cache
def _paths(params: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields_of(params) if field.shape == "path")


def entered_too_low(case: Case) -> Iterator[Diagnostic]:
    """KYB565: a behavior is entered below the smallest height at which it flies, so it can't obey
    until the vehicle has climbed (a warning)."""
    for vehicle, state, part, field in case.cached(bounded_parameters):
        if field.room != "floor" or state is None or not part.is_written(field.name):
            continue
        least = vehicle.start[2] + getattr(part.params, field.name)
        entries = entries_of(vehicle).get(state.name)
        flown = (
            point
            for other, name, point in case.cached(entered_by_flows)
            if (other, name) == (vehicle, state.name)
        )
        points = (*(entries.points if entries else ()), *flown)
        low = next((point for point in points if point[2] < least - _ROUNDING), None)
        if low is not None:
            yield Diagnostic(
                "KYB565",
                f"`{state.name}` is entered below its `{field.name}`",
                part.span_of(field.name),
                label=f"entered {quantity(low[2] - vehicle.start[2], LENGTH)} above the start",
                help=f"climb higher first, or reduce `{field.name}`",
                severity=Severity.WARNING,
            )


def _parts(case: Case) -> Iterator[PartPlan]:
    """Yield every behavior and processor of every vehicle."""
    for vehicle in case.plan.vehicles:
        yield from (state.behavior for state in vehicle.states.values())
        yield from vehicle.processors


def _usual(field: Field) -> float:
    return 1.0 if field.default is None else field.default


def beyond_any_tilt(case: Case) -> Iterator[Diagnostic]:
    """KYB428: a behavior's `acceleration` is more than the airframe reaches by tilting or by thrust
    (a warning)."""
    for number in case.cached(_written):
        vehicle, part, field = number
        airframe = vehicle.airframe
        lift = airframe.max_thrust / airframe.mass - GRAVITY
        most = max(GRAVITY * tan(airframe.tilt), lift)
        if field.dimension is ACCELERATION and number.value > most + _ROUNDING:
            usual, limit = quantity(_usual(field), ACCELERATION), quantity(most, ACCELERATION)
            yield Diagnostic(
                "KYB428",
                f"`{vehicle.name}` can't accelerate that fast",
                part.span_of(field.name),
                label=f"its tilt and its rotors allow {limit}",
                help=f"write at most `{field.name}: {limit}`; usual is {usual}",
                severity=Severity.WARNING,
            )


def crawls(case: Case) -> Iterator[Diagnostic]:
    """KYB429: a `speed` or `climb` is below 2 cm/s, a rate of turning below 1 deg/s, or the `tilt`
    of a behavior below 0.5 deg, at which a flight or a turn takes minutes (a warning)."""
    for _, part, field in case.cached(_written):
        value, dimension, name = getattr(part.params, field.name), field.dimension, field.name
        is_slow = dimension is ANGULAR_RATE and 0.0 < abs(value or 0.0) < _MIN_RATE
        if not is_slow and not (name == "tilt" and value < _MIN_TILT):
            continue
        assert dimension is not None
        more = quantity(field.default or 1.0, dimension)
        turns = f"one turn takes {quantity(round(_TURN / abs(value)), DURATION)}"
        yield Diagnostic(
            "KYB429",
            f"`{name}` of `{part.alias}` is too small to get anywhere",
            part.span_of(name),
            label=turns if is_slow else "",
            help=f"write a larger value, such as `{name}: {more}`",
            severity=Severity.WARNING,
        )
    for part in _parts(case):
        for field in part.fields:
            name = field.name
            if name not in LIMITS or field.dimension is not SPEED or not part.is_written(name):
                continue
            value = getattr(part.params, name)
            if not value or abs(value) >= _MIN_SPEED:
                continue
            faster = quantity(field.default or 0.5, SPEED)
            yield Diagnostic(
                "KYB429",
                f"`{name}` of `{part.alias}` is too slow to get anywhere",
                part.span_of(name),
                label=f"one metre takes {quantity(round(1.0 / abs(value), 1), DURATION)}",
                help=f"write a larger value, such as `{name}: {faster}`",
                severity=Severity.WARNING,
            )


def hardly_climbs(case: Case) -> Iterator[Diagnostic]:
    """KYB444: a take-off climbs less than 10 cm, or counts as done on the ground because its
    tolerance is as large as its climb, so the vehicle may still be on the ground (a warning)."""
    for _, state, entry, footprint in case.cached(footprints):
        legs = state.behavior.cls.flight
        if (GROUND, AIR) not in legs or entry is None or footprint.exit is None:
            continue
        climb, part = footprint.exit[2] - entry[2], state.behavior
        if climb < _MIN_CLIMB - _ROUNDING:
            lengths = [f.name for f in part.fields if f.dimension is LENGTH and f.required]
            written = (part.span_of(name) for name in lengths if part.is_written(name))
            yield Diagnostic(
                "KYB444",
                f"`{state.name}` barely leaves the ground",
                next(written, part.span),
                label=f"climbs only {quantity(climb, LENGTH)}",
                help="climb higher: one metre is clear of the ground",
                severity=Severity.WARNING,
            )
        for field in fields_with(part.params.__class__, "room"):
            if field.room == "up" and getattr(part.params, field.name) >= climb:
                yield Diagnostic(
                    "KYB444",
                    f"`{state.name}` counts as done on the ground",
                    part.span_of(field.name),
                    label=f"it climbs only {quantity(climb, LENGTH)}",
                    help=f"write a smaller value, such as `{field.name}: "
                    f"{quantity(_usual(field), LENGTH)}`",
                    severity=Severity.WARNING,
                )
