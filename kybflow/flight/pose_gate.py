"""Which poses a vehicle can have: the others belong to another body, or to none.

Reference: the estimate that the vehicle flies on where that is another's (not older than 0.1 s),
else the last pose that passed, gone on for at most 0.25 s. With s the reference's spread and t the
seconds since its newest measurement, a pose passes within

    gate + 4 s + a t^2 / 2,   a = 5 m/s^2,   but at most `widest`

of it, and within 45 degrees of its attitude; within 4 m/s t more while the own velocity is not
known yet. So a body that was exchanged with one further away
than `widest` is not taken for the vehicle as long as anything in the vehicle knows where it is, nor
afterwards; the vehicle's own body is, when it comes back, whatever the time.

The first pose passes, and so does every later one that lies elsewhere, until `samples` poses have
come that passed one after another: a wrong pose at the start keeps nobody out. On the ground the
vehicle may be carried away unseen. Poses elsewhere pass again once they have been consistent (0.1 m
plus 2 m/s apart, no gap over 0.5 s) for `settled` seconds in which no other estimate was flown on.
In the air that can't happen: without an estimate a vehicle is on the ground long before.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import Quat, Vec3, add, distance, scale
from kybflow.core.signals import NS, Estimate, Pose, Time

ACCELERATION = 5.0
LOOK_AHEAD = 0.25
CURRENT = NS // 10
SAME_ATTITUDE = 0.9239
"""Cosine of half of 45 degrees: the least product of two quaternions that are the same."""
UNKNOWN_PACE = 4.0
STEP, PACE, BREAK = 0.1, 2.0, 0.5


class Reference(NamedTuple):
    """Where the vehicle is believed to be at the time of a pose. time: when the newest measurement
    in it was true. pace: by how much its velocity may be wrong, m/s."""

    time: Time
    position: Vec3
    attitude: Quat
    spread: float
    pace: float


class PoseGate:
    """`flown` is the newest estimate of another that the vehicle flew on."""

    __slots__ = ("_first", "_last", "flown")

    def __init__(self) -> None:
        self.flown: Estimate | None = None
        self._first: Pose | None = None
        self._last: Pose | None = None

    def current(self, time: Time) -> Estimate | None:
        """The other's estimate where the vehicle flies on it at `time`."""
        flown = self.flown
        return None if flown is None or abs(time - flown.time) > CURRENT else flown

    def passes(self, pose: Pose, reference: Reference, gate: float, widest: float) -> bool:
        """Whether the vehicle can be where `pose` is."""
        t = (pose.time - reference.time) / NS
        beside = 4.0 * reference.spread + t * (reference.pace + 0.5 * ACCELERATION * t)
        if distance(pose.position, reference.position) > min(gate + beside, widest):
            return False
        return is_same(pose.attitude, reference.attitude)

    def settled(self, pose: Pose, seconds: float) -> bool:
        """Take note of a pose that does not pass; whether such ones have been consistent for so
        long, and nothing else was flown on."""
        last, self._last = self._last, pose
        if last is None or not _follows(last, pose):
            self._first = None
        if self._first is None:
            self._first = pose
        begin = self._first.time
        if self.flown is not None:
            begin = max(begin, self.flown.time)
        return pose.time - begin >= seconds * NS


def seen_from(flown: Estimate, time: Time) -> Reference:
    """Another's estimate as the reference at `time`; its spread holds all that its age costs."""
    position = add(flown.position, scale(flown.velocity, (time - flown.time) / NS))
    return Reference(time, position, flown.attitude, flown.spread, 0.0)


def is_same(a: Quat, b: Quat) -> bool:
    """Whether two attitudes are within 45 degrees of each other."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    return abs(aw * bw + ax * bx + ay * by + az * bz) >= SAME_ATTITUDE


def _follows(last: Pose, pose: Pose) -> bool:
    dt = (pose.time - last.time) / NS
    return dt <= BREAK and distance(last.position, pose.position) <= STEP + PACE * dt
