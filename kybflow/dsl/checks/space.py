"""Where a vehicle flies, and whether anything keeps it in the room: KYB311 to KYB313, KYB315,
KYB320 to KYB322 and KYB372."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import hypot
from typing import Any

from kybflow.core.geometry import ZERO, Vec3, distance
from kybflow.core.units import LENGTH, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.flow_places import entered_by_flows
from kybflow.dsl.checks.reachability import Entries, entries_of
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity, Span
from kybflow.dsl.plan import PartPlan, StatePlan, VehiclePlan
from kybflow.dsl.reading import nodes
from kybflow.parts import AIR, Footprint
from kybflow.world.shapes import Box

_ROUNDING = 1e-6


def starts_outside(case: Case) -> Iterator[Diagnostic]:
    """KYB311: a vehicle starts outside the fence."""
    fence = case.plan.fence
    for vehicle in case.plan.vehicles:
        if fence is None or fence.outside_by(vehicle.start) <= _ROUNDING:
            continue
        yield Diagnostic(
            "KYB311",
            f"`{vehicle.name}` starts outside the fence",
            vehicle.span_of("start", "at"),
            label=_beyond(fence, vehicle.start),
            notes=(extent(fence),),
            help="start inside the fence, or make the fence larger",
            related=the_fence(case),
        )


def starts_too_close(case: Case) -> Iterator[Diagnostic]:
    """KYB312: two vehicles start closer together than the larger one's diameter, or than the sum of
    their bumpers' radii.

    Each vehicle is reported only for the first one that it is too close to.
    """
    vehicles = list(case.plan.vehicles)
    for index, b in enumerate(vehicles):
        a = next((a for a in vehicles[:index] if distance(a.start, b.start) < _apart(a, b)), None)
        if a is None:
            continue
        near = format_quantity(distance(a.start, b.start), LENGTH)
        first, hint = a.span_of("start", "at"), "start them further apart"
        if (start := b.entry("start")) is None or start.inherited:
            hint = f"give `{b.name}` a start of its own, such as `start: {{at: [1, 0, 0]}}`"
        yield Diagnostic(
            "KYB312",
            f"`{b.name}` starts {near} from `{a.name}`",
            own_place(b, b.span_of("start", "at"), first),
            label=f"needs at least {format_quantity(_apart(a, b), LENGTH)}",
            notes=(f"`{a.name}` starts at {shown_point(a.start)} ({first.at})",),
            help=hint,
        )


def own_place(vehicle: VehiclePlan, span: Span, other: Span) -> Span:
    """Return where to report what is wrong with a vehicle: at `span`, or at its name if `span` is
    `other`, that of the vehicle that it is like."""
    return vehicle.span if span == other else span


def _apart(a: VehiclePlan, b: VehiclePlan) -> float:
    bumpers = (a.airframe.bumper or 0.0) + (b.airframe.bumper or 0.0)
    return max(a.airframe.diameter, b.airframe.diameter, bumpers)


def leaves_the_fence(case: Case) -> Iterator[Diagnostic]:
    """KYB313: a behavior leaves the fence, from an entry inside it that is known to occur."""
    fence = case.plan.fence
    for vehicle, state, entry, footprint in case.cached(footprints):
        if fence is None or (entry is not None and fence.outside_by(entry) > _ROUNDING):
            continue
        far = max(footprint.points, key=fence.outside_by, default=vehicle.start)
        if fence.outside_by(far) > _ROUNDING:
            yield Diagnostic(
                "KYB313",
                f"`{state.name}` ({state.behavior.name}) leaves the fence",
                aim_of(state, footprint),
                label=_beyond(fence, far),
                notes=(extent(fence), *footprint.line_of(far)),
                help="stay inside the fence, or make the fence larger",
                related=(*the_fence(case), *values_of(state.behavior)),
            )


def held_back(case: Case) -> Iterator[Diagnostic]:
    """KYB320: a behavior stays inside the fence, but a processor keeps its setpoint from the
    goal."""
    fence = case.plan.fence
    if fence is None:
        return
    for vehicle, state, entry, footprint in case.cached(footprints):
        inside = [p for p in footprint.points if fence.outside_by(p) <= _ROUNDING]
        for part in vehicle.processors:
            room = part.cls.keeps_inside(part.params, fence)
            far = max(inside, key=room.outside_by, default=None) if room is not None else None
            if room is None or far is None or room.outside_by(far) <= _ROUNDING:
                continue
            if entry is not None and room.outside_by(entry) > _ROUNDING:
                continue
            yield Diagnostic(
                "KYB320",
                f"`{part.alias}` keeps `{vehicle.name}` from the goal of `{state.name}`",
                aim_of(state, footprint),
                label=f"{_beyond(room, far)} what `{part.alias}` allows",
                notes=(
                    f"`{part.alias}` allows {shown_point(room.low)} to {shown_point(room.high)}",
                    *footprint.line_of(far),
                ),
                help=f"stay further away from the fence, or reduce the margin of `{part.alias}`",
                related=(
                    *the_part(vehicle, part),
                    *the_fence(case),
                    *values_of(state.behavior),
                ),
            )


def refuses(case: Case) -> Iterator[Diagnostic]:
    """KYB372: a behavior would refuse to start where a transition leads to it, for example because
    a trajectory begins too far away."""
    for _, state, entries in _entered(case):
        for entry in entries.points:
            reason = state.behavior.cls.refusal(state.behavior.params, entry)
            if reason is not None:
                yield Diagnostic(
                    "KYB372",
                    f"`{state.name}` ({state.behavior.name}) would refuse to start",
                    state.behavior.span,
                    label=reason,
                    notes=(f"entered at {shown_point(entry)}",),
                    help="first lead the vehicle to where it can start",
                )
                break


def undecided(case: Case) -> Iterator[Diagnostic]:
    """KYB315: a behavior's path is unknown before the flight, because it can be entered from
    anywhere. The fence processor and supervisor still protect it."""
    fence, obstacles = case.plan.fence, case.plan.obstacles
    if fence is None and not obstacles:
        return
    bounds = "stays inside the fence" if fence is not None else "stays clear of the obstacles"
    (ax, ay, az), (bx, by, bz) = fence or Box(ZERO, ZERO)
    middle = ((ax + bx) / 2, (ay + by) / 2, (az + bz) / 2)
    for _, state, entries in _entered(case):
        if entries.known or state.footprint(None) is not None:
            continue
        footprint = state.footprint(middle)
        if footprint is not None and any(p[:2] != middle[:2] for p in footprint.points):
            yield Diagnostic(
                "KYB315",
                f"can't tell whether `{state.name}` {bounds}",
                state.behavior.span,
                label="its path depends on where it begins",
                notes=("where it begins is unknown before the flight",),
                help="enter it from a known place, for example after a `fly_to`",
                severity=Severity.WARNING,
            )


def _entered(case: Case) -> Iterator[tuple[VehiclePlan, StatePlan, Entries]]:
    """Yield every reachable state with its entry positions."""
    for vehicle in case.plan.vehicles:
        for name, entries in entries_of(vehicle).items():
            yield vehicle, vehicle.states[name], entries


def footprints(case: Case) -> Iterator[tuple[VehiclePlan, StatePlan, Vec3 | None, Footprint]]:
    """Yield the footprint of every reachable state for each of its entry positions. If there are
    obstacles or objects, include the entries through flows."""
    solid = case.plan.obstacles or case.plan.objects
    for vehicle, state, entries in _entered(case):
        for entry in entries.candidates():
            footprint = state.footprint(entry)
            if footprint is not None:
                yield vehicle, state, entry, footprint
    for vehicle, name, point in entered_by_flows(case) if solid else ():
        footprint = vehicle.states[name].footprint(point)
        if footprint is not None:
            yield vehicle, vehicle.states[name], point, footprint


def _beyond(fence: Box, point: Vec3) -> str:
    return f"{shown_point(point)} is {format_quantity(fence.outside_by(point), LENGTH)} outside"


def extent(fence: Box) -> str:
    """Return the extent of the fence as text for a note."""
    return f"the fence goes from {shown_point(fence.low)} to {shown_point(fence.high)}"


def the_fence(case: Case) -> tuple[Related, ...]:
    """Return the source location of the fence, if the mission itself defines it."""
    world = case.plan.world
    return (Related(world.key_span("fence"), "the fence"),) if world.is_written("fence") else ()


def the_time_limit(case: Case) -> tuple[Related, ...]:
    """Return the source location of the time limit, if the mission itself defines it."""
    plan = case.plan
    is_own = plan.is_written("time_limit")
    return (Related(plan.key_span("time_limit"), "the mission's time limit"),) if is_own else ()


def the_limit(vehicle: VehiclePlan, name: str) -> tuple[Related, ...]:
    """Return the source location of an airframe's limit, if the mission itself defines it."""
    span = vehicle.body.span_of(name)
    is_own = vehicle.body.is_written(name) and span.file == vehicle.span.file
    return (Related(span, f"the {name} of its airframe"),) if is_own else ()


def the_cameras(vehicle: VehiclePlan) -> tuple[Related, ...]:
    """Return the source locations of the vehicle's cameras that the mission itself describes."""
    own = (use for use in vehicle.body.cameras if use.span.file == vehicle.span.file)
    return tuple(Related(use.span, f"its camera `{use.name}`") for use in own)


def the_part(vehicle: VehiclePlan, part: PartPlan) -> tuple[Related, ...]:
    """Return the source location of a part, if the mission itself lists it. A part that every
    vehicle has is where the vehicle is."""
    is_own = part.span.file == vehicle.span.file and part.span != vehicle.span
    return (Related(part.span, f"`{part.alias}`"),) if is_own else ()


def the_loop(vehicle: VehiclePlan) -> tuple[Related, ...]:
    """Return the source locations of the parameters with which the mission changes the driver's
    on-board loop, or the rate or the latency of its poses."""
    driver, frame = vehicle.driver, vehicle.airframe
    return _changes(driver, lambda params: driver.cls.inner_loop(params, frame))


def the_measurements(vehicle: VehiclePlan) -> tuple[Related, ...]:
    """Return those of `the_loop`, and of the errors of poses and of positions."""
    cls, own = vehicle.driver.cls, vehicle.driver
    more = _changes(own, lambda params: (cls.pose_error(params), cls.positions(params)))
    return (*the_loop(vehicle), *more)


def _changes(driver: PartPlan, of: Callable[[Any], object]) -> tuple[Related, ...]:
    """Return the source locations of the parameters that change what `of` returns for them."""
    own, changed = of(driver.params), []
    for field in driver.fields:
        if driver.is_written(field.key) and not field.required:
            usual = replace(driver.params, **{field.name: field.default})
            if of(usual) != own:
                changed.append(Related(driver.span_of(field.key), f"the driver's `{field.key}`"))
    return tuple(changed)


def values_of(part: PartPlan) -> tuple[Related, ...]:
    """Return the source locations of the mission parameters whose values a part uses."""
    given = {name: e.value.span.given for name, e in nodes.entries_of(part.source.node).items()}
    return tuple(Related(span, f"its `{name}`") for name, span in given.items() if span)


def shown_point(point: Vec3) -> str:
    """Return a point as text for a report, without -0 or 1e-17."""
    return "[" + ", ".join(f"{round(c, 6) + 0.0:.4g}" for c in point) + "] m"


def unfenced(case: Case) -> Iterator[Diagnostic]:
    """KYB321: there is a fence, but no processor of a vehicle keeps its setpoints inside; the
    supervisor only lands it once it is outside."""
    fence = case.plan.fence
    for vehicle in case.plan.vehicles if fence is not None else ():
        boxes = (p.cls.keeps_inside(p.params, fence) for p in vehicle.processors)
        if any(box is not None for box in boxes):
            continue
        yield Diagnostic(
            "KYB321",
            f"no processor keeps `{vehicle.name}` inside the fence",
            vehicle.span,
            label="lands only once it is outside",
            help="add `fence` to its processors",
            severity=Severity.WARNING,
        )


def without_a_fence(case: Case) -> Iterator[Diagnostic]:
    """KYB322: the mission has no fence, so neither the supervisor nor the processor `fence`
    protects a flying vehicle. It is reported once, for the first one.

    A fence is also useful outdoors: outside it the failsafe lands the vehicle.
    """
    if case.plan.fence is not None:
        return
    flying = [
        v
        for v in case.plan.vehicles
        if any(AIR in leg for state in v.states.values() for leg in state.behavior.cls.flight)
    ]
    if flying:
        others = ", ".join(f"`{v.name}`" for v in flying[1:])
        yield Diagnostic(
            "KYB322",
            f"nothing keeps `{flying[0].name}` inside the room: the mission has no fence",
            flying[0].span,
            label="may fly anywhere",
            notes=(f"the same is true of {others}",) if others else (),
            help="write the bounds under `world`: `fence: {from: [-2, -2, 0], to: [2, 2, 2.5]}`",
            severity=Severity.WARNING,
        )


_SAME_PLACE = 1e-6


def aim_of(state: StatePlan, footprint: Footprint) -> Span:
    """Return the source location of the target to which the behavior flies, if the mission gives
    one, or else of the behavior's name."""
    part = state.behavior
    way = (*footprint.points, *footprint.path, *([footprint.exit] if footprint.exit else []))
    for field in part.fields:
        if field.dimension is not LENGTH or field.shape not in ("vector", "path"):
            continue
        value = getattr(part.params, field.name)
        if not part.is_written(field.name) or value is None:
            continue
        points = (value,) if field.shape == "vector" else value
        # the centre of a circle is no target: the path does not lead through, above or below it
        if any(hypot(p[0] - w[0], p[1] - w[1]) < _SAME_PLACE for p in points for w in way):
            return part.span_of(field.name)
    return part.span
