"""Demands beyond an airframe's limits, implausible airframes, and payloads: KYB314, KYB316 to
KYB319, KYB395 to KYB397, KYB420, KYB421, KYB560 and KYB561."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain
from math import atan, floor, inf
from typing import NamedTuple

from kybflow.core.geometry import GRAVITY
from kybflow.core.params import fields_of
from kybflow.core.units import ANGLE, FORCE, MASS, SPEED, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.space import footprints, the_limit, values_of
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity, Span
from kybflow.dsl.expressions.tree import quantity
from kybflow.dsl.plan import Body, PartPlan, StatePlan, VehiclePlan
from kybflow.parts import AIR, GROUND
from kybflow.world.plausible import Implausible, of_airframe, of_parcel
from kybflow.world.vehicle_context import Airframe, Parcel

_ROUNDING = 1e-6
_MIN_MAX_RATIO = 1.15
_HOLDING = 0.2
"""The least acceleration with which a vehicle holds its position in the air of a lab, m/s^2."""

LIMITS = frozenset({"tilt", "speed", "climb"})
"""The limits of an airframe that bound the parameters of the same name in its parts."""


def beyond_the_airframe(case: Case) -> Iterator[Diagnostic]:
    """KYB316: the `tilt`, `speed` or `climb` of a tracker or a processor, or the `climb` of a
    behavior, exceeds that of the airframe."""
    limited = [field for field in fields_of(Airframe) if field.name in LIMITS]
    written = (
        (vehicle, part, field)
        for vehicle in case.plan.vehicles
        for part in (vehicle.tracker, *vehicle.processors)
        if not LIMITS.isdisjoint(part.source.node.entries)
        for field in limited
        if part.is_written(field.name)
    )
    climb = next(field for field in limited if field.name == "climb")
    states = ((v, s.behavior) for v, s in case.states() if s.behavior.is_written("climb"))
    climbing = ((vehicle, part, climb) for vehicle, part in states)
    for vehicle, part, field in chain(written, climbing):
        name, dimension = field.name, field.dimension
        if dimension is None:
            continue
        own = next(f for f in part.fields if f.name == name)
        value, limit = getattr(part.params, name), getattr(vehicle.airframe, name)
        if own.dimension is not dimension or value is None or value <= limit + _ROUNDING:
            continue
        yield Diagnostic(
            "KYB316",
            f"`{part.name}` asks for more {name} than `{vehicle.name}` allows",
            part.span_of(name),
            label=f"its airframe allows {format_quantity(limit, dimension)}",
            help=f"write at most `{name}: {format_quantity(limit, dimension)}`",
            related=the_limit(vehicle, name),
        )


def too_fast(case: Case) -> Iterator[Diagnostic]:
    """KYB314: a behavior is faster than the airframe allows: its `speed`, or in a take-off or a
    landing also its `climb`."""
    for vehicle, state, _, footprint in case.cached(footprints):
        legs = state.behavior.cls.flight
        is_vertical = any(GROUND in leg and leg.start is not leg.end for leg in legs)
        limit = min(vehicle.airframe.speed, vehicle.airframe.climb if is_vertical else inf)
        origin = footprint.origin
        is_climb = limit != vehicle.airframe.speed
        way = "climbs" if any(leg.start is GROUND for leg in legs) else "descends"
        if footprint.speed <= limit + _ROUNDING:
            continue
        most, is_written = quantity(limit, SPEED), state.behavior.is_written("speed")
        yield Diagnostic(
            "KYB314",
            f"`{state.name}` {way if is_climb else 'flies'} faster than `{vehicle.name}` can",
            state.behavior.span_of("speed"),
            label=f"reaches {quantity(footprint.speed, SPEED)}",
            notes=(
                f"its airframe {'climbs and descends' if is_climb else 'flies'} at {most} at most",
                *((f"fastest at {origin.fastest}",) if origin is not None else ()),
            ),
            help=f"write at most `speed: {most}`" if is_written else "fly it more slowly",
            related=(
                *the_limit(vehicle, "climb" if is_climb else "speed"),
                *values_of(state.behavior),
            ),
        )


def too_steep(case: Case) -> Iterator[Diagnostic]:
    """KYB317: a behavior's curves need more tilt than the airframe allows: atan(a / g) for an
    acceleration a."""
    for vehicle, state, _, footprint in case.cached(footprints):
        limit, tilt = vehicle.airframe.tilt, atan(footprint.acceleration / GRAVITY)
        origin = footprint.origin
        if tilt <= limit + _ROUNDING:
            continue
        yield Diagnostic(
            "KYB317",
            f"`{state.name}` ({state.behavior.name}) is too sharp for `{vehicle.name}`",
            state.behavior.span,
            label=f"needs a tilt of {format_quantity(tilt, ANGLE)}",
            notes=(
                f"its airframe allows {format_quantity(limit, ANGLE)}",
                *((f"sharpest at {origin.sharpest}",) if origin is not None else ()),
            ),
            help="fly it more slowly, or make its curves wider",
            related=(*the_limit(vehicle, "tilt"), *values_of(state.behavior)),
        )


def beyond_the_vehicle(case: Case) -> Iterator[Diagnostic]:
    """KYB560: a driver or a tracker limits the tilt, the climb or the height to less than a
    behavior needs.

    The vehicle itself enforces the limits of some drivers, such as an AR.Drone's `altitude_max`. A
    behavior needs the tilt atan(a / g) for the acceleration a of its curves, and at least half of
    the `acceleration` with which it plans to fly to another place. To hold its position, every
    vehicle needs 0.2 m/s^2.
    """
    capped = {v.name: caps for v in case.plan.vehicles if (caps := list(_caps(v)))}
    most = _needs(case, capped) if capped else {}
    for name, caps in capped.items():
        for part, parameter, what in caps:
            cap = getattr(part.params, parameter)
            if cap is None or (name, what) not in most:
                continue
            need, state = most[name, what]
            if need <= cap + _ROUNDING:
                continue
            dimension = next(f.dimension for f in part.fields if f.name == parameter)
            assert dimension is not None
            needed = format_quantity(need, dimension)
            yield Diagnostic(
                "KYB560",
                f"`{parameter}` of `{part.name}` is too small for `{state.name}` of `{name}`",
                part.span_of(parameter),
                label=f"it needs {needed}",
                help=f"write at least `{parameter}: {needed}`",
                related=(Related(state.behavior.span, f"`{state.name}`"),),
            )


def _needs(case: Case, names: Iterable[str]) -> dict[tuple[str, str], tuple[float, StatePlan]]:
    """Return the most tilt, climb and height that the states of these vehicles need, and the state
    that needs it, by vehicle and `tilt`, `climb` or `height`. What exceeds the airframe itself is
    left out, because KYB314 and KYB317 report it."""
    most: dict[tuple[str, str], tuple[float, StatePlan]] = {}
    for vehicle in (case.plan.fleet[name] for name in names):
        flying = (s for s in vehicle.states.values() if any(AIR in leg for leg in s.legs))
        for state in flying:
            most.setdefault((vehicle.name, "tilt"), (atan(_HOLDING / GRAVITY), state))
    for vehicle, state, _, footprint in case.cached(footprints):
        is_vertical = any(GROUND in leg for leg in state.legs)
        way = (*footprint.points, *footprint.path)
        top, is_level = max((p[2] for p in way), default=-inf), len({p[:2] for p in way}) > 1
        planned = getattr(state.behavior.params, "acceleration", 0.0) if is_level else 0.0
        needs = {
            "tilt": atan(max(footprint.acceleration, 0.5 * planned) / GRAVITY),
            "climb": footprint.speed if is_vertical else 0.0,
            "height": top - vehicle.start[2],
        }
        for what, need in needs.items():
            able = getattr(vehicle.airframe, what, inf)
            if able + _ROUNDING >= need > most.get((vehicle.name, what), (0.0, state))[0]:
                most[vehicle.name, what] = need, state
    return most


def _caps(vehicle: VehiclePlan) -> Iterator[tuple[PartPlan, str, str]]:
    """Yield the parameters of the driver and the tracker that limit the vehicle to less than its
    airframe, each with what it limits."""
    tracker = vehicle.tracker
    yield from ((vehicle.driver, name, what) for what, name in vehicle.driver.cls.caps.items())
    own = (name for name in ("tilt", "climb") if tracker.is_written(name))
    yield from ((tracker, name, name) for name in own)


def another_body(case: Case) -> Iterator[Diagnostic]:
    """KYB561: a driver flies only one model, and the airframe is another: the gains and limits
    would be wrong (a warning in simulation, where any airframe can carry the model's computer)."""
    for vehicle in case.plan.vehicles:
        driver, body = vehicle.driver, vehicle.body
        for name, (least, most) in driver.cls.bodies.items():
            value = getattr(vehicle.airframe, name)
            if least <= value <= most:
                continue
            dimension = next(f.dimension for f in fields_of(Airframe) if f.name == name)
            assert dimension is not None
            own, low, high = (format_quantity(n, dimension) for n in (value, least, most))
            yield Diagnostic(
                "KYB561",
                f"the airframe of `{vehicle.name}` is not that of the driver `{driver.name}`",
                driver.span,
                label=f"flies vehicles with a {name} of {low} to {high}",
                notes=(f"the airframe's {name} is {own} ({body.span_of(name).at})",),
                help="use the airframe of the vehicle that flies, or another driver",
                related=(Related(vehicle.span, f"`{vehicle.name}`"),),
                severity=Severity.WARNING if driver.cls.simulated else Severity.ERROR,
            )
            break


class _Frame(NamedTuple):
    """An airframe, its name in messages, and the source location of that name."""

    name: str
    span: Span
    body: Body

    @property
    def airframe(self) -> Airframe:
        return self.body.airframe

    def place(self, *keys: str) -> Span:
        """Return the location of the first of `keys` that the file of the airframe's name contains;
        by default that of the name."""
        spans = (self.body.span_of(key) for key in keys if self.body.is_written(key))
        return next((s for s in spans if s.file == self.span.file), self.span)


def _airframes(case: Case) -> Iterator[_Frame]:
    """Yield every airframe that is flown, then those that the mission only describes."""
    flown = [_Frame(v.name, v.span, v.body) for v in case.plan.vehicles]
    yield from flown
    for body in case.plan.airframes:
        if all(body.airframe != frame.airframe for frame in flown):
            yield _Frame(body.name, body.span, body)


def _lifts(airframe: Airframe, payload: float = 0.0) -> bool:
    """Return whether the rotors can lift the airframe with a payload of this mass (kg) and have
    enough thrust left to steer."""
    return airframe.max_thrust >= _MIN_MAX_RATIO * (airframe.mass + payload) * GRAVITY


def _for_steering(airframe: Airframe) -> str:
    """Return a note on the largest weight that the rotors can carry."""
    most, carried = (
        format_quantity(float(f"{n:.3g}"), FORCE)
        for n in (airframe.max_thrust, airframe.max_thrust / _MIN_MAX_RATIO)
    )
    return f"its rotors lift {most}; with the 15 % needed for steering, they carry {carried}"


def _is_rigid(airframe: Airframe) -> bool:
    inertia = airframe.inertia
    return min(inertia) > 0.0 and 2.0 * max(inertia) <= sum(inertia) * (1.0 + _ROUNDING)


def too_heavy(case: Case) -> Iterator[Diagnostic]:
    """KYB318: four rotors at full thrust can't lift the airframe with 15 % to spare."""
    for frame in _airframes(case):
        if _lifts(frame.airframe):
            continue
        yield Diagnostic(
            "KYB318",
            f"`{frame.name}` is too heavy to fly",
            frame.place("thrust", "mass"),
            label=f"it weighs {format_quantity(frame.airframe.hover_thrust, FORCE)}",
            notes=(_for_steering(frame.airframe),),
            help=_meant_in_grams(frame.airframe),
        )


def _meant_in_grams(frame: Airframe) -> str:
    """Return a hint for an airframe that is too heavy to fly: to write grams, if it could fly when
    its mass is read as grams."""
    meant = replace(frame, mass=frame.mass / 1000.0)
    if _lifts(meant) and frame.mass >= 10.0:
        return f"write `mass: {frame.mass:g} g` if grams are meant"
    return "reduce its `mass`, or increase `thrust`, which is that of one rotor"


def implausible(case: Case) -> Iterator[Diagnostic]:
    """KYB420: the numbers of an airframe or a payload can't be right for a quadrotor, such as a
    diameter in millimetres or rotors that take seconds to respond.

    For an airframe, this checks disc loading, radius of gyration, torque ratio, rotor time and
    bumper; for a payload, its size below the airframe and its density
    (`kybflow.world.plausible`).
    """
    for doubt in case.cached(_implausible):
        if doubt.found.is_certain:
            yield _doubted("KYB420", "is impossible", "plausible", doubt)


def unusual(case: Case) -> Iterator[Diagnostic]:
    """KYB421: the numbers of an airframe or a payload are unusual for a quadrotor (a warning)."""
    for doubt in case.cached(_implausible):
        if not doubt.found.is_certain:
            told = _doubted("KYB421", "is unusual", "usual", doubt)
            yield replace(told, severity=Severity.WARNING)


class _Doubt(NamedTuple):
    """An implausible number. name: its owner. span: where it is written."""

    name: str
    found: Implausible
    span: Span


def _implausible(case: Case) -> Iterator[_Doubt]:
    for frame in _airframes(case):
        if not _lifts(frame.airframe) or not _is_rigid(frame.airframe):
            continue
        for found in of_airframe(frame.airframe):
            if any(map(frame.body.is_written, found.parameters)):
                yield _Doubt(f"`{frame.name}`", found, frame.place(*found.parameters))
    for vehicle in case.plan.vehicles:
        payload, airframe = vehicle.payload, vehicle.airframe
        if payload is not None and _lifts(airframe, payload.mass):
            for found in of_parcel(payload, airframe):
                span = vehicle.key_span("payload")
                yield _Doubt(f"the payload of `{vehicle.name}`", found, span)


def _doubted(code: str, what: str, better: str, doubt: _Doubt) -> Diagnostic:
    return Diagnostic(
        code,
        f"{doubt.name} {what}: {doubt.found.found}",
        doubt.span,
        notes=(f"{better}: {doubt.found.usual}",),
        help="check the number and its unit",
    )


def no_rigid_body(case: Case) -> Iterator[Diagnostic]:
    """KYB319: no body can have these moments of inertia: each must be at most the sum of the other
    two."""
    for frame in _airframes(case):
        if _is_rigid(frame.airframe):
            continue
        yield Diagnostic(
            "KYB319",
            f"no rigid body has the moments of inertia of `{frame.name}`",
            frame.place("inertia"),
            help="correct it: each moment is above zero and at most the sum of the other two",
        )


_PROBABLE_GRAMS = 10.0
"""From this mass on, kg, a number is probably meant in grams."""


def nothing_to_hold(case: Case) -> Iterator[Diagnostic]:
    """KYB395: a behavior loads or releases a payload, but its vehicle carries none."""
    for vehicle, state in _gripping(case):
        if vehicle.payload is None:
            yield Diagnostic(
                "KYB395",
                f"`{state.behavior.name}` needs a payload, but `{vehicle.name}` has none",
                state.behavior.span,
                help=f"give `{vehicle.name}` one: `payload: {{mass: 200 g, size: 10 cm}}`",
            )


def no_servo(case: Case) -> Iterator[Diagnostic]:
    """KYB396: a behavior loads or releases a payload, but the target's driver controls no servo."""
    for vehicle, state in _gripping(case):
        driver = vehicle.driver
        if vehicle.payload is not None and not driver.cls.grips:
            yield Diagnostic(
                "KYB396",
                f"`{state.behavior.name}` needs a servo, but the driver `{driver.name}` has none",
                state.behavior.span,
                label=f"`{vehicle.name}` has no servo",
                help="fly on a target whose driver has a servo, or remove the behavior",
            )


def too_heavy_to_lift(case: Case) -> Iterator[Diagnostic]:
    """KYB397: four rotors at full thrust can't lift the vehicle and its payload with 15 % to
    spare."""
    for vehicle in case.plan.vehicles:
        if vehicle.payload is None:
            continue
        weight = (vehicle.airframe.mass + vehicle.payload.mass) * GRAVITY
        if not _lifts(vehicle.airframe, vehicle.payload.mass):
            yield Diagnostic(
                "KYB397",
                f"`{vehicle.name}` is too heavy to fly with its payload",
                vehicle.key_span("payload"),
                label=f"vehicle and payload weigh {format_quantity(weight, FORCE)}",
                notes=(_for_steering(vehicle.airframe),),
                help=_lighter(vehicle, vehicle.payload),
            )


def _lighter(vehicle: VehiclePlan, payload: Parcel) -> str:
    """Return the help line: the number in grams if this was probably meant, or else the largest
    payload."""
    most = vehicle.airframe.max_thrust / (_MIN_MAX_RATIO * GRAVITY) - vehicle.airframe.mass
    if _PROBABLE_GRAMS <= payload.mass <= 1000.0 * most:
        return f"did you mean `mass: {payload.mass:g} g`?"
    if most <= 0.0:
        return "use another airframe: this one has no thrust to spare"
    grams = floor(most * 1000.0)
    return f"carry at most {format_quantity(grams / 1000.0, MASS)}, or use a stronger airframe"


def _gripping(case: Case) -> Iterator[tuple[VehiclePlan, StatePlan]]:
    """Yield every state whose behavior uses the payload servo."""
    for vehicle, state in case.states():
        if state.behavior.cls.grips:
            yield vehicle, state
