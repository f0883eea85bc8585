"""The forces of four rotors on their body in one physics step.

Each rotor has a control u and a state a, both fractions (0 to 1) of its largest thrust F, which
depends on the battery. The state follows the control with first-order lag, solved exactly over a
step of dt:

    a' = a + (1 - exp(-dt / T)) (u - a);  thrust f = F a along body z

Its drag torque is `torque_ratio` f about body z, counterclockwise for the first and third rotor.
Rotor drag along body x and y is d m (wind - velocity). Air that moves along body z changes the
rotors' inflow and so their thrust, by the same formula with another d.
"""

from __future__ import annotations

from math import exp, sqrt

from kybflow.drivers.sim.model import BuiltAirframe
from kybflow.drivers.sim.steps.onboard import Numbers
from kybflow.world.vehicle_context import Airframe


def constants(airframe: Airframe, body: BuiltAirframe, inflow: float, dt: float) -> Numbers:
    """Return a vehicle's constants for `push`: distance of each rotor from the body's x and y axes;
    ratio of torque to thrust; ratio of drag to airspeed in the rotors' plane, and along body z
    (`inflow` times as large); fraction of a change that a rotor follows in a step."""
    return (
        airframe.arm / sqrt(2.0),
        airframe.torque_ratio,
        body.drag * body.mass,
        inflow * body.drag * body.mass,
        1.0 - exp(-dt / body.rotor_time),
    )


def push(
    position: Numbers,
    velocity: Numbers,
    rotors: Numbers,
    controls: Numbers,
    thrust: Numbers,
    wind: Numbers,
    more: Numbers,
    constants: Numbers,
) -> tuple[Numbers, Numbers, Numbers]:
    """Return the force on the body (world frame) and the torque about its origin (body frame), as
    MuJoCo applies them at a free joint; the rotation from body to world, row by row; and the
    rotors' states after the step. position, velocity: those of the free joint. thrust: largest
    thrust of each rotor, N. wind: in body axes. more: additional force and torque, in the same
    frames as those returned."""
    _, _, _, w, x, y, z = position
    vx, vy, vz, _, _, _ = velocity
    a, b, c, d = rotors
    i, j, k, m = controls
    fa, fb, fc, fd = thrust
    windx, windy, windz = wind
    px, py, pz, tx, ty, tz = more
    half, ratio, drag, inflow, gain = constants
    x2, y2, z2 = x + x, y + y, z + z
    wx, wy, wz = w * x2, w * y2, w * z2
    xx, xy, xz = x * x2, x * y2, x * z2
    yy, yz, zz = y * y2, y * z2, z * z2
    r00, r01, r02 = 1.0 - yy - zz, xy - wz, xz + wy
    r10, r11, r12 = xy + wz, 1.0 - xx - zz, yz - wx
    r20, r21, r22 = xz - wy, yz + wx, 1.0 - xx - yy
    fx = drag * (windx - r00 * vx - r10 * vy - r20 * vz)
    fy = drag * (windy - r01 * vx - r11 * vy - r21 * vz)
    fa, fb, fc, fd = fa * a, fb * b, fc * c, fd * d
    fz = fa + fb + fc + fd + inflow * (windz - r02 * vx - r12 * vy - r22 * vz)
    return (
        (
            r00 * fx + r01 * fy + r02 * fz + px,
            r10 * fx + r11 * fy + r12 * fz + py,
            r20 * fx + r21 * fy + r22 * fz + pz,
            half * (fa + fb - fc - fd) + tx,
            half * (fb + fc - fa - fd) + ty,
            ratio * (fa - fb + fc - fd) + tz,
        ),
        (r00, r01, r02, r10, r11, r12, r20, r21, r22),
        (a + gain * (i - a), b + gain * (j - b), c + gain * (k - c), d + gain * (m - d)),
    )
