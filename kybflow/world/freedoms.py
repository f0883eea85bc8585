"""The freedoms of an object: the motions that its joint, and those of what it is on, leave it.

A force F at the point c does the work Q dq in a motion dq, with the generalized force Q (N or N m)

    Q = a . F                   along the unit vector a
    Q = a . ((c - p) x F)       about the unit vector a through the point p

An object of the world without a joint moves along x and y and turns about the vertical through its
centre; the friction of its `grip` on the floor resists. World frame, SI.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product
from math import hypot, prod, sqrt
from typing import NamedTuple

from kybflow.core.geometry import GRAVITY, UP, Vec3, add, cross, dot, rotate, sub
from kybflow.world.objects import Placement, TurnJoint, WorldObject, placements, solids_of

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
        one, place, carried = objects[below], places[below], [*_carried(objects, below)]
        mass = sum(other.mass for other in carried)
        axis = UP if one.is_free else rotate(place.attitude, one.axis)
        moved = sum(_inertia(c, places[c.name], axis, place.position) for c in carried)
        joint = one.joint
        if isinstance(joint, TurnJoint):
            stops = joint.low, joint.high
            found.append(Freedom(below, "yaw", one.axis, True, moved, joint.friction, *stops))
        elif joint is not None:
            stops = joint.low, joint.high
            found.append(Freedom(below, "position", one.axis, False, mass, joint.friction, *stops))
        elif one.is_free:
            resists, arm = one.grip * mass * GRAVITY, hypot(*one.size[:2]) / sqrt(12.0)
            found.append(Freedom(below, "yaw", UP, True, moved, resists * arm))
            found += (Freedom(below, label, a, False, mass, resists) for label, a in _AXES)
        below = one.on
    return tuple(found)


def _carried(objects: Mapping[str, WorldObject], name: str) -> Iterator[WorldObject]:
    """Yield an object and everything that is on it."""
    yield objects[name]
    for one in objects.values():
        if one.on == name:
            yield from _carried(objects, one.name)


def _inertia(one: WorldObject, place: Placement, axis: Vec3, about: Vec3) -> float:
    """Return an object's moment of inertia (kg m^2) about an axis through a point. Of each of its
    boxes, eight equal point masses at the radii of gyration have the same moment."""
    found = 0.0
    for box in solids_of(one, place):
        mass = one.mass * prod(2.0 * half for half in box.half) / one.volume
        for signs in product((-_GYRATION, _GYRATION), repeat=3):
            x, y, z = (sign * half for sign, half in zip(signs, box.half, strict=True))
            arm = cross(axis, sub(add(box.centre, rotate(box.attitude, (x, y, z))), about))
            found += 0.125 * mass * dot(arm, arm)
    return found
