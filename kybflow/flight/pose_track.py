"""Tracks a body by its poses alone: which of them a flight explains, and where it jumped.

A flight explains how a body came from one pose to a later one, t seconds after it, within

    STEP + SPEED t        of its place, and
    TURN + RATE t         of its attitude.

A pose that no flight explains is a reflection or another error; `CONFIRMED` of them in a row that
agree with one another are a jump, after which the track begins anew at the first of them. (Tracks
are begun so in radar: S. Blackman and R. Popoli, "Design and Analysis of Modern Tracking Systems",
1999, on track confirmation.) Metres, seconds, radians.
"""

from __future__ import annotations

from math import acos, dist, pi, sin
from typing import Generic, TypeVar

from kybflow.core.geometry import distance
from kybflow.core.signals import NS, Pose

CONFIRMED = 3
"""Observations in a row that rule out a coincidence."""
STEP, SPEED = 0.15, 4.0
TURN, RATE = 0.8, 12.0
_ALIGNED = 2.0 * sin(0.25 * TURN)
"""The distance of two quaternions whose rotations are `TURN` apart."""

T = TypeVar("T")


class Consistent(Generic[T]):
    """Observations in a row, each of which can follow the one before."""

    __slots__ = ("seen",)

    def __init__(self) -> None:
        self.seen: list[T] = []

    def confirmed(self, observation: T) -> T | None:
        """Add one; return the first of them once there are `CONFIRMED`, and begin anew."""
        self.seen.append(observation)
        if len(self.seen) < CONFIRMED:
            return None
        first = self.seen[0]
        self.seen = []
        return first


def reach(seconds: float) -> float:
    """Return how far a vehicle can get in that time, metres."""
    return STEP + SPEED * seconds


def unexplained(last: Pose, pose: Pose) -> tuple[float, float] | None:
    """Return how far `pose` is from `last` and how far it may be, in metres or else in radians;
    None if a flight explains it."""
    off = distance(pose.position, last.position)
    if off <= STEP and dist(pose.attitude, last.attitude) <= _ALIGNED:
        return None  # as nearly always
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
    """The track of one body. first, last: its poses at the beginning and at the end."""

    __slots__ = ("_elsewhere", "first", "last")

    def __init__(self) -> None:
        self.first: Pose | None = None
        self.last: Pose | None = None
        self._elsewhere: Consistent[Pose] = Consistent()

    def follow(self, pose: Pose) -> Pose | None:
        """Add a later pose; if the body jumped, return the first pose after the jump."""
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
