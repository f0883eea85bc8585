"""Conversions between the frames of autopilots and kybflow's. Pure.

kybflow: world ENU, body FLU, headings counter-clockwise from east. Autopilots: world NED, body FRD,
headings clockwise from north. Both turns are half turns, world about (1, 1, 0), body about x, so
each conversion is its own inverse. NED lives in this folder alone; what leaves it is ENU and FLU.
"""

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt
from typing import NamedTuple

from kybflow.core.geometry import (
    ZERO,
    Quat,
    Vec3,
    add,
    from_heading,
    heading_of,
    multiply,
    sub,
    tilt_of,
    wrap,
)

_HALF = sqrt(0.5)

EQUATOR, FLATTENING = 6_378_137.0, 1.0 / 298.257223563
"""The ellipsoid of WGS 84: its radius at the equator, metres, and its flattening."""


def to_ned(v: Vec3) -> Vec3:
    """A world vector, ENU to NED."""
    return (v[1], v[0], -v[2])


def to_frd(v: Vec3) -> Vec3:
    """A body vector, FLU to FRD; body rates too."""
    return (v[0], -v[1], -v[2])


def attitude_to_ned(q: Quat) -> Quat:
    """An attitude FLU to ENU as one FRD to NED: (0, h, h, 0) q (0, -1, 0, 0), h the root of 1/2."""
    w, x, y, z = q
    w, x, y, z = _HALF * w, _HALF * x, _HALF * y, _HALF * z
    return (w + z, x + y, x - y, w - z)


def heading_to_ned(heading: float) -> float:
    """A heading from east, counter-clockwise, as one from north, clockwise."""
    return wrap(0.5 * pi - heading)


from_ned, from_frd = to_ned, to_frd
attitude_from_ned, heading_from_ned = attitude_to_ned, heading_to_ned


def with_heading(q: Quat, heading: float) -> Quat:
    """`q` turned to another heading, with the same tilt."""
    return multiply(from_heading(heading - heading_of(q)), q)


class Anchor(NamedTuple):
    """Where an autopilot's own frame lies in the world. offset: the world position of its zero,
    metres. heading: the turn from its ENU to the world, radians, counter-clockwise."""

    offset: Vec3 = ZERO
    heading: float = 0.0

    @classmethod
    def joining(cls, there: Vec3, heading_there: float, here: Vec3, heading_here: float) -> Anchor:
        """The anchor by which a place and a heading in the autopilot's frame are `here` in the
        world."""
        turn = wrap(heading_here - heading_there)
        return cls(sub(here, _turned(there, turn)), turn)

    def to_world(self, position: Vec3) -> Vec3:
        return add(self.offset, _turned(position, self.heading))

    def from_world(self, position: Vec3) -> Vec3:
        return _turned(sub(position, self.offset), -self.heading)

    def turned(self, vector: Vec3) -> Vec3:
        """A velocity or acceleration in the autopilot's frame, as one in the world."""
        return _turned(vector, self.heading)

    def unturned(self, vector: Vec3) -> Vec3:
        return _turned(vector, -self.heading)

    def heading_from_world(self, heading: float) -> float:
        return wrap(heading - self.heading)

    def attitude_to_world(self, q: Quat) -> Quat:
        return multiply(from_heading(self.heading), q) if self.heading else q

    def attitude_from_world(self, q: Quat) -> Quat:
        return multiply(from_heading(-self.heading), q)


IDENTITY = Anchor()
"""The anchor of an autopilot that takes its position from kybflow."""


class Tangent(NamedTuple):
    """The plane that touches the earth at a place: latitude and longitude in degrees, height in
    metres, and the metres in a degree of each. Good for a kilometre."""

    latitude: float
    longitude: float
    height: float
    north: float
    east: float

    @classmethod
    def on_ellipsoid(cls, latitude: float, longitude: float, height: float) -> Tangent:
        """The plane on the ellipsoid of WGS 84, by its radii of curvature along the meridian and
        across it."""
        squared = FLATTENING * (2.0 - FLATTENING)
        bulge = 1.0 - squared * sin(radians(latitude)) ** 2
        across = EQUATOR / sqrt(bulge)
        north = across * (1.0 - squared) / bulge + height
        east = (across + height) * cos(radians(latitude))
        return cls(latitude, longitude, height, radians(north), radians(east))

    @classmethod
    def on_sphere(cls, latitude: float, longitude: float, height: float, radius: float) -> Tangent:
        """The plane on a sphere, for which some firmwares take the earth."""
        east = radius * cos(radians(latitude))
        return cls(latitude, longitude, height, radians(radius), radians(east))

    def local(self, latitude: float, longitude: float, height: float) -> Vec3:
        """The position of a place, metres from this one, ENU."""
        around = (longitude - self.longitude + 180.0) % 360.0 - 180.0
        north = (latitude - self.latitude) * self.north
        return (around * self.east, north, height - self.height)

    def place(self, position: Vec3) -> Vec3:
        """The latitude, longitude and height of a position, metres from this place, ENU."""
        x, y, z = position
        return (
            self.latitude + y / self.north, self.longitude + x / self.east, self.height + z,
        )  # fmt: skip


def lean(q: Quat) -> float:
    """The cosine of an attitude's tilt, at least 0.1."""
    return max(cos(tilt_of(q)), 0.1)


def _turned(v: Vec3, heading: float) -> Vec3:
    if heading == 0.0:
        return v
    c, s = cos(heading), sin(heading)
    return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])
