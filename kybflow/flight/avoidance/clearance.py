"""Bounds a velocity so that the vehicle can always stop before the fence and before obstacles.

With d the room left before a surface and n its normal into free space, the speed towards it is at
most

    -v . n <= sqrt(2 a (d - a / (4 k^2))),    linear, k d, over the last a / (2 k^2),

with the deceleration a = 1 m/s^2 and k = 2 1/s; without room it is zero. The excess is removed
along each normal in turn, so that a vehicle slides along a surface that it is pushed against; if
that is not enough, as in a corner, the whole velocity is scaled down. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, dot, scale
from kybflow.world.shapes import Box

_DECELERATION, _GAIN = 1.0, 2.0
_LINEAR = 0.5 * _DECELERATION / _GAIN**2
_ROUNDS = 4
_INWARD: tuple[Vec3, ...] = (
    (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
)  # fmt: skip


class Surface(NamedTuple):
    """A surface to stay away from. room: the distance left before it. normal: its outward
    normal."""

    room: float
    normal: Vec3


def stopping_speed(room: float) -> float:
    """Return the largest speed (m/s) towards something that is `room` metres away."""
    if room <= _LINEAR:
        return _GAIN * max(room, 0.0)
    return sqrt(2.0 * _DECELERATION * (room - 0.5 * _LINEAR))


def reach_of(speed: float) -> float:
    """Return the distance (m) beyond which a surface doesn't limit a velocity of `speed` (m/s)."""
    return speed * speed / (2.0 * _DECELERATION) + _LINEAR


def walls(position: Vec3, box: Box) -> tuple[Surface, ...]:
    """Return the faces of the box around `position`: for each axis the low one, then the high
    one."""
    x, y, z = position
    x0, y0, z0 = box.low
    x1, y1, z1 = box.high
    rooms = (x - x0, x1 - x, y - y0, y1 - y, z - z0, z1 - z)
    return tuple(map(Surface, rooms, _INWARD))


def bounded(velocity: Vec3, surfaces: Iterable[Surface]) -> Vec3:
    """Return the velocity, reduced so that the vehicle can stop before each surface."""
    bounds = [(stopping_speed(room), normal) for room, normal in surfaces]
    for _ in range(_ROUNDS):
        before = velocity
        for allowed, normal in bounds:
            excess = -dot(velocity, normal) - allowed
            if excess > 0.0:
                velocity = add(velocity, scale(normal, excess))
        if velocity is before:
            return velocity
    share = 1.0
    for allowed, normal in bounds:
        closing = -dot(velocity, normal)
        if closing > allowed:
            share = min(share, allowed / closing)
    return velocity if share == 1.0 else scale(velocity, share)
