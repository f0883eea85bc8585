"""Conversions between the frames of autopilots and kybflow's. Pure.

kybflow uses the world frame ENU, the body frame FLU, and headings counter-clockwise from east.
Autopilots use NED, FRD, and headings clockwise from north. Both conversions are half turns, that of
the world about (1, 1, 0) and that of the body about x, so each is its own inverse. Only this
package uses NED; everything outside it is in ENU and FLU.
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
"""The WGS 84 ellipsoid: its equatorial radius, metres, and its flattening."""


def to_ned(v: Vec3) -> Vec3:
    """Convert a world vector from ENU to NED."""
    return (v[1], v[0], -v[2])


def to_frd(v: Vec3) -> Vec3:
    """Convert a body vector, or body rates, from FLU to FRD."""
    return (v[0], -v[1], -v[2])


def attitude_to_ned(q: Quat) -> Quat:
    """Convert an attitude from FLU-to-ENU to FRD-to-NED: (0, h, h, 0) q (0, -1, 0, 0), with h the
    square root of 1/2."""
    w, x, y, z = q
    w, x, y, z = _HALF * w, _HALF * x, _HALF * y, _HALF * z
    return (w + z, x + y, x - y, w - z)


def heading_to_ned(heading: float) -> float:
    """Convert a heading counter-clockwise from east to one clockwise from north, radians."""
    return wrap(0.5 * pi - heading)


from_ned, from_frd = to_ned, to_frd
attitude_from_ned, heading_from_ned = attitude_to_ned, heading_to_ned


def with_heading(q: Quat, heading: float) -> Quat:
    """Return `q` turned to another heading, with the same tilt."""
    return multiply(from_heading(heading - heading_of(q)), q)


class Anchor(NamedTuple):
    """Where an autopilot's own frame lies in the world. offset: the world position of its origin,
    metres. heading: the rotation from its ENU to the world, radians, counter-clockwise."""

    offset: Vec3 = ZERO
    heading: float = 0.0

    @classmethod
    def joining(cls, there: Vec3, heading_there: float, here: Vec3, heading_here: float) -> Anchor:
        """Return the anchor that maps the position `there` and `heading_there` in the autopilot's
        frame to `here` and `heading_here` in the world."""
        turn = wrap(heading_here - heading_there)
        return cls(sub(here, _turned(there, turn)), turn)

    def to_world(self, position: Vec3) -> Vec3:
        return add(self.offset, _turned(position, self.heading))

    def from_world(self, position: Vec3) -> Vec3:
        return _turned(sub(position, self.offset), -self.heading)

    def turned(self, vector: Vec3) -> Vec3:
        """Rotate a velocity or acceleration from the autopilot's frame to the world."""
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
    """The plane tangent to the earth at one point; accurate within about a kilometre. latitude,
    longitude: of that point, degrees. height: metres. north, east: the metres in a degree of
    latitude and of longitude."""

    latitude: float
    longitude: float
    height: float
    north: float
    east: float

    @classmethod
    def on_ellipsoid(cls, latitude: float, longitude: float, height: float) -> Tangent:
        """Return the tangent plane of the WGS 84 ellipsoid, from its radii of curvature along the
        meridian and across it."""
        squared = FLATTENING * (2.0 - FLATTENING)
        bulge = 1.0 - squared * sin(radians(latitude)) ** 2
        across = EQUATOR / sqrt(bulge)
        north = across * (1.0 - squared) / bulge + height
        east = (across + height) * cos(radians(latitude))
        return cls(latitude, longitude, height, radians(north), radians(east))

    @classmethod
    def on_sphere(cls, latitude: float, longitude: float, height: float, radius: float) -> Tangent:
        """Return the tangent plane of a sphere, as which some firmwares model the earth. radius:
        metres."""
        east = radius * cos(radians(latitude))
        return cls(latitude, longitude, height, radians(radius), radians(east))

    def local(self, latitude: float, longitude: float, height: float) -> Vec3:
        """Return the position, ENU in metres from the tangent point, of a geographic position."""
        around = (longitude - self.longitude + 180.0) % 360.0 - 180.0
        north = (latitude - self.latitude) * self.north
        return (around * self.east, north, height - self.height)

    def place(self, position: Vec3) -> Vec3:
        """Return the latitude, longitude and height of a position given in metres from the tangent
        point, ENU."""
        x, y, z = position
        return (
            self.latitude + y / self.north, self.longitude + x / self.east, self.height + z,
        )  # fmt: skip


def lean(q: Quat) -> float:
    """Return the cosine of an attitude's tilt, but at least 0.1."""
    return max(cos(tilt_of(q)), 0.1)


def _turned(v: Vec3, heading: float) -> Vec3:
    if heading == 0.0:
        return v
    c, s = cos(heading), sin(heading)
    return (c * v[0] - s * v[1], s * v[0] + c * v[1], v[2])
