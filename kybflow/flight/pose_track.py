"""Tracks a body by its poses alone: which poses a flight explains, and where the body jumped.

A flight explains a change from one pose to another, t seconds later, that is within

    STEP + SPEED t        in position, and
    TURN + RATE t         in attitude.

A pose that no flight explains is a reflection or another error. `CONFIRMED` such poses in a row
that are consistent with one another are a jump; the track then starts anew at the first of them.
(Radar starts tracks in the same way: S. Blackman and R. Popoli, "Design and Analysis of Modern
Tracking Systems", 1999, on track confirmation.) Metres, seconds, radians.
"""

from __future__ import annotations

from math import acos, dist, pi, sin
from typing import Generic, TypeVar

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Pose

CONFIRMED = 3
"""Consistent observations in a row that rule out a coincidence."""
STEP, SPEED = 0.15, 4.0
TURN, RATE = 0.8, 12.0
_ALIGNED = 2.0 * sin(0.25 * TURN)
"""The distance between two quaternions whose rotations differ by `TURN`."""

T = TypeVar("T")


class Consistent(Generic[T]):
    """A series of observations, each consistent with the one before it."""

    __slots__ = ("seen",)

    def __init__(self) -> None:
        self.seen: list[T] = []

    def confirmed(self, observation: T) -> T | None:
        """Add an observation. Once there are `CONFIRMED` of them, return the first and clear the
        series; otherwise return None."""
        self.seen.append(observation)
        if len(self.seen) < CONFIRMED:
            return None
        first = self.seen[0]
        self.seen = []
        return first


def reach(seconds: float) -> float:
    """Return how far a vehicle can move in this time, metres."""
    return STEP + SPEED * seconds


def unexplained(last: Pose, pose: Pose) -> tuple[float, float] | None:
    """Return None if a flight from `last` to `pose` is possible. Otherwise return how far they are
    apart and how far they may be, in metres or, if only the attitude differs too much, in
    radians."""
    off = distance(pose.position, last.position)
    if off <= STEP and dist(pose.attitude, last.attitude) <= _ALIGNED:
        return None  # the usual case
    seconds = (pose.time - last.time) / NS
    most = reach(seconds)
    if off > most:
        return off, most
    a, b, c, d = pose.attitude
    e, f, g, h = last.attitude
    turned = 2.0 * acos(min(1.0, abs(a * e + b * f + c * g + d * h)))
    most = min(TURN + RATE * seconds, pi)
    return (turned, most) if turned > most else None


class PoseTrack:
    """The track of one body. first, last: its first and its last pose."""

    __slots__ = ("_elsewhere", "first", "last")

    def __init__(self) -> None:
        self.first: Pose | None = None
        self.last: Pose | None = None
        self._elsewhere: Consistent[Pose] = Consistent()

    def follow(self, pose: Pose) -> Pose | None:
        """Add a later pose. If the body jumped, return the first pose after the jump, otherwise
        None."""
        last, elsewhere = self.last, self._elsewhere
        if last is None or unexplained(last, pose) is None:
            self.last = pose
            if last is None:
                self.first = pose
            if elsewhere.seen:
                elsewhere.seen = []
            return None
        if elsewhere.seen and unexplained(elsewhere.seen[-1], pose) is not None:
            elsewhere.seen = []
        first = elsewhere.confirmed(pose)
        if first is not None:
            self.first, self.last = first, pose
        return first
