"""Objects of the world: their joints, where they are, and the simulators that move them: KYB580 to
KYB587 and KYB594."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, product
from math import ceil, inf, prod
from typing import NamedTuple

from kybflow.core.geometry import UP, ZERO, Vec3, add, distance, dot, rotate, scale, sub
from kybflow.core.text import did_you_mean
from kybflow.core.units import ANGLE, FORCE, LENGTH, format_quantity
from kybflow.dsl.checks.case import Case, taken_names
from kybflow.dsl.checks.obstacles import (
    is_vertical,
    keepers,
    nearest,
    out_of_reach,
    path_of,
    room_needed,
)
from kybflow.dsl.checks.space import aim_of, footprints, shown_point, values_of
from kybflow.dsl.diagnostics import Diagnostic, Severity
from kybflow.dsl.plan import PartPlan, StatePlan
from kybflow.dsl.world import ObjectParams
from kybflow.world.objects import (
    Face,
    Placement,
    SlideJoint,
    TurnedBox,
    TurnJoint,
    WorldObject,
    base_of,
    corners,
    distance_to,
    face_of,
    placements,
    solids_of,
)
from kybflow.world.vehicle_context import LEGS

LEAST_PHYSICS = 500.0
"""Rate of the physics below which contacts are wrong, Hz: at 250 Hz a pushed bar ended 26 cm
off."""
_DEPTH = 1e-6
_BEFORE = 0.02
"""Distance (m) before a surface that must be free."""
_GAP, _MOST_PLACES, _STEP = 0.05, 600, 0.01
"""How far apart, m, the places are at which an object is looked at along its joints, unless there
would be more than so many; and the least step along a path, m."""
_DROP = 0.15
"""How far an object may fall at the start, m: heights are estimated, and the floor is not at
zero."""


def stands_on_nothing(case: Case) -> Iterator[Diagnostic]:
    """KYB580: an object is on an object that doesn't exist, or on itself through others."""
    every = {one.name: one for one in case.plan.world.objects}
    for name, one in every.items():
        below = one.on
        for _ in every:
            below = every[below].on if below in every and below != name else below
        if one.on is not None and one.on not in every:
            hint = did_you_mean(one.on, every) or "name another object, or leave `on` out"
            message = f"`{name}` is on `{one.on}`, which is no object"
            yield Diagnostic("KYB580", message, one.span_of("on"), label="unknown", help=hint)
        elif below == name:
            through = "" if one.on == name else f", through `{one.on}`"
            message = f"`{name}` is on itself{through}"
            hint = "leave `on` out of one of them"
            yield Diagnostic("KYB580", message, one.span_of("on"), help=hint)


def moves_nowhere(case: Case) -> Iterator[Diagnostic]:
    """KYB581: the joint of an object can't move it: there are two joints, its direction is zero,
    its stops are in the wrong order, or it starts beyond one of them. Or a surface faces
    nowhere, or into the object's own box."""
    for one in case.plan.world.objects:
        for keys, what, hint in _flaws(one):
            message = f"`{one.name}` {what}"
            yield Diagnostic("KYB581", message, one.span_of(*keys), help=hint)
        for surface in one.surfaces:
            if not any(surface.facing):
                message = f"the surface `{surface.name}` of `{one.name}` faces nowhere"
                hint = "`facing` is a direction, like `[-1, 0, 0]`"
                yield Diagnostic("KYB581", message, surface.span_of("facing"), help=hint)
        for made, given in zip(one.made.surfaces, one.surfaces, strict=True):
            before = add(made.at, scale(made.outward, _BEFORE))
            if all(abs(at) < 0.5 * size for at, size in zip(before, one.made.size, strict=True)):
                message = f"the surface `{made.name}` of `{one.name}` faces into its box"
                hint = "turn `facing` round, or move `at` to the box's side"
                yield Diagnostic("KYB581", message, given.span_of("facing", "at"), help=hint)


def _flaws(one: ObjectParams) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """Yield what is wrong with the joint of an object: keys, in words, and a way out."""
    joint = one.made.joint
    if one.slide is not None and one.turn is not None:
        hint = "put one of them on an object of its own, and this one `on` that"
        yield ("turn",), "has two joints", hint
    elif joint is not None:
        turns = isinstance(joint, TurnJoint)
        key, direction = ("turn", "about") if turns else ("slide", "along")
        dimension, numbers = ANGLE if turns else LENGTH, (joint.low, joint.start, joint.high)
        low, start, high = (format_quantity(q, dimension) for q in numbers)
        if not any(one.made.axis):
            hint = f"`{direction}` is a direction, like `[0, 0, 1]`"
            yield (key, direction), "has a joint without a direction", hint
        if joint.low >= joint.high:
            what = f"has its stops in the wrong order: from {low} to {high}"
            yield (key, "from"), what, "`from` must be below `to`"
        elif not joint.low <= joint.start <= joint.high:
            hint = f"`start` must be from {low} to {high}"
            yield (key, "start"), f"starts beyond its stops, at {start}", hint


def named_like_something_else(case: Case) -> Iterator[Diagnostic]:
    """KYB582: an object has the name of a vehicle, a group or an obstacle, so that a condition or a
    contact could mean either."""
    obstacles = (one.name for one in case.plan.world.obstacles)
    taken = taken_names(case.plan, (obstacles, "an obstacle"))
    for one in case.plan.world.objects:
        if one.name in taken:
            message = f"an object can't be called `{one.name}`"
            hint = "give it another name"
            yield Diagnostic("KYB582", message, one.span, taken[one.name], help=hint)


def nothing_moves_it(case: Case) -> Iterator[Diagnostic]:
    """KYB583: the mission has objects, but the simulator has none, or its physics are too slow for
    contacts, which need 500 Hz."""
    plan = case.plan
    for vehicle in plan.vehicles if plan.objects else ():
        driver = vehicle.driver
        if not driver.cls.simulated:
            continue
        rate = driver.cls.step_rate(driver.params)
        if not driver.cls.moves_objects:
            message = f"`{driver.name}` can't simulate the objects of the world"
            hint = "fly on the target `sim`, or take `objects` out of `world`"
            yield Diagnostic("KYB583", message, driver.span, help=hint)
        elif rate is not None and rate < LEAST_PHYSICS:
            message = f"physics at {rate:g} Hz are too slow for objects"
            hint = f"write `physics: {LEAST_PHYSICS:g} Hz`"
            yield Diagnostic("KYB583", message, driver.span_of("physics"), help=hint)


def overlaps_at_the_start(case: Case) -> Iterator[Diagnostic]:
    """KYB584: an object is in the floor, or in a vehicle, when the mission begins."""
    plan, solids = case.plan, case.cached(_solids)
    for one, (made, place) in zip(plan.world.objects, solids, strict=False):
        lowest = min(corner[2] for corner in corners(made, place))
        if lowest < -LEGS - _DEPTH:
            message = f"`{one.name}` is in the floor, by {format_quantity(-LEGS - lowest, LENGTH)}"
            hint = (
                f"raise it: the floor is {format_quantity(LEGS, LENGTH)} below zero, the height of"
                " a vehicle that stands"
            )
            yield Diagnostic("KYB584", message, one.span_of("at"), help=hint)
        for vehicle in plan.vehicles:
            room = distance_to(made, place, vehicle.start)
            reach = vehicle.airframe.bumper or vehicle.airframe.arm
            if room < reach:
                message = f"`{vehicle.name}` starts in the object `{one.name}`"
                where, label = vehicle.span_of("start", "at"), room_needed(vehicle, room, reach)
                hint = "move the start further away"
                yield Diagnostic("KYB584", message, where, label=label, help=hint)


class _Solid(NamedTuple):
    """An object where the mission declares it."""

    made: WorldObject
    place: Placement

    def distance(self, p: Vec3) -> float:
        return distance_to(self.made, self.place, p)


def _solids(case: Case) -> Iterator[_Solid]:
    """Yield the objects of the world; none if their places or their joints make no sense."""
    plan = case.plan
    wrong = (stands_on_nothing, moves_nowhere) if plan.objects else ()
    if any(True for check in wrong for _ in check(case)):
        return
    places = placements(plan.objects, {}) if plan.objects else {}
    yield from (_Solid(plan.objects[one.name], places[one.name]) for one in plan.world.objects)


class _Range:
    """Where the joints of an object, and of what it is on, can take it. boxes: its boxes in many
    places, of which one is within `slack` (m) of any that it can be in."""

    def __init__(self, boxes: Sequence[TurnedBox], slack: float) -> None:
        import numpy as np

        axes = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), UP
        self._centres = np.array([box.centre for box in boxes])
        self._axes = np.array([[rotate(box.attitude, axis) for axis in axes] for box in boxes])
        self._halves, self.slack = np.array([box.half for box in boxes]), slack

    def distance(self, p: Vec3) -> float:
        """Return the distance from the nearest surface to `p`; negative inside."""
        import numpy as np

        inside = np.einsum("nij,nj->ni", self._axes, np.array(p) - self._centres)
        beyond = np.abs(inside) - self._halves
        rooms = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0)
        return float(rooms.min()) - self.slack

    def nearest(self, path: tuple[Vec3, ...], enough: float) -> tuple[float, Vec3]:
        """Return the least distance of a path, and where it occurs, to within a centimetre. Where
        it is more than `enough`, the path is not examined closely."""
        found = [(self.distance(p), p) for p in path]
        for a, b in pairwise(path):
            length, gone = distance(a, b), 0.0
            while gone < length:
                point = add(a, scale(sub(b, a), gone / length))
                found.append((self.distance(point), point))
                gone += max(found[-1][0] - enough, _STEP)
        return min(found, default=(inf, ZERO))


def _ranges(case: Case) -> Iterator[_Range]:
    """Yield where each object can be; one that is free stays where it is declared."""
    objects, solids = case.plan.objects, case.cached(_solids)
    pivots = {made.name: place.position for made, place in solids}
    for made, place in solids:
        joints, travels, below = {}, list[float](), made.name
        while below:
            joint = objects[below].joint
            if joint is not None:
                arm = max(distance(corner, pivots[below]) for corner in corners(made, place))
                share = arm if isinstance(joint, TurnJoint) else 1.0
                travels.append((joint.high - joint.low) * share)
                joints[below] = joint
            below = objects[below].on or ""
        gap = _GAP
        while prod(counts := [ceil(travel / gap) + 1 for travel in travels]) > _MOST_PLACES:
            gap *= 2.0
        steps = (
            [joint.low + (joint.high - joint.low) * i / (n - 1) for i in range(n)]
            for joint, n in zip(joints.values(), counts, strict=True)
        )
        every = (placements(objects, dict(zip(joints, q, strict=True))) for q in product(*steps))
        boxes = [box for places in every for box in solids_of(made, places[made.name])]
        yield _Range(boxes, 0.5 * gap * len(joints))


def flies_into_an_object(case: Case) -> Iterator[Diagnostic]:
    """KYB585: a behavior flies its vehicle into an object, where the mission declares it or where
    its joint can take it (a warning).

    The vehicle's arms, or its bumper, must keep clear. An object that the behavior means to touch
    doesn't count, nor does what is joined with it.
    """
    solids = case.cached(_solids)
    for vehicle, state, entry, footprint in case.cached(footprints) if solids else ():
        path = path_of(footprint)
        reach = (vehicle.airframe.bumper or vehicle.airframe.arm) - _DEPTH
        for solid, swept in zip(solids, case.cached(_ranges), strict=True):
            near = entry is not None and swept.nearest((entry,), reach)[0] < reach
            if near or _is_meant(case, state, solid):
                continue
            name, verb, least = solid.made.name, "flies", 0.0
            room, point = nearest(path, solid, reach)
            if room >= reach:
                verb, least = "may fly", -swept.slack
                room, point = swept.nearest(path, reach)
            if room >= reach or (is_vertical(state) and room > least):  # it may stand on the object
                continue
            yield Diagnostic(
                "KYB585",
                f"`{state.name}` ({state.behavior.name}) {verb} into the object `{name}`",
                aim_of(state, footprint),
                label=f"at {shown_point(point)}, {room_needed(vehicle, round(room, 2), reach)}",
                notes=() if verb == "flies" else (f"its joints can take `{name}` there",),
                help=f"fly around `{name}`",
                severity=Severity.WARNING,
                related=values_of(state.behavior),
            )
            break


def stops_before_an_object(case: Case) -> Iterator[Diagnostic]:
    """KYB594: a behavior waits until the vehicle reaches a place that is so near to an object,
    where the mission declares it, that a processor stops the vehicle before it (a warning)."""
    solids = case.cached(_solids)
    guards = keepers(case) if solids else {}
    for vehicle, state, _, footprint in case.cached(footprints) if solids else ():
        for part, keep in () if is_vertical(state) else guards.get(vehicle.name, ()):
            others = {s.made.name: s for s in solids if not _is_meant(case, state, s)}
            found = out_of_reach(footprint, keep, others)
            if found is None or found.room < (vehicle.airframe.bumper or vehicle.airframe.arm):
                continue  # reported as KYB585
            yield Diagnostic(
                "KYB594",
                f"`{part.alias}` stops `{vehicle.name}` before the goal of `{state.name}`",
                aim_of(state, footprint),
                label=f"{format_quantity(found.room, LENGTH)} from the object `{found.obstacle}`",
                notes=(f"`{part.alias}` keeps {format_quantity(keep, LENGTH)} away",),
                help="move the goal further away, or touch the object with `approach_contact`",
                severity=Severity.WARNING,
                related=values_of(state.behavior),
            )
            break


def _is_meant(case: Case, state: StatePlan, solid: _Solid) -> bool:
    """Return whether a behavior means to touch an object, or what is joined with it."""
    objects, part = case.plan.objects, state.behavior
    meant = part.cls.touches(part.params)
    return meant in objects and base_of(objects, meant) == base_of(objects, solid.made.name)


def hangs_in_the_air(case: Case) -> Iterator[Diagnostic]:
    """KYB586: an object that is free to fall has nothing below it when the mission begins (a
    warning)."""
    solids = case.cached(_solids)
    for one, solid in zip(case.plan.world.objects, solids, strict=False):
        if not solid.made.is_free:
            continue
        points = [*corners(*solid), solid.place.position]
        lowest = min(z for _, _, z in points)
        below = {(x, y, lowest - share * _DROP) for x, y, _ in points for share in (0.0, 1.0)}
        others = [*case.plan.obstacles.values(), *(other for other in solids if other != solid)]
        if lowest + LEGS <= _DROP or any(s.distance(p) <= _DEPTH for s in others for p in below):
            continue
        yield Diagnostic(
            "KYB586",
            f"`{one.name}` hangs in the air",
            one.span_of("at"),
            label=f"it falls when the mission begins, {format_quantity(lowest + LEGS, LENGTH)}"
            " above the floor",
            help="put it on the floor or on an obstacle, or give it a joint",
            severity=Severity.WARNING,
        )


def pushed_in_vain(case: Case) -> Iterator[Diagnostic]:
    """KYB587: the pushes against an object on a slide, and against what stands on it, are together
    weaker than the slide's dry friction (a warning).

    What counts is the part of each force along the slide, of each vehicle the strongest in either
    direction, and the direction in which the sum is larger.
    """
    solids = {solid.made.name: solid for solid in case.cached(_solids)}
    for name, solid in solids.items():
        joint = solid.made.joint
        if not isinstance(joint, SlideJoint) or not joint.friction:
            continue
        axis = rotate(solid.place.attitude, solid.made.axis)
        ahead: dict[str, float] = {}
        behind: dict[str, float] = {}
        weak: PartPlan | None = None
        for vehicle, state in case.states():
            part = state.behavior
            surface, force = part.cls.pushes(part.params) or ("", None)
            face = _face(solids, surface, name)
            if face is None or force is None:
                continue
            along, weak = -force * dot(face.outward, axis), weak or part
            ahead[vehicle.name] = max(ahead.get(vehicle.name, 0.0), along)
            behind[vehicle.name] = max(behind.get(vehicle.name, 0.0), -along)
        most = max(sum(ahead.values()), sum(behind.values()))
        if weak is not None and most < joint.friction:
            needed = format_quantity(joint.friction, FORCE)
            yield Diagnostic(
                "KYB587",
                f"no push moves `{name}`, whose friction is {needed}",
                weak.span_of("force", "surface"),
                label=f"all pushes are {format_quantity(round(most, 3), FORCE)} along its slide",
                help=f"push with more than {needed}, or let more vehicles push",
                severity=Severity.WARNING,
            )


def _face(solids: Mapping[str, _Solid], surface: str, on: str) -> Face | None:
    """Return a surface if its object is `on`, or stands on it."""
    name, _, label = surface.partition(".")
    solid = solids.get(name)
    found = None if solid is None else solid.made.surface(label)
    while solid is not None and solid.made.name != on:
        solid = solids.get(solid.made.on or "")
    if found is None or solid is None:
        return None
    return face_of(found, solids[name].place)
