"""Rotations and vectors as tuples of floats, and the only frame conversions.

World frame ENU, body frame FLU (REP 103). Quaternions are (w, x, y, z), unit length, body to world:
`rotate(q, v)` takes a body vector to the world. Angles in radians. Plain floats, because a NumPy
array costs ten times as much as the arithmetic on three numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from math import acos, asin, atan2, cos, dist, pi, sin, sqrt

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

ZERO: Vec3 = (0.0, 0.0, 0.0)
LEVEL: Quat = (1.0, 0.0, 0.0, 0.0)
GRAVITY = 9.81


def add(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a: Vec3, s: float) -> Vec3:
    return (a[0] * s, a[1] * s, a[2] * s)


def dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def norm(a: Vec3) -> float:
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


distance: Callable[[Vec3, Vec3], float] = dist


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + pi) % (2 * pi) - pi


def multiply(a: Quat, b: Quat) -> Quat:
    """Hamilton product: first `b`, then `a`."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(q: Quat) -> Quat:
    return (q[0], -q[1], -q[2], -q[3])


def rotate(q: Quat, v: Vec3) -> Vec3:
    """`v` from the body to the world."""
    (w, x, y, z), (vx, vy, vz) = q, v
    tx = 2.0 * (y * vz - z * vy)
    ty = 2.0 * (z * vx - x * vz)
    tz = 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


def body_z(q: Quat) -> Vec3:
    """The body's z axis (where thrust points) in the world."""
    w, x, y, z = q
    return (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))


def heading_of(q: Quat) -> float:
    """Heading: the angle of the body's x axis about world z, from world x (east), counter-
    clockwise."""
    w, x, y, z = q
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def tilt_of(q: Quat) -> float:
    """The angle between the body's z axis and the world's."""
    c = 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2])
    return acos(-1.0 if c < -1.0 else 1.0 if c > 1.0 else c)


def from_heading(heading: float) -> Quat:
    return (cos(heading / 2), 0.0, 0.0, sin(heading / 2))


def from_euler(roll: float, pitch: float, yaw: float) -> Quat:
    """Intrinsic z-y-x (yaw, pitch, roll), REP 103."""
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
    """(roll, pitch, yaw); pitch in [-pi/2, pi/2]."""
    w, x, y, z = q
    s = 2.0 * (w * y - z * x)
    return (
        atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        asin(-1.0 if s < -1.0 else 1.0 if s > 1.0 else s),
        atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )


def from_thrust_direction(direction: Vec3, heading: float) -> Quat:
    """The attitude whose z axis is `direction` (need not be unit length, z > 0) and whose heading
    is `heading`.

    The shortest rotation from world z to `direction`, after a turn about z that leaves the heading
    as asked (Mellinger and Kumar, ICRA 2011, eq. 6-8, in quaternion form).
    """
    x, y, z = direction
    n = sqrt(x * x + y * y + z * z)
    zx, zy, zz = x / n, y / n, z / n
    cx, sx = cos(heading), sin(heading)
    # body y is normal to the thrust direction and to the wanted heading; body x completes the frame
    yx, yy, yz = -sx * zz, cx * zz, sx * zx - cx * zy
    yn = sqrt(yx * yx + yy * yy + yz * yz)
    yx, yy, yz = yx / yn, yy / yn, yz / yn
    xx, xy, xz = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    return from_axes((xx, xy, xz), (yx, yy, yz), (zx, zy, zz))


def from_axes(x: Vec3, y: Vec3, z: Vec3) -> Quat:
    """The rotation whose columns are `x`, `y`, `z` (orthonormal), by Shepperd's method."""
    trace = x[0] + y[1] + z[2]
    if trace > 0.0:
        s = 2.0 * sqrt(1.0 + trace)
        return (0.25 * s, (y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s)
    if x[0] > y[1] and x[0] > z[2]:
        s = 2.0 * sqrt(1.0 + x[0] - y[1] - z[2])
        return ((y[2] - z[1]) / s, 0.25 * s, (y[0] + x[1]) / s, (z[0] + x[2]) / s)
    if y[1] > z[2]:
        s = 2.0 * sqrt(1.0 + y[1] - x[0] - z[2])
        return ((z[0] - x[2]) / s, (y[0] + x[1]) / s, 0.25 * s, (z[1] + y[2]) / s)
    s = 2.0 * sqrt(1.0 + z[2] - x[0] - y[1])
    return ((x[1] - y[0]) / s, (z[0] + x[2]) / s, (z[1] + y[2]) / s, 0.25 * s)


def integrate(q: Quat, rate: Vec3, dt: float) -> Quat:
    """`q` after turning at the body rate `rate` for `dt`: first order, renormalised."""
    w, x, y, z = q
    (rx, ry, rz), half = rate, 0.5 * dt
    hx, hy, hz = half * rx, half * ry, half * rz
    nw = w - x * hx - y * hy - z * hz
    nx = x + w * hx + y * hz - z * hy
    ny = y + w * hy + z * hx - x * hz
    nz = z + w * hz + x * hy - y * hx
    n = sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    return (nw / n, nx / n, ny / n, nz / n)
