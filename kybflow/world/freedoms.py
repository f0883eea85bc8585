"""The freedoms of an object: the motions that its joint, and those of what it is on, leave it.

A force F at the point c does the work Q dq in a motion dq, with the generalized force Q (N or N m)

    Q = a . F                   along the unit vector a
    Q = a . ((c - p) x F)       about the unit vector a through the point p

An object of the world without a joint moves along x and y and turns about the vertical through its
centre; the friction of its `grip` on the floor resists. World frame, SI.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import hypot, sqrt
from typing import NamedTuple

from kybflow.core.geometry import GRAVITY, UP, Vec3, add, cross, dot, rotate, scale, sub
from kybflow.world.objects import Placement, TurnJoint, WorldObject, boxes_of, placements

_AXES: tuple[tuple[str, Vec3], ...] = (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)))
_GYRATION = 1.0 / sqrt(3.0)
"""The radius of gyration of a box along an axis, relative to half of its size."""


class Freedom(NamedTuple):
    """One motion that an object is free to make.

    object: the object that makes it. label: `position` or `yaw`, or `x` or `y` of an object without
    a joint. axis: the unit vector along or about which it moves, in the axes of the object. turns:
    whether it moves about it. inertia: the mass (kg) or the moment of inertia (kg m^2) that moves.
    friction: the dry friction, N or N m. low, high: the stops; None without.
    """

    object: str
    label: str
    axis: Vec3
    turns: bool
    inertia: float
    friction: float
    low: float | None = None
    high: float | None = None

    @property
    def name(self) -> str:
        """What conditions call its coordinate, like `cart.position`."""
        return f"{self.object}.{self.label}"

    def lever(self, place: Placement, at: Vec3, along: Vec3) -> float:
        """Return the generalized force of a force of 1 N at the point `at` along the unit vector
        `along`. place: the pose of the object that moves."""
        axis = self.axis if self.label in ("x", "y") else rotate(place.attitude, self.axis)
        if self.turns:
            return dot(axis, cross(sub(at, place.position), along))
        return dot(axis, along)


def freedoms_of(objects: Mapping[str, WorldObject], name: str) -> tuple[Freedom, ...]:
    """Return the freedoms of an object, its own first, then those of what it is on. The inertia is
    that at the start."""
    places, found = placements(objects, {}), list[Freedom]()
    below: str | None = name
    while below is not None:
        one = objects[below]
        carried = [*_carried(objects, below)]
        mass = sum(objects[other].mass for other in carried)
        joint = one.joint
        if joint is not None:
            turns, place = isinstance(joint, TurnJoint), places[below]
            axis = rotate(place.attitude, one.axis)
            moved = mass
            if turns:
                moved = sum(
                    _inertia(objects[other], places[other], axis, place.position)
                    for other in carried
                )
            label = "yaw" if turns else "position"
            found.append(
                Freedom(below, label, one.axis, turns, moved, joint.friction, joint.low, joint.high)
            )
        elif one.is_free:
            place, resists = places[below], one.grip * mass * GRAVITY
            moved = sum(
                _inertia(objects[other], places[other], UP, place.position) for other in carried
            )
            arm = hypot(one.size[0], one.size[1]) / sqrt(12.0)
            found.append(Freedom(below, "yaw", UP, True, moved, resists * arm))
            found += (Freedom(below, label, a, False, mass, resists) for label, a in _AXES)
        below = one.on
    return tuple(found)


def _carried(objects: Mapping[str, WorldObject], name: str) -> Iterator[str]:
    """Yield an object and everything that is on it."""
    yield name
    for one in objects.values():
        if one.on == name:
            yield from _carried(objects, one.name)


def _inertia(one: WorldObject, place: Placement, axis: Vec3, about: Vec3) -> float:
    """Return an object's moment of inertia (kg m^2) about an axis through a point. Of each of its
    boxes, eight equal point masses at the radii of gyration have the same moment."""
    found = 0.0
    for centre, attitude, (hx, hy, hz) in boxes_of(one):
        mass = one.mass * 8.0 * hx * hy * hz / one.volume
        for x in (-hx, hx):
            for y in (-hy, hy):
                for z in (-hz, hz):
                    corner = rotate(attitude, scale((x, y, z), _GYRATION))
                    p = add(place.position, rotate(place.attitude, add(centre, corner)))
                    arm = cross(axis, sub(p, about))
                    found += mass / 8.0 * dot(arm, arm)
    return found
