"""Whether a vehicle that locates itself by printed tags sees any: KYB422 and KYB445."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from math import hypot

from kybflow.core.geometry import Quat, Vec3, rotate
from kybflow.core.signals import Frame
from kybflow.core.units import LENGTH, format_quantity
from kybflow.dsl.checks.case import Case
from kybflow.dsl.checks.estimators import reckons
from kybflow.dsl.checks.space import aim_of, footprints, shown_point, the_cameras
from kybflow.dsl.diagnostics import Diagnostic, Related, Severity
from kybflow.dsl.plan import VehiclePlan
from kybflow.world.cameras import LEAST_SIDE, Camera
from kybflow.world.tags import Tag

_LOW_HEIGHT = 0.3
"""Height above its start, m, below which a vehicle need not see a tag, because it is taking off or
landing."""
_DOWNWARD_AXIS = -0.95
"""The largest z component of a camera's axis at which the camera counts as looking straight down.
"""
_LEVEL_AXIS = -0.5
"""The z component of the axis of a camera that looks 30 degrees below the horizontal."""


def sees_no_tag(case: Case) -> Iterator[Diagnostic]:
    """KYB422: a vehicle that relies on tags alone flies to a place where its cameras see no tag (a
    warning).

    A tag counts if it can be in the image of a camera that looks down at any heading, fits into the
    image as a whole, and has a side of at least 12 pixels, which the detector needs. Dead reckoning
    may bridge the way between two places, so only its ends are checked.
    """
    tags = [*chain.from_iterable(use.tags for use in case.plan.world.tags)]
    blind = {
        v.name
        for v in case.plan.vehicles
        if tags and max(_axes(v), default=0.0) < _DOWNWARD_AXIS and _knows_tags_alone(v)
    }
    judged: set[tuple[str, Vec3]] = set()
    for vehicle, state, _, footprint in case.cached(footprints) if blind else ():
        name = vehicle.name
        for place in footprint.points if name in blind else ():
            if place[2] < vehicle.start[2] + _LOW_HEIGHT or (name, place) in judged:
                continue
            judged.add((name, place))
            reasons = [_hidden(camera, place, tags) for camera in vehicle.own_cameras.values()]
            if all(reasons):
                yield Diagnostic(
                    "KYB422",
                    f"`{name}` sees no tag where `{state.name}` goes",
                    aim_of(state, footprint),
                    label=reasons[0],
                    notes=(f"at {shown_point(place)}",),
                    help="fly above tags, or at another height, or print other tags",
                    severity=Severity.WARNING,
                    related=(*the_cameras(vehicle), *_tags(case)),
                )
                break


def looks_past_the_tags(case: Case) -> Iterator[Diagnostic]:
    """KYB445: a vehicle relies on tags alone and all tags lie flat, but none of its cameras points
    at least 30 degrees below the horizontal (a warning)."""
    for vehicle in case.plan.vehicles if case.plan.world.tags else ():
        if not vehicle.body.cameras or not _knows_tags_alone(vehicle):
            continue
        tags = chain.from_iterable(use.tags for use in case.plan.world.tags)
        are_flat = all(_axis(tag.attitude) > -_DOWNWARD_AXIS for tag in tags)
        if min(_axes(vehicle)) > _LEVEL_AXIS and are_flat:
            camera = vehicle.body.cameras[0]
            yield Diagnostic(
                "KYB445",
                f"`{camera.name}` of `{vehicle.name}` can't see the tags",
                camera.span_of("facing"),
                label="looks to the side",
                notes=("all tags of the world lie flat",),
                help="write `facing: down`, or print tags for the walls",
                severity=Severity.WARNING,
                related=_tags(case),
            )


def _tags(case: Case) -> tuple[Related, ...]:
    """Return the source location of the tags, if the mission itself describes them."""
    world = case.plan.world
    return (Related(world.key_span("tags"), "the tags"),) if world.is_written("tags") else ()


def _axes(vehicle: VehiclePlan) -> list[float]:
    """Return the z component of each camera's axis on a level vehicle; -1 is straight down."""
    return [_axis(camera.attitude) for camera in vehicle.own_cameras.values()]


def _axis(attitude: Quat) -> float:
    """Return the z component of the direction in which a camera or a tag with this attitude
    faces."""
    return rotate(attitude, (0.0, 0.0, 1.0))[2]


def _knows_tags_alone(vehicle: VehiclePlan) -> bool:
    """Return whether the vehicle relies on tags and dead reckoning alone."""
    parts = [use.part for use in vehicle.estimators]
    sees = [part.cls.needs_tags and Frame in part.cls.uses(part.params) for part in parts]
    known = (
        is_by_tags or reckons(use) for is_by_tags, use in zip(sees, vehicle.estimators, strict=True)
    )
    return any(sees) and all(known)


def _hidden(camera: Camera, place: Vec3, tags: Sequence[Tag]) -> str:
    """Return why a camera sees no tag from a position; empty if it sees one."""
    lens, (x, y, z) = camera.lens, place
    aside, reason = hypot(camera.position[0], camera.position[1]), ""
    for tag in tags:
        height = z + camera.position[2] - tag.position[2]
        wide, high = lens.width / lens.fx * height, lens.height / lens.fy * height
        away = hypot(x - tag.position[0], y - tag.position[1])
        if height <= 0.0 or away > aside + 0.5 * hypot(wide, high):
            continue
        pixels = lens.fx * tag.size / height
        if tag.size > min(wide, high):
            room = format_quantity(min(wide, high), LENGTH)
            reason = (
                f"the image shows {room}, but a tag is {format_quantity(tag.size, LENGTH)} wide"
            )
        elif pixels < LEAST_SIDE:
            reason = f"a tag is {pixels:.2g} pixels wide, but needs {LEAST_SIDE:g}"
        else:
            return ""
    return reason or "no tag is in the image"
