"""A hand that moves a simulated vehicle, as a person does: roughly as asked, and never quite still.

A movement follows a minimum-jerk profile (Flash and Hogan, J. Neuroscience 1985), 10 s^3 - 15 s^4 +
6 s^5, with s from 0 to 1. The direction of a displacement and the axis of a rotation are off
by up to 30 degrees. Sway (below 1 Hz) and tremor (7 to 10 Hz) are added. The hand then pushes and
turns the body like a critically damped spring, at the rate at which disturbances change.
"""

from __future__ import annotations

import random
from math import cos, pi, sin
from typing import NamedTuple

from kybflow.core.geometry import (
    GRAVITY,
    LEVEL,
    UP,
    ZERO,
    Quat,
    Vec3,
    add,
    conjugate,
    cross,
    from_heading,
    integrate,
    multiply,
    norm,
    rotate,
    scale,
    sub,
)
from kybflow.core.signals import Truth
from kybflow.core.units import DEG
from kybflow.drivers.sim.steps.onboard import Numbers

MOST_ASTRAY, MOST_YAW = 30.0 * DEG, 10.0 * DEG
"""Largest angles of a displacement and of a rotation's axis from what was asked for, and of a turn
about the vertical beside it, rad."""
SHORTEST_S, LONGEST_S = 0.9, 1.6
"""Bounds of a movement's duration, s."""
SWAY, SWAY_TURN = 0.003, 1.0 * DEG
TREMOR, TREMOR_TURN = 0.0002, 0.15 * DEG
"""Amplitudes along and about each axis, m and rad."""
STIFFNESS = 12.0
"""Natural frequency of the hand's hold, rad/s."""
_STEP = 0.005


class _Move(NamedTuple):
    """A movement by `way` (m, world frame) and `turn` (rotation vector, rad, body frame)."""

    way: Vec3
    turn: Vec3
    begins: float
    lasts: float

    def share(self, t: float) -> float:
        """Return how much of the movement is done at a time, 0 to 1."""
        s = min(1.0, max(0.0, (t - self.begins) / self.lasts))
        return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)


class CarryingHand:
    """A hand that holds a vehicle from its present place on. All randomness is from `generator`."""

    def __init__(self, at: Vec3, attitude: Quat, generator: random.Random) -> None:
        self._generator = generator
        self._place, self._attitude = at, attitude
        self._move = _Move(ZERO, ZERO, 0.0, 1.0)
        self._grasped: float | None = None
        draw = generator.uniform
        self._waves = [
            [(draw(0.2, 0.8), draw(0.0, 2 * pi)), (draw(7.0, 10.0), draw(0.0, 2 * pi))]
            for _ in range(6)
        ]

    def move(self, way: Vec3, turn: Vec3, t: float) -> None:
        """After a short time, move by about `way` (m, world frame) and turn by about `turn`
        (rotation vector, rad, body frame)."""
        draw = self._generator.uniform
        self._place, self._attitude = self._goal(t)
        begins = t + draw(0.4, 0.9)
        self._grasped = begins if self._grasped is None else self._grasped
        if way != ZERO:
            aside = cross(way, (draw(-1.0, 1.0), draw(-1.0, 1.0), draw(-1.0, 1.0)))
            astray = draw(0.0, MOST_ASTRAY)
            straight, off = scale(way, cos(astray)), scale(aside, norm(way) / norm(aside))
            way = scale(add(straight, scale(off, sin(astray))), draw(0.8, 1.25))
        askew = from_heading(draw(-MOST_ASTRAY, MOST_ASTRAY))
        turn = scale(rotate(askew, turn), draw(0.85, 1.2))
        turn = add(turn, (0.0, 0.0, draw(-MOST_YAW, MOST_YAW)))
        self._move = _Move(way, turn, begins, draw(SHORTEST_S, LONGEST_S))

    def pose(self, t: float) -> tuple[Vec3, Quat]:
        """Return where the hand holds the vehicle at a time."""
        place, attitude = self._goal(t)
        if self._grasped is None or t <= self._grasped:
            return place, attitude
        grip = _Move(ZERO, ZERO, self._grasped, 0.5).share(t)
        shaken = [
            grip * (sway * sin(2 * pi * slow * t + a) + tremor * sin(2 * pi * quick * t + b))
            for (sway, tremor), ((slow, a), (quick, b)) in zip(
                [(SWAY, TREMOR)] * 3 + [(SWAY_TURN, TREMOR_TURN)] * 3, self._waves, strict=True
            )
        ]
        x, y, z, rx, ry, rz = shaken
        return add(place, (x, y, z)), integrate(attitude, (rx, ry, rz), 1.0)

    def push(self, truth: Truth, t: float, mass: float, inertia: Vec3) -> Numbers:
        """Return the force (N, world frame) and the torque (N m, body frame) on a vehicle."""
        if self._grasped is None or t <= self._grasped:
            return (0.0,) * 6
        (before, past), (place, attitude) = self.pose(t - _STEP), self.pose(t)
        after, coming = self.pose(t + _STEP)
        velocity = scale(sub(after, before), 0.5 / _STEP)
        gained = scale(add(sub(after, place), sub(before, place)), 1.0 / _STEP**2)
        k, d = STIFFNESS**2, 2.0 * STIFFNESS
        held = add(scale(sub(place, truth.position), k), scale(sub(velocity, truth.velocity), d))
        fx, fy, fz = scale(add(add(gained, held), scale(UP, GRAVITY)), mass)
        turning = scale(_between(past, coming), 0.5 / _STEP)
        askew = _between(truth.attitude, attitude)
        x, y, z = add(scale(askew, k), scale(sub(turning, truth.angular_velocity), d))
        jx, jy, jz = inertia
        return (fx, fy, fz, jx * x, jy * y, jz * z)

    def _goal(self, t: float) -> tuple[Vec3, Quat]:
        """Return the pose at a time without sway and tremor."""
        way, turn, _, _ = self._move
        share = self._move.share(t)
        x, y, z = scale(turn, 0.5 * share)
        n = norm((x, y, z))
        turned = LEVEL if not n else (cos(n), *scale((x, y, z), sin(n) / n))
        return add(self._place, scale(way, share)), multiply(self._attitude, turned)


def _between(first: Quat, second: Quat) -> Vec3:
    """Return the rotation vector from one attitude to a near one, rad, body frame."""
    w, x, y, z = multiply(conjugate(first), second)
    return scale((x, y, z), 2.0 if w >= 0.0 else -2.0)
