"""Bounds a velocity so that it always stops in time: before the fence and before obstacles.

With d the room that is left to a surface and n its normal into the free space, the speed towards it
is at most

    -v . n <= sqrt(2 a (d - a / (4 k^2))),    linear, k d, over the last a / (2 k^2),

the deceleration being a = 1 m/s^2 and k = 2 1/s; where no room is left it is zero. What is too much
is taken away along each normal in turn, so that a vehicle slides along what it is pushed against;
what then still asks for more, in a corner, slows the whole. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, dot, scale
from kybflow.world.shapes import Box

_STOPPING, _GAIN = 1.0, 2.0
_LINEAR = 0.5 * _STOPPING / _GAIN**2
_ROUNDS = 4
_INWARD: tuple[Vec3, ...] = (
    (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0),
)  # fmt: skip


class Surface(NamedTuple):
    """A surface to stay away from: the room that is left, and its outward normal."""

    room: float
    normal: Vec3


def stopping_speed(room: float) -> float:
    """Return the largest speed towards something that is `room` away."""
    if room <= _LINEAR:
        return _GAIN * max(room, 0.0)
    return sqrt(2.0 * _STOPPING * (room - 0.5 * _LINEAR))


def reach_of(speed: float) -> float:
    """Return the distance from which on a surface bounds no velocity of `speed`."""
    return speed * speed / (2.0 * _STOPPING) + _LINEAR


def walls(position: Vec3, box: Box) -> tuple[Surface, ...]:
    """Return the faces of a box around `position`: of each axis the low one, then the high one."""
    x, y, z = position
    x0, y0, z0 = box.low
    x1, y1, z1 = box.high
    rooms = (x - x0, x1 - x, y - y0, y1 - y, z - z0, z1 - z)
    return tuple(map(Surface, rooms, _INWARD))


def bounded(velocity: Vec3, surfaces: Iterable[Surface]) -> Vec3:
    """Return the velocity that stops before each of the surfaces."""
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
