"""Bounds a velocity so that it always stops in time: before the fence and before obstacles.

With d the room that is left to a surface and n its normal into the free space, the speed towards it
is at most

    -v . n <= sqrt(2 a (d - a / (4 k^2))),    linear, k d, over the last a / (2 k^2),

the deceleration being a = 1 m/s^2 and k = 2 1/s; where no room is left it is zero. What is too much
is taken away along each normal in turn, so that a vehicle slides along what it is pushed against;
what then still asks for more, in a corner, slows the whole. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, add, dot, norm, scale
from kybflow.world.shapes import Box, Shape

_STOPPING, _GAIN = 1.0, 2.0
_LINEAR = 0.5 * _STOPPING / _GAIN**2
_ROUNDS = 4
_STEP = 1e-4


class Surface(NamedTuple):
    """Something to stay away from: the room that is left to it, and the way out of it."""

    room: float
    normal: Vec3


def stopping_speed(room: float) -> float:
    """Return the largest speed towards something that is `room` away."""
    if room <= _LINEAR:
        return _GAIN * max(room, 0.0)
    return sqrt(2.0 * _STOPPING * (room - 0.5 * _LINEAR))


def walls(position: Vec3, box: Box) -> Iterator[Surface]:
    """Yield the faces of a box around `position`."""
    for i in range(3):
        for face, inward in ((box.low[i], 1.0), (box.high[i], -1.0)):
            x, y, z = (inward if i == axis else 0.0 for axis in range(3))
            yield Surface(inward * (position[i] - face), (x, y, z))


def solids(position: Vec3, shapes: Iterable[Shape], keep: float, speed: float) -> Iterator[Surface]:
    """Yield the shapes that a vehicle at `position` must slow down for at `speed` (m/s), which it
    keeps away from."""
    for shape in shapes:
        room = shape.distance(position) - keep
        if stopping_speed(room) < speed:
            yield Surface(room, _outward(shape, position))


def _outward(shape: Shape, p: Vec3) -> Vec3:
    """The direction in which the distance from `shape` grows fastest."""
    x, y, z = p
    slope = (
        shape.distance((x + _STEP, y, z)) - shape.distance((x - _STEP, y, z)),
        shape.distance((x, y + _STEP, z)) - shape.distance((x, y - _STEP, z)),
        shape.distance((x, y, z + _STEP)) - shape.distance((x, y, z - _STEP)),
    )
    length = norm(slope)
    return scale(slope, 1.0 / length) if length > 0.0 else (0.0, 0.0, 1.0)


def bounded(velocity: Vec3, surfaces: Iterable[Surface]) -> Vec3:
    """Return the velocity that stops before each of the surfaces."""
    bounds = [(stopping_speed(room), normal) for room, normal in surfaces]
    for _ in range(_ROUNDS):
        for allowed, normal in bounds:
            excess = -dot(velocity, normal) - allowed
            if excess > 0.0:
                velocity = add(velocity, scale(normal, excess))
    share = 1.0
    for allowed, normal in bounds:
        closing = -dot(velocity, normal)
        if closing > allowed:
            share = min(share, allowed / closing)
    return velocity if share == 1.0 else scale(velocity, share)
