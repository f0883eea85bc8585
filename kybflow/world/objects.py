"""Objects of the world that move: bodies on joints, and the surfaces at which vehicles push them.

An object is a box, with a plate at each surface. Its pose p', R' follows from the pose p, R of what
it is on, which is the world or another object, and from the coordinate q of its joint along or
about the unit vector a, in the object's axes:

    slide    p' = p + R (at + H a q),    R' = R H
    turn     p' = p + R at,              R' = R H exp(a q)
    neither  p' = p + R at,              R' = R H

H turns about z by `heading`. An object of the world without a joint is free: this is its first
pose. World frame and body frame as in `kybflow.core.geometry`; SI units.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from math import atan2, cos, sin
from typing import Annotated, NamedTuple

from kybflow.core.geometry import (
    LEVEL,
    UP,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    cross,
    dot,
    from_axes,
    from_heading,
    heading_of,
    multiply,
    norm,
    rotate,
    rotate_back,
    scale,
    sub,
    wrap,
)
from kybflow.core.params import key, record
from kybflow.core.signals import SeenObject, SeenObjects
from kybflow.core.units import (
    NUMBER,
    Angle,
    Force,
    Length,
    RotaryViscosity,
    Torque,
    Viscosity,
)
from kybflow.world.shapes import Box

PLATE = 0.01
"""Thickness of a surface's plate, m."""
GRIP = 0.5
"""Usual coefficient of friction between a hull of foam and a plate."""


@record("slide")
class SlideJoint:
    """A joint along which an object slides."""

    along: Annotated[Vec3, NUMBER] = key("Direction, of any length, in the object's axes.")
    low: Length = key("Position of the stop behind, relative to `at`.", key="from")
    high: Length = key("Position of the stop ahead.", key="to")
    start: Length = key("Position at the start.", default=0.0)
    friction: Force = key("Dry friction.", default=0.0, at_least=0.0)
    damping: Viscosity = key("Viscous friction.", default=0.0, at_least=0.0)


@record("turn")
class TurnJoint:
    """A joint about which an object turns."""

    about: Annotated[Vec3, NUMBER] = key("Axis, of any length, in the object's axes.")
    low: Angle = key("Angle of the stop clockwise.", key="from")
    high: Angle = key("Angle of the stop counter-clockwise.", key="to")
    start: Angle = key("Angle at the start.", default=0.0)
    friction: Torque = key("Dry friction.", default=0.0, at_least=0.0)
    damping: RotaryViscosity = key("Viscous friction.", default=0.0, at_least=0.0)


class ObjectSurface(NamedTuple):
    """A flat surface of an object, where vehicles push it. at: its centre. facing: the direction
    out of it; both in the object's axes."""

    name: str
    at: Vec3
    facing: Vec3
    width: float
    height: float

    @property
    def outward(self) -> Vec3:
        """The unit vector out of the surface, in the object's axes."""
        return unit(self.facing)

    @property
    def attitude(self) -> Quat:
        """The attitude of axes with x out of the surface and y along its width."""
        x = self.outward
        side = cross(UP, x)
        y = unit(side) if norm(side) > 1e-6 else (0.0, 1.0, 0.0)
        return from_axes(x, y, cross(x, y))


class WorldObject(NamedTuple):
    """An object. at: its centre. size: along its axes. mass: with its surfaces. on: the object that
    it is on, None for the world. joint: None if it is free or, on another object, a part of it.
    grip: the coefficient of friction of its faces. body: its name in motion capture, None for its
    own."""

    name: str
    at: Vec3
    size: Vec3
    mass: float
    on: str | None = None
    heading: float = 0.0
    joint: SlideJoint | TurnJoint | None = None
    grip: float = GRIP
    surfaces: tuple[ObjectSurface, ...] = ()
    body: str | None = None

    def surface(self, name: str) -> ObjectSurface | None:
        """Return the surface with this name, None if it has none."""
        return next((one for one in self.surfaces if one.name == name), None)

    @property
    def is_free(self) -> bool:
        """Whether it moves in all directions."""
        return self.joint is None and self.on is None

    @property
    def moves(self) -> bool:
        """Whether it moves by itself; a part of another object doesn't."""
        return self.joint is not None or self.is_free

    @property
    def axis(self) -> Vec3:
        """The unit vector along or about which it moves, in its own axes; zero without a joint."""
        match self.joint:
            case SlideJoint(along=direction) | TurnJoint(about=direction):
                return unit(direction)
            case None:
                return ZERO

    @property
    def volume(self) -> float:
        """The volume of its box and plates, m^3."""
        return sum(8.0 * x * y * z for _, _, (x, y, z) in boxes_of(self))

    def placed(self, below: Placement, q: float) -> Placement:
        """Return its pose on something with the pose `below`, with its joint at `q`."""
        attitude = multiply(below.attitude, from_heading(self.heading))
        at = add(below.position, rotate(below.attitude, self.at))
        if isinstance(self.joint, SlideJoint):
            at = add(at, rotate(attitude, scale(self.axis, q)))
        elif isinstance(self.joint, TurnJoint):
            x, y, z = scale(self.axis, sin(0.5 * q))
            attitude = multiply(attitude, (cos(0.5 * q), x, y, z))
        return Placement(at, attitude)


class Placement(NamedTuple):
    """A pose in the world."""

    position: Vec3
    attitude: Quat


WORLD = Placement(ZERO, LEVEL)


class ObjectState(NamedTuple):
    """What an object does. q, speed: the coordinate of its joint and its rate; for a free object
    the heading and its rate. turning: its angular velocity. World frame, SI."""

    position: Annotated[Vec3, "m, world"]
    attitude: Quat
    velocity: Annotated[Vec3, "m/s, world"]
    q: Annotated[float, "the coordinate of its joint: m, or rad"]
    speed: Annotated[float, "its rate: m/s, or rad/s"]
    turning: Annotated[Vec3, "rad/s, world"] = ZERO


def unit(direction: Vec3) -> Vec3:
    """Return the unit vector along a direction, or zero if it has none."""
    length = norm(direction)
    return scale(direction, 1.0 / length) if length > 0.0 else ZERO


def in_order(objects: Iterable[WorldObject]) -> Iterator[WorldObject]:
    """Yield the objects, each after the one that it is on. Those on a circle, or on an unknown
    one, are left out."""
    waiting = list(objects)
    known: set[str | None] = {None}
    while ready := [one for one in waiting if one.on in known]:
        waiting = [one for one in waiting if one.on not in known]
        known |= {one.name for one in ready}
        yield from ready


def standing(objects: Iterable[WorldObject]) -> dict[str, WorldObject]:
    """Return the objects by name; those on a circle, or on an unknown one, stand on nothing."""
    every = list(objects)
    well = {one.name for one in in_order(every)}
    return {one.name: one if one.name in well else one._replace(on=None) for one in every}


def placements(objects: Mapping[str, WorldObject], q: Mapping[str, float]) -> dict[str, Placement]:
    """Return the pose of every object from the coordinates of the joints; without one, that of the
    start."""
    found: dict[str, Placement] = {}
    for one in in_order(objects.values()):
        start = 0.0 if one.joint is None else one.joint.start
        below = WORLD if one.on is None else found[one.on]
        found[one.name] = one.placed(below, q.get(one.name, start))
    return found


def coordinate(one: WorldObject, on: Placement | None, place: Placement) -> float:
    """Return the coordinate of an object's joint from its pose and from that of what it is on, None
    for the world; the heading of an object without a joint."""
    below, axis = on or WORLD, one.axis
    attitude = multiply(below.attitude, from_heading(one.heading))
    match one.joint:
        case SlideJoint():
            at = add(below.position, rotate(below.attitude, one.at))
            return dot(rotate_back(attitude, sub(place.position, at)), axis)
        case TurnJoint():
            w, x, y, z = multiply(conjugate(attitude), place.attitude)
            return wrap(2.0 * atan2(dot((x, y, z), axis), w))
    return heading_of(place.attitude)


def boxes_of(one: WorldObject) -> Iterator[tuple[Vec3, Quat, Vec3]]:
    """Yield the boxes of an object: centre and attitude in its axes, and half of the size."""
    yield ZERO, LEVEL, scale(one.size, 0.5)
    for surface in one.surfaces:
        centre = add(surface.at, scale(surface.outward, -0.5 * PLATE))
        yield centre, surface.attitude, (0.5 * PLATE, 0.5 * surface.width, 0.5 * surface.height)


def corners(one: WorldObject, place: Placement) -> Iterator[Vec3]:
    """Yield the corners of an object's box and plates, world frame."""
    for centre, attitude, (hx, hy, hz) in boxes_of(one):
        for x, y, z in product((-hx, hx), (-hy, hy), (-hz, hz)):
            inside = add(centre, rotate(attitude, (x, y, z)))
            yield add(place.position, rotate(place.attitude, inside))


class TurnedBox(NamedTuple):
    """A box in the world that may be turned. centre, attitude: of its axes. half: half of its size
    along them."""

    centre: Vec3
    attitude: Quat
    half: Vec3

    def distance(self, p: Vec3) -> float:
        """Return the distance from the surface to `p`; negative inside."""
        return self._box.distance(self._inside(p))

    def outward(self, p: Vec3) -> Vec3:
        """Return the outward direction of the box at `p`."""
        return rotate(self.attitude, self._box.outward(self._inside(p)))

    @property
    def _box(self) -> Box:
        return Box(scale(self.half, -1.0), self.half)

    def _inside(self, p: Vec3) -> Vec3:
        return rotate_back(self.attitude, sub(p, self.centre))


def solids_of(one: WorldObject, place: Placement) -> Iterator[TurnedBox]:
    """Yield the box and the plates of an object in the world."""
    for centre, attitude, half in boxes_of(one):
        at = add(place.position, rotate(place.attitude, centre))
        yield TurnedBox(at, multiply(place.attitude, attitude), half)


def distance_to(one: WorldObject, place: Placement, p: Vec3) -> float:
    """Return the distance (m) of a point from an object; negative inside."""
    return min(box.distance(p) for box in solids_of(one, place))


class Face(NamedTuple):
    """A surface in the world. outward: the unit vector out of it; along: the one along its width.
    velocity: of its centre, m/s."""

    centre: Vec3
    outward: Vec3
    along: Vec3
    width: float
    height: float
    velocity: Vec3 = ZERO

    def before(self, p: Vec3) -> Vec3:
        """Return the position of a point relative to the centre: out of the face, along its width
        and upwards."""
        away = sub(p, self.centre)
        return dot(away, self.outward), dot(away, self.along), away[2]

    def spans(self, aside: float, above: float) -> bool:
        """Return whether a point so far along the width and upwards is before the face."""
        return abs(aside) < 0.5 * self.width and abs(above) < 0.5 * self.height


def face_of(
    surface: ObjectSurface, place: Placement, velocity: Vec3 = ZERO, turning: Vec3 = ZERO
) -> Face:
    """Return the surface of an object with the pose `place`, whose centre moves at `velocity` and
    which turns at `turning`."""
    arm = rotate(place.attitude, surface.at)
    axes = multiply(place.attitude, surface.attitude)
    return Face(
        add(place.position, arm), rotate(axes, (1.0, 0.0, 0.0)), rotate(axes, (0.0, 1.0, 0.0)),
        surface.width, surface.height, add(velocity, cross(turning, arm)),
    )  # fmt: skip


def turning_of(one: WorldObject, attitude: Quat, speed: float) -> Vec3:
    """Return the angular velocity that the joint's rate gives an object, world frame."""
    if one.is_free:
        return scale(UP, speed)
    return scale(rotate(attitude, one.axis), speed) if isinstance(one.joint, TurnJoint) else ZERO


def mover_of(objects: Mapping[str, WorldObject], name: str) -> WorldObject:
    """Return the object that an object is a part of, itself if it moves by itself."""
    one = objects[name]
    return one if one.moves or one.on is None else mover_of(objects, one.on)


def base_of(objects: Mapping[str, WorldObject], name: str) -> str:
    """Return the object of the world that an object is on, directly or through others."""
    below = objects[name].on
    return name if below is None else base_of(objects, below)


def place_of(objects: Mapping[str, WorldObject], seen: SeenObjects, name: str) -> Placement:
    """Return where an object was seen last. One that has not been seen is at its start on what
    it is on, and a part is where that is."""
    one, known = objects[name], seen.get(name)
    if known is not None:
        return Placement(known.position, known.attitude)
    below = WORLD if one.on is None else place_of(objects, seen, one.on)
    return one.placed(below, 0.0 if one.joint is None else one.joint.start)


def seen_object(
    objects: Mapping[str, WorldObject], seen: SeenObjects, name: str
) -> SeenObject | None:
    """Return what was last seen of an object, None if nothing. A part is seen by what moves it."""
    mover = mover_of(objects, name)
    known = seen.get(mover.name)
    if known is None or mover.name == name:
        return known
    position, attitude = place_of(objects, seen, name)
    turning = turning_of(mover, known.attitude, known.speed)
    velocity = add(known.velocity, cross(turning, sub(position, known.position)))
    return known._replace(
        position=position, attitude=attitude, velocity=velocity, q=heading_of(attitude)
    )


def seen_face(objects: Mapping[str, WorldObject], seen: SeenObjects, path: str) -> Face | None:
    """Return the surface `OBJECT.SURFACE` as it was last seen, None if its object has not been.
    Raises KeyError if there is no such surface."""
    name, _, label = path.partition(".")
    surface, known = objects[name].surface(label), seen_object(objects, seen, name)
    if surface is None:
        raise KeyError(path)
    if known is None:
        return None
    mover = mover_of(objects, name)
    turning = turning_of(mover, known.attitude, known.speed)
    place = Placement(known.position, known.attitude)
    return face_of(surface, place, known.velocity, turning)
