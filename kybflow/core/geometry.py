"""Vectors and rotations as tuples of floats.

The world frame is ENU and the body frame FLU (REP 103). A quaternion is (w, x, y, z) of unit length
and rotates body to world. Angles are in radians. Plain floats are used because a NumPy array costs
ten times as much as the arithmetic on three numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from math import acos, asin, atan2, cos, dist, hypot, pi, sin, sqrt

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

ZERO: Vec3 = (0.0, 0.0, 0.0)
UP: Vec3 = (0.0, 0.0, 1.0)
LEVEL: Quat = (1.0, 0.0, 0.0, 0.0)
GRAVITY = 9.81
"""Standard gravity of the simulator and the controllers, m/s^2."""


def add(a: Vec3, b: Vec3) -> Vec3:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a: Vec3, b: Vec3) -> Vec3:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vec3, s: float) -> Vec3:
    """Return the product s a."""
    return (a[0] * s, a[1] * s, a[2] * s)


def dot(a: Vec3, b: Vec3) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return the vector product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vec3) -> float:
    """Return the Euclidean length."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


distance: Callable[[Vec3, Vec3], float] = dist
"""Return the Euclidean distance between two points."""


def least_distance(before: Vec3, after: Vec3) -> float:
    """Return the least length of a vector that changes linearly from `before` to `after`.

    This is the least distance of two points that move along straight lines, if the vectors are
    their first and last offset. It is also the distance of a point from a segment, if the vectors
    lead from the point to the ends of the segment.
    """
    way = sub(after, before)
    square = dot(way, way)
    share = 0.0 if square == 0.0 else min(1.0, max(0.0, -dot(before, way) / square))
    return norm(add(before, scale(way, share)))


def wrap(angle: float) -> float:
    """Return the equivalent angle in [-pi, pi)."""
    return (angle + pi) % (2 * pi) - pi


def multiply(a: Quat, b: Quat) -> Quat:
    """Return the Hamilton product a b, which rotates by `b` first, then by `a`."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(q: Quat) -> Quat:
    """Return the inverse rotation, world to body."""
    return (q[0], -q[1], -q[2], -q[3])


def rotate(q: Quat, v: Vec3) -> Vec3:
    """Rotate `v` from the body frame to the world frame."""
    w, x, y, z = q
    vx, vy, vz = v
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def rotate_back(q: Quat, v: Vec3) -> Vec3:
    """Rotate `v` from the world frame to the body frame."""
    w, x, y, z = q
    vx, vy, vz = v
    tx = 2.0 * (z * vy - y * vz)
    ty = 2.0 * (x * vz - z * vx)
    tz = 2.0 * (y * vx - x * vy)
    return (
        vx + w * tx - y * tz + z * ty,
        vy + w * ty - z * tx + x * tz,
        vz + w * tz - x * ty + y * tx,
    )


def body_z(q: Quat) -> Vec3:
    """Return the body's z axis, the direction of thrust, in the world frame."""
    w, x, y, z = q
    return (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))


def heading_of(q: Quat) -> float:
    """Return the heading: the angle in [-pi, pi] of the body's x axis, projected onto the
    horizontal plane, counter-clockwise from world x (east)."""
    w, x, y, z = q
    return atan2(w * z + x * y, 0.5 - (y * y + z * z))


def tilt_of(q: Quat) -> float:
    """Return the tilt in [0, pi]: the angle between body z and world z."""
    c = 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])
    return acos(-1.0 if c < -1.0 else 1.0 if c > 1.0 else c)


def from_heading(heading: float) -> Quat:
    """Return the level attitude with this heading."""
    return (cos(heading / 2), 0.0, 0.0, sin(heading / 2))


def from_euler(roll: float, pitch: float, yaw: float) -> Quat:
    """Return the attitude of intrinsic z-y-x Euler angles (yaw, then pitch, then roll)."""
    cr, sr = cos(roll / 2), sin(roll / 2)
    cp, sp = cos(pitch / 2), sin(pitch / 2)
    cy, sy = cos(yaw / 2), sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def to_euler(q: Quat) -> Vec3:
    """Return the intrinsic z-y-x Euler angles (roll, pitch, yaw), with pitch in [-pi/2, pi/2]."""
    w, x, y, z = q
    s = 2.0 * (w * y - z * x)
    return (
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        asin(-1.0 if s < -1.0 else 1.0 if s > 1.0 else s),
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def from_thrust_direction(direction: Vec3, heading: float) -> Quat:
    """Return the attitude with body z along `direction` and body x as close as possible to
    `heading` (rad). direction: world frame, of any length, not parallel to the heading."""
    return from_thrust_facing(direction, (cos(heading), sin(heading)))


def from_thrust_facing(direction: Vec3, facing: tuple[float, float]) -> Quat:
    """Return the attitude with body z along `direction` and body x as close as possible to
    `facing`, the cosine and sine of the heading.

    Body y is normal to both and body x completes the frame (Mellinger and Kumar, ICRA 2011, eq.
    6-8).
    """
    x, y, z = direction
    cx, sx = facing
    n = hypot(x, y, z)
    zx, zy, zz = x / n, y / n, z / n
    yx, yy, yz = -sx * zz, cx * zz, sx * zx - cx * zy
    n = hypot(yx, yy, yz)
    yx, yy, yz = yx / n, yy / n, yz / n
    xx, xy, xz = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    return _from_matrix(xx, xy, xz, yx, yy, yz, zx, zy, zz)


def from_axes(x: Vec3, y: Vec3, z: Vec3) -> Quat:
    """Return the attitude whose orthonormal body axes are `x`, `y` and `z` in the world frame."""
    return _from_matrix(*x, *y, *z)


def _from_matrix(
    xx: float, xy: float, xz: float,
    yx: float, yy: float, yz: float,
    zx: float, zy: float, zz: float,
) -> Quat:  # fmt: skip
    """Return the attitude whose body axes x, y, z have these world coordinates (Shepperd's
    method)."""
    trace = xx + yy + zz
    if trace > 0.0:
        s = 2.0 * sqrt(1.0 + trace)
        return (0.25 * s, (yz - zy) / s, (zx - xz) / s, (xy - yx) / s)
    if xx > yy and xx > zz:
        s = 2.0 * sqrt(1.0 + xx - yy - zz)
        return ((yz - zy) / s, 0.25 * s, (yx + xy) / s, (zx + xz) / s)
    if yy > zz:
        s = 2.0 * sqrt(1.0 + yy - xx - zz)
        return ((zx - xz) / s, (yx + xy) / s, 0.25 * s, (yz + zy) / s)
    s = 2.0 * sqrt(1.0 + zz - xx - yy)
    return ((xy - yx) / s, (zx + xz) / s, (yz + zy) / s, 0.25 * s)


def integrate(q: Quat, rate: Vec3, dt: float) -> Quat:
    """Return the attitude `q` after `dt` seconds at the constant body rate `rate` (rad/s), to first
    order and renormalised."""
    w, x, y, z = q
    rx, ry, rz = rate
    half = 0.5 * dt
    hx, hy, hz = half * rx, half * ry, half * rz
    nw = w - x * hx - y * hy - z * hz
    nx = x + w * hx + y * hz - z * hy
    ny = y + w * hy + z * hx - x * hz
    nz = z + w * hz + x * hy - y * hx
    n = hypot(nw, nx, ny, nz)
    return (nw / n, nx / n, ny / n, nz / n)
