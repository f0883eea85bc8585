"""Geometric position control on SE(3), which feeds the jerk forward, for an on-board attitude loop.

Lee, Leok and McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010, in two
halves: the force and its direction here, the attitude error on board. With e = p - p_des and
e' = v - v_des, world frame, the wanted specific force is

    f = a_des + g e3 - P e - D e' - I integral(e) + c (v_des - (v_des . z) z)

the last two as in `cascade`: the integral is horizontal, and c gives back the rotors' drag, which
acts in the rotor plane (z: the body's z axis). Thrust is the mass times f along the estimated body
z; the attitude has its z axis along f. Body rates are the ones at which that attitude turns, from

    f' = j_des - P e' - D e'' + c a_des,       e'' = a - a_des

where a is the acceleration that the last thrust gives along the estimated body z, less drag and g:
the jerk and the feedback turn the vehicle, where `cascade` has the jerk alone. About body z it
turns as the heading asks. A VELOCITY setpoint has no P and I term.

Errors on the figure eight (width 1.46 m, two laps after 3 s of hovering; mean and largest over ten
seeds, position in cm, velocity in cm/s), each tracker as it comes:

    airframe   lap    cascade                     geometric
    mk_quadro  10 s   0.21, 0.40   0.32, 0.83     0.12, 0.26   0.27, 0.79
               7 s    0.30, 0.56   0.45, 1.20     0.18, 0.36   0.32, 0.85
               5 s    0.40, 0.73   0.69, 1.69     0.24, 0.47   0.40, 1.05
               4 s    0.50, 1.42   1.61, 5.81     0.37, 1.10   1.23, 5.94
    nano_plus  10 s   0.21, 0.41   0.30, 0.94     0.13, 0.27   0.27, 0.79
               7 s    0.31, 0.58   0.44, 1.07     0.19, 0.38   0.31, 0.83
               5 s    0.41, 0.76   0.73, 1.83     0.26, 0.49   0.40, 1.21
               4 s    0.52, 1.76   1.61, 6.68     0.46, 1.49   1.42, 7.32

A lap of 4 s needs the airframes' whole tilt. With the gains of this one `cascade` comes as near
(0.13, 0.27 cm at 10 s), but shakes: 0.39, 1.28 cm/s.

Limits, mass and the trim against the on-board attitude's error: `kybflow.flight.steering`.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from kybflow.core.geometry import GRAVITY, ZERO, Quat, Vec3, body_z, conjugate, heading_of, rotate
from kybflow.core.signals import Command, Estimate, Setpoint, SetpointKind, Tick
from kybflow.core.units import Number
from kybflow.parts import param, params
from kybflow.runtime.trackers._steered import Steered, SteeredParams


@params
class GeometricParams(SteeredParams):
    proportional: Number = param("Acceleration per metre of position error.", default=16.0, above=0)
    derivative: Number = param("Acceleration per m/s of velocity error.", default=9.0, above=0)
    integral: Number = param(
        "Acceleration per metre and second of position error.", default=8.0, at_least=0
    )


class Geometric(Steered[GeometricParams]):
    """See the module."""

    accepts = frozenset({SetpointKind.POSITION, SetpointKind.VELOCITY})

    def update(self, setpoint: Setpoint, tick: Tick) -> Command:
        estimate, dt, steering, p = tick.known(), tick.dt, self._steering, self.params
        steering.weigh(setpoint, estimate, p.lift_off, dt)
        up = body_z(estimate.attitude)
        wanted, turning = self._wanted(setpoint, estimate, up, dt)
        force = steering.bounded(wanted, p.tilt)
        attitude = steering.attitude(force, up, setpoint, p.trim, dt)
        still = steering.limited or not steering.flies
        rates = _rates(ZERO if still else turning, force, attitude, setpoint.heading_rate)
        return steering.command(force, attitude, rates, estimate, up)

    def _wanted(
        self, setpoint: Setpoint, estimate: Estimate, up: Vec3, dt: float
    ) -> tuple[Vec3, Vec3]:
        """(f, f'): the specific force that the law asks for and how it changes, world."""
        p, c = self.params, self._drag
        (ux, uy, uz), (vx, vy, vz) = up, estimate.velocity
        (wx, wy, wz), (ax, ay, az) = setpoint.velocity or ZERO, setpoint.acceleration or ZERO
        jx, jy, jz = setpoint.jerk or ZERO
        d, push = p.derivative, self._steering.force_along
        slip = vx * ux + vy * uy + vz * uz
        ex = push * ux - c * (vx - slip * ux) - ax
        ey = push * uy - c * (vy - slip * uy) - ay
        ez = push * uz - c * (vz - slip * uz) - GRAVITY - az
        turning = (jx - d * ex + c * ax, jy - d * ey + c * ay, jz - d * ez)
        along = wx * ux + wy * uy + wz * uz
        fx = ax + d * (wx - vx) + c * (wx - along * ux)
        fy = ay + d * (wy - vy) + c * (wy - along * uy)
        fz = az + d * (wz - vz) + c * (wz - along * uz) + GRAVITY
        ix, iy = self._integral
        if setpoint.position is not None:
            k = p.proportional
            (sx, sy, sz), (px, py, pz) = setpoint.position, estimate.position
            ix, iy = self._integrated(sx - px, sy - py, dt)
            fx, fy, fz = fx + k * (sx - px), fy + k * (sy - py), fz + k * (sz - pz)
            tx, ty, tz = turning
            turning = (tx + k * (wx - vx), ty + k * (wy - vy), tz + k * (wz - vz))
        return (fx + ix, fy + iy, fz), turning

    def _integrated(self, ex: float, ey: float, dt: float) -> tuple[float, float]:
        if self._steering.learns:
            i, most, (ix, iy) = (
                self.params.integral * dt,
                self.params.integral_limit,
                self._integral,
            )
            self._integral = (
                min(max(ix + i * ex, -most), most),
                min(max(iy + i * ey, -most), most),
            )
        return self._integral


def _rates(turning: Vec3, force: Vec3, attitude: Quat, heading_rate: float) -> Vec3:
    """Body rates at which the attitude along `force` turns when that changes by `turning`.

    About body x and y: z' = (f' - (f' . z) z) / |f|. About body z: the body's y stays normal to the
    level direction h of the heading, y . h = 0, so
    w_z = (w_x (h . z) + heading_rate (y . (e3 x h))) / (h . x).
    """
    fx, fy, fz = force
    per_force = 1.0 / sqrt(fx * fx + fy * fy + fz * fz)
    inverse = conjugate(attitude)
    tx, ty, _ = rotate(inverse, turning)
    wx, wy = -ty * per_force, tx * per_force
    heading = heading_of(attitude)
    c, s = cos(heading), sin(heading)
    hx, _, hz = rotate(inverse, (c, s, 0.0))
    _, ny, _ = rotate(inverse, (-s, c, 0.0))
    return (wx, wy, (wx * hz + heading_rate * ny) / hx)
