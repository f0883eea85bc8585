"""Obstacles, and where vehicles start, fly, land and have their homes: KYB340 to KYB343, KYB345,
KYB453, KYB546, KYB558, KYB559 and KYB563."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import hypot, inf
from typing import NamedTuple, Protocol

from kybflow.core.geometry import Vec3, distance
from kybflow.core.units import LENGTH, format_quantity
from kybflow.dsl.checks.actions import actions_of, sets_of
from kybflow.dsl.checks.case import WORDS, Case, taken_names
from kybflow.dsl.checks.space import (
    aim_of,
    extent,
    footprints,
    shown_point,
    the_fence,
    the_part,
    values_of,
)
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity
from kybflow.dsl.plan import PartPlan, StatePlan, VehiclePlan
from kybflow.parts import AIR, GROUND, Footprint
from kybflow.world.shapes import Box, Cylinder, Plane, Scanned, Shape, Sphere

_ROUNDING = 1e-6
_START_HEIGHT = 0.05
"""Accepted height of a start above the ground, m, because the frame's origin is above its legs."""
_LANDING_HEIGHT = 0.15
"""Accepted height of the end of a landing, m, because there may be a pad that is no obstacle."""
_TOUCH_DEPTH = 0.02
"""Depth inside an obstacle up to which a vehicle may intend to touch it, m."""
_CLAMP_DISTANCE = 0.02
"""How far from its goal a processor may stop a vehicle without putting the goal out of reach, m."""
_STEPS = 60
_RATIO = 0.6180339887498949  # of the golden section


def starts_inside(case: Case) -> Iterator[Diagnostic]:
    """KYB340: a vehicle starts inside an obstacle or touches it. The vehicle may stand on an
    obstacle."""
    for vehicle in case.plan.vehicles:
        for obstacle, shape in case.plan.obstacles.items():
            if not _starts_in(shape, vehicle):
                continue
            room = shape.distance(vehicle.start)
            yield Diagnostic(
                "KYB340",
                f"`{vehicle.name}` starts in the obstacle `{obstacle}`",
                vehicle.span_of("start", "at"),
                label=room_needed(vehicle, room),
                notes=(_stands(case, obstacle),),
                help="move the start further away",
            )
            break


def named_like_a_vehicle(case: Case) -> Iterator[Diagnostic]:
    """KYB559: an obstacle has the name of a vehicle or a group, so that a collision with it could
    not be told from one with the vehicle, or a reserved word, which means something else in
    `distance` and `separation`."""
    taken = taken_names(case.plan) | dict.fromkeys(WORDS, "a reserved word")
    for obstacle in case.plan.world.obstacles:
        if obstacle.name in taken:
            message = f"an obstacle can't be called `{obstacle.name}`"
            hint = "give it another name"
            yield Diagnostic("KYB559", message, obstacle.span, taken[obstacle.name], help=hint)


def below_the_ground(case: Case) -> Iterator[Diagnostic]:
    """KYB563: an obstacle is below the ground, z = 0, where nothing flies into it (a warning)."""
    for obstacle in case.plan.world.obstacles:
        shape = case.plan.obstacles.get(obstacle.name)
        ball = obstacle.moving_sphere
        top = inf if shape is None else _highest(shape)
        if ball is not None:
            top = max(z for _, _, z in ball.along) + ball.radius
        if top <= 0.0:
            yield Diagnostic(
                "KYB563",
                f"the obstacle `{obstacle.name}` is below the ground",
                obstacle.span,
                label=f"its top is at z = {format_quantity(top, LENGTH)}",
                help="raise it, or remove it",
                severity=Severity.WARNING,
            )


def _highest(shape: Shape) -> float:
    """Return the height of the highest point of a bounded shape; infinite for others."""
    match shape:
        case Box(_, high):
            return high[2]
        case Cylinder(at, _, height):
            return at[2] + height
        case Sphere(at, radius):
            return at[2] + radius
    return inf


def starts_in_the_air(case: Case) -> Iterator[Diagnostic]:
    """KYB345: a vehicle starts neither on the ground nor on an obstacle. In the simulator it falls
    until its take-off catches it; a real one can't be placed there."""
    for vehicle in case.plan.vehicles:
        if any(_starts_in(shape, vehicle) for shape in case.plan.obstacles.values()):
            continue
        below, what = _support(case, vehicle.start)
        above = vehicle.start[2] - below
        if abs(above) > _START_HEIGHT + _ROUNDING:
            side = "above" if above > 0 else "below"
            yield Diagnostic(
                "KYB345",
                f"`{vehicle.name}` starts in the air or below the ground",
                vehicle.span_of("start", "at"),
                label=f"{format_quantity(abs(above), LENGTH)} {side} {what}",
                help=f"start at {format_quantity(below, LENGTH)} and climb with `take_off`",
                severity=Severity.WARNING,
            )


def _support(case: Case, place: Vec3) -> tuple[float, str]:
    """Return the height and name of what is below a position: an obstacle or the ground."""
    below, what = 0.0, "the ground"
    for name, shape in case.plan.obstacles.items():
        top, inside = _top(shape, place)
        if inside >= 0.0 and below < top <= place[2] + _ROUNDING:
            below, what = top, f"`{name}`"
    return below, what


def lands_in_the_air(case: Case) -> Iterator[Diagnostic]:
    """KYB453: a landing ends more than 15 cm above whatever is below it (a warning)."""
    for vehicle, state, _, footprint in case.cached(footprints):
        legs = state.behavior.cls.flight
        if footprint.exit is None or not any((leg.start, leg.end) == (AIR, GROUND) for leg in legs):
            continue
        below, what = _support(case, footprint.exit)
        above = footprint.exit[2] - below
        if above > _LANDING_HEIGHT:
            yield Diagnostic(
                "KYB453",
                f"`{state.name}` of `{vehicle.name}` lands in the air",
                aim_of(state, footprint),
                label=f"{format_quantity(above, LENGTH)} above {what}",
                help=f"land at a height of {format_quantity(below, LENGTH)}",
                severity=Severity.WARNING,
            )


def flies_into(case: Case) -> Iterator[Diagnostic]:
    """KYB341: a behavior flies its vehicle into an obstacle, from an entry that is known to occur.

    If the behavior's path is known, it must stay further from every obstacle than the length of the
    vehicle's arm. Exceptions are an obstacle on which the vehicle stands before a take-off or after
    a landing, and one that is already too close where the behavior is entered. If a processor leads
    the vehicle around obstacles, only the points of the path must be clear.
    """
    obstacles = _kept_from(case)
    for vehicle, state, entry, footprint in case.cached(footprints) if obstacles else ():
        path, arm = path_of(footprint), vehicle.airframe.arm - _ROUNDING
        for obstacle, shape in obstacles.items():
            if entry is not None and shape.distance(entry) < arm:
                continue
            room, point = nearest(path, shape, arm)
            around = any(processor.cls.goes_round for processor in vehicle.processors)
            if room < arm and around and not is_vertical(state):
                room, point = min((shape.distance(p), p) for p in path)
            if room >= arm or (is_vertical(state) and _carries(shape, path[0], vehicle)):
                continue
            way_out = f"fly around `{obstacle}`, or further away from it"
            if room > -_TOUCH_DEPTH:
                way_out += ", or write `contact: allowed` for the obstacle"
            yield Diagnostic(
                "KYB341",
                f"`{state.name}` ({state.behavior.name}) flies into `{obstacle}`",
                aim_of(state, footprint),
                label=f"at {shown_point(point)}, {room_needed(vehicle, room)}",
                notes=(_stands(case, obstacle), *footprint.line_of(point)),
                help=way_out,
                related=values_of(state.behavior),
            )
            break


def kept_from_goals(case: Case) -> Iterator[Diagnostic]:
    """KYB558: a behavior waits until the vehicle reaches a place that is closer to an obstacle than
    a processor lets it go, so it waits in vain.

    Processors that the mission switches or retunes in flight are not checked.
    """
    obstacles = _kept_from(case)
    guards = keepers(case) if obstacles else {}
    for vehicle, state, _, footprint in case.cached(footprints) if obstacles else ():
        if not footprint.goals or is_vertical(state):
            continue
        for part, keep in guards.get(vehicle.name, ()):
            found = out_of_reach(footprint, keep, obstacles)
            if found is None or found.room < vehicle.airframe.arm - _ROUNDING:
                continue  # reported as KYB341
            where = f"{shown_point(found.goal)} is {format_quantity(found.room, LENGTH)}"
            yield Diagnostic(
                "KYB558",
                f"`{part.alias}` keeps `{vehicle.name}` from the goal of `{state.name}`",
                aim_of(state, footprint),
                label=f"{where} from `{found.obstacle}`",
                notes=(
                    f"`{part.alias}` keeps it at least {format_quantity(keep, LENGTH)} away",
                    _stands(case, found.obstacle),
                    *footprint.line_of(found.goal),
                ),
                help="move the goal further away, or reduce the processor's distance",
                related=(*the_part(vehicle, part), *values_of(state.behavior)),
            )
            break


class _OutOfReach(NamedTuple):
    """A goal that is too close to an obstacle. room: its distance from the obstacle, m."""

    goal: Vec3
    room: float
    obstacle: str


def out_of_reach(
    footprint: Footprint, keep: float, obstacles: Mapping[str, _Solid]
) -> _OutOfReach | None:
    """Return the first goal that is unreachable for a vehicle kept `keep` metres away from
    obstacles, or None."""
    for goal, near in footprint.goals:
        for name, shape in obstacles.items():
            room = shape.distance(goal)
            if keep - room > max(near, _CLAMP_DISTANCE):
                return _OutOfReach(goal, room, name)
    return None


def keepers(case: Case) -> Mapping[str, Sequence[tuple[PartPlan, float]]]:
    """Return for each vehicle its processors that always keep it away from obstacles, each with the
    distance that it keeps, m."""
    switched = [*actions_of(case, "enable"), *actions_of(case, "disable")]
    names = [action.value for action in switched]
    names += [name.text for name, _ in sets_of(case)]
    changed = {name.split(".")[2] for name in names if ".processors." in name}
    return {
        vehicle.name: [
            (part, keep)
            for part in vehicle.processors
            if (keep := part.cls.keeps_off(part.params, vehicle.airframe)) > 0.0
            and part.alias not in changed
        ]
        for vehicle in case.plan.vehicles
    }


def scanned_elsewhere(case: Case) -> Iterator[Diagnostic]:
    """KYB546: no point of a scan or a map is inside the fence: its unit or its origin is probably
    wrong (a warning)."""
    fence = case.plan.fence
    for obstacle in case.plan.world.obstacles:
        if fence is None or not isinstance(obstacle.shape, Scanned):
            continue
        points = obstacle.shape.array
        axes = slice(points.shape[1])
        inside = (points >= fence.low[axes]) & (points <= fence.high[axes])
        if not inside.all(axis=1).any():
            low, high = obstacle.shape.bounds
            yield Diagnostic(
                "KYB546",
                f"no point of `{obstacle.name}` is inside the fence",
                obstacle.span_of("occupancy" if obstacle.occupancy else "point_cloud", "file"),
                label=f"it reaches from {shown_point(low)} to {shown_point(high)}",
                notes=(extent(fence),),
                help="correct its origin or its unit",
                severity=Severity.WARNING,
            )


def _kept_from(case: Case) -> Mapping[str, Shape]:
    """Return the obstacles that no vehicle may touch, by name."""
    plan = case.plan
    return {name: shape for name, shape in plan.obstacles.items() if name not in plan.touchable}


def may_fly_into(case: Case) -> Iterator[Diagnostic]:
    """KYB342: it is unknown whether a behavior stays clear of an obstacle, because only the bounds
    of its path are known and the obstacle is inside them."""
    obstacles = _kept_from(case)
    for vehicle, state, _, footprint in case.cached(footprints) if obstacles else ():
        if path_of(footprint) or not footprint.points:
            continue
        low, high = (tuple(map(end, zip(*footprint.points, strict=True))) for end in (min, max))
        centre: Vec3 = tuple((a + b) / 2 for a, b in zip(low, high, strict=True))
        reach = distance(low, high) / 2 + vehicle.airframe.arm
        near = (name for name, shape in obstacles.items() if shape.distance(centre) < reach)
        obstacle = next(near, None)
        if obstacle is not None:
            yield Diagnostic(
                "KYB342",
                f"can't tell whether `{state.name}` stays clear of `{obstacle}`",
                state.behavior.span,
                label="only the bounds of its path are known",
                notes=(_stands(case, obstacle),),
                help=f"stay further away from `{obstacle}`, unless the path is surely clear",
                severity=Severity.WARNING,
            )


def homes(case: Case) -> Iterator[Diagnostic]:
    """KYB343: a vehicle's home, where `go_home` flies and the failsafe may land, is outside the
    fence or in an obstacle."""
    fence = case.plan.fence
    for vehicle in case.plan.vehicles:
        home, label, note = vehicle.home, "", ""
        if home is None:
            continue
        related: tuple[Related, ...] = ()
        if fence is not None and fence.outside_by(home) > _ROUNDING:
            beyond = format_quantity(fence.outside_by(home), LENGTH)
            label, note = f"{shown_point(home)} is {beyond} outside", extent(fence)
            related = the_fence(case)
        for obstacle, shape in case.plan.obstacles.items():
            room = shape.distance(home)
            if room < vehicle.airframe.arm - _ROUNDING and not _carries(shape, home, vehicle):
                label, note = room_needed(vehicle, room), _stands(case, obstacle)
        if label:
            yield Diagnostic(
                "KYB343",
                f"`{vehicle.name}` can't fly home",
                vehicle.span_of("home"),
                label=label,
                notes=(note,),
                help="choose another `home`",
                related=related,
            )


def path_of(footprint: Footprint) -> tuple[Vec3, ...]:
    """Return the points of the path, joined by straight lines; empty if the path is unknown. Bounds
    that consist of two points are a straight line."""
    return footprint.path or (footprint.points if len(footprint.points) <= 2 else ())


class _Solid(Protocol):
    """A convex solid or a scan."""

    def distance(self, p: Vec3) -> float: ...


def nearest(path: tuple[Vec3, ...], shape: _Solid, enough: float) -> tuple[float, Vec3]:
    """Return the least distance of a path from a shape, and the position where it occurs. Lines
    that keep at least `enough` away are not examined closely."""
    rooms = [(shape.distance(p), p) for p in path]
    found = min(rooms, default=(inf, (0.0, 0.0, 0.0)))
    for (room, a), (other, b) in pairwise(rooms):
        length, least = distance(a, b), min(enough, found[0])
        if (room + other - length) / 2 >= least:
            continue
        if shape.distance(_between(a, b, 0.5)) - length / 2 < least:
            found = min(found, _on_line(a, b, shape, enough))
    return found


def _on_line(a: Vec3, b: Vec3, shape: _Solid, enough: float) -> tuple[float, Vec3]:
    """Return the least distance of a line from a shape, and where it occurs. Uses golden-section
    search, because a convex solid has a single minimum along a line; stops once the line is certain
    to keep `enough` away."""
    if isinstance(shape, Scanned):
        return shape.nearest_on(a, b)
    low, high, length = 0.0, 1.0, distance(a, b)
    for _ in range(_STEPS):
        left, right = high - _RATIO * (high - low), low + _RATIO * (high - low)
        near, far = shape.distance(_between(a, b, left)), shape.distance(_between(a, b, right))
        if min(near, far) - (high - low) * length >= enough:
            break
        if near <= far:
            high = right
        else:
            low = left
    point = _between(a, b, low)
    return shape.distance(point), point


def _between(a: Vec3, b: Vec3, part: float) -> Vec3:
    (ax, ay, az), (bx, by, bz) = a, b
    return ax + part * (bx - ax), ay + part * (by - ay), az + part * (bz - az)


def is_vertical(state: StatePlan) -> bool:
    """Return whether the behavior is a take-off or a landing."""
    return any(GROUND in leg and leg.start is not leg.end for leg in state.behavior.cls.flight)


def _starts_in(shape: Shape, vehicle: VehiclePlan) -> bool:
    room = shape.distance(vehicle.start)
    too_close = room < vehicle.airframe.arm - _ROUNDING
    return too_close and not _carries(shape, vehicle.start, vehicle)


def _carries(shape: Shape, point: Vec3, vehicle: VehiclePlan) -> bool:
    """Return whether the whole vehicle is over the obstacle, at or above its top."""
    top, inside = _top(shape, point)
    return point[2] >= top - _ROUNDING and inside >= vehicle.airframe.arm - _ROUNDING


def _top(shape: Shape, point: Vec3) -> tuple[float, float]:
    """Return (height of the obstacle's level top, distance of the point from the top's edge as seen
    from above). The distance is positive above the top. For an obstacle without a level top, return
    (inf, -inf)."""
    x, y, _ = point
    match shape:
        case Box(low, high):
            top = high[2]
            inside = min(x - low[0], high[0] - x, y - low[1], high[1] - y)
        case Cylinder(at, radius, height):
            top = at[2] + height
            inside = radius - hypot(x - at[0], y - at[1])
        case Plane(at, facing) if facing[2] >= 1.0 - _ROUNDING:
            top, inside = at[2], inf
        case _:
            return inf, -inf
    return top, inside


def room_needed(vehicle: VehiclePlan, room: float, needs: float | None = None) -> str:
    """Return in words how close the vehicle comes and how much room it needs: `needs`, or that of
    its arms, metres."""
    where = f"{format_quantity(-room, LENGTH)} inside" if room < 0 else "too close"
    reach = vehicle.airframe.arm if needs is None else needs
    return f"{where}; it needs {format_quantity(reach, LENGTH)} around it"


def _stands(case: Case, name: str) -> str:
    obstacle = next(o for o in case.plan.world.obstacles if o.name == name)
    return f"`{name}` is at {obstacle.span.at}"
