"""Refuses poses that a vehicle can't have: the gate of all estimators that use poses or positions.

The reference is the estimate on which the vehicle flies, if it is another estimator's and at most
0.1 s old; otherwise it is the last pose that passed, extrapolated for at most 0.25 s. With the
reference's spread s, and t the seconds since its newest measurement, a pose passes if it is within

    gate + 4 s + a t^2 / 2,   a = 5 m/s^2,   but at most `widest`

of the reference's position, and within 45 degrees of its attitude. 4 m/s t more are allowed while
the estimator's velocity is not known yet. This refuses reflections, and a body that was exchanged
with one further away than `widest`.

The reference itself may be wrong, because dead reckoning drifts. So the gate opens for refused
poses once

    they have been consistent (`PoseTrack`) for `AGREEING_S`, without a gap of
    `MAX_GAP_S`, and
    the first of them was within the formula above, without `widest`, of the last pose that passed,
    so that the vehicle can have got there.

After that it no longer compares poses with the estimate on which the vehicle flies, until this is
the estimator's own. Poses that pass by the formula, but are refused by the filter because its
spread is too small, need to be consistent for `NEARBY_S` only, so that an IMU that has just
failed doesn't cost the position. Poses that have jumped to where they are now must be consistent
for `ANEW_S`. Poses that jumped to where the vehicle can't be stay refused, and so do poses
after a gap that are nearer to them than to the reference. Radar confirms tracks in the same way, by
measurements that are consistent with one another rather than with the old track (S. Blackman and R.
Popoli, "Design and Analysis of Modern Tracking Systems", 1999), and so do EKF2 of PX4 and EKF3 of
ArduPilot when they reset to a position that they have refused for too long.

The first pose passes, and so does every later one that lies elsewhere, until `samples` poses have
passed in a row, so that a wrong pose at the start locks nothing out. On the ground the vehicle may
be carried away unseen, so any poses pass again once they have been consistent for `settled` seconds
in which the vehicle flew on no other estimate. In the air this can't happen: a vehicle without an
estimate has landed long before.
"""

from __future__ import annotations

from math import acos, dist, pi, sin
from typing import Generic, NamedTuple, TypeVar

from kybflow.core.geometry import Quat, Vec3, add, distance, scale, sub
from kybflow.core.signals import NS, Estimate, Pose, Time

AGREEING_POSES = 3
"""Consistent observations in a row that rule out a coincidence."""
REACH_STEP, REACH_SPEED = 0.15, 4.0
REACH_TURN, REACH_TURN_RATE = 0.8, 12.0
_ALIGNED_DISTANCE = 2.0 * sin(0.25 * REACH_TURN)
"""The distance between two quaternions whose rotations differ by `REACH_TURN`."""

T = TypeVar("T")


class Consistent(Generic[T]):
    """A series of observations, each consistent with the one before it."""

    __slots__ = ("seen",)

    def __init__(self) -> None:
        self.seen: list[T] = []

    def forget(self) -> None:
        self.seen = []

    def confirmed(self, observation: T) -> T | None:
        """Add an observation. Once there are `AGREEING_POSES` of them, return the first and clear
        the series; otherwise return None."""
        self.seen.append(observation)
        if len(self.seen) < AGREEING_POSES:
            return None
        first = self.seen[0]
        self.seen = []
        return first


def reach(seconds: float) -> float:
    """Return how far a vehicle can move in this time, metres."""
    return REACH_STEP + REACH_SPEED * seconds


def unexplained(last: Pose, pose: Pose) -> tuple[float, float] | None:
    """Return None if a flight from `last` to `pose` is possible. Otherwise return how far they are
    apart and how far they may be, in metres or, if only the attitude differs too much, in
    radians."""
    off = distance(pose.position, last.position)
    if off <= REACH_STEP and dist(pose.attitude, last.attitude) <= _ALIGNED_DISTANCE:
        return None  # the usual case
    seconds = (pose.time - last.time) / NS
    most = reach(seconds)
    if off > most:
        return off, most
    a, b, c, d = pose.attitude
    e, f, g, h = last.attitude
    turned = 2.0 * acos(min(1.0, abs(a * e + b * f + c * g + d * h)))
    most = min(REACH_TURN + REACH_TURN_RATE * seconds, pi)
    return (turned, most) if turned > most else None


class PoseTrack:
    """Tracks a body by its poses alone: which poses a flight explains, and where the body jumped.

    A flight explains a change from one pose to another, t seconds later, that is within

        REACH_STEP + REACH_SPEED t           in position, and
        REACH_TURN + REACH_TURN_RATE t     in attitude.

    A pose that no flight explains is a reflection or another error. `AGREEING_POSES` such poses in
    a row that are consistent with one another are a jump; the track then restarts at the first of
    them. (Radar starts tracks in the same way: S. Blackman and R. Popoli, "Design and Analysis of
    Modern Tracking Systems", 1999, on track confirmation.) Metres, seconds, radians.

    first, last: the body's first and last pose.
    """

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
                elsewhere.forget()
            return None
        if elsewhere.seen and unexplained(elsewhere.seen[-1], pose) is not None:
            elsewhere.forget()
        first = elsewhere.confirmed(pose)
        if first is not None:
            self.first, self.last = first, pose
        return first


ACCELERATION = 5.0
LOOK_AHEAD = 0.25
CURRENT_AGE_NS = NS // 10
SAME_ATTITUDE = 0.9239
"""Cosine of half of 45 degrees: the least dot product of two quaternions that count as equal."""
UNKNOWN_PACE = 4.0
AGREEING_S, ANEW_S, MAX_GAP_S = 0.3, 1.0, 0.5
NEARBY_S = 0.1


class Reference(NamedTuple):
    """The expected pose of the vehicle at the time of a measured pose. time: the time of the newest
    measurement in it. spread: its standard deviation, m. pace: the largest error of its velocity,
    m/s."""

    time: Time
    position: Vec3
    attitude: Quat
    spread: float
    pace: float


class Bounds(NamedTuple):
    """The parameters of a gate, metres and seconds."""

    gate: float
    widest: float
    settled: float
    agreed: float = AGREEING_S


class Refusal(NamedTuple):
    """Poses are refused. since: the time of the first refused pose. reason: a description of the
    cause."""

    since: Time
    reason: str


class PoseGate:
    """The gate of one estimator. flown: the newest estimate of another estimator on which the
    vehicle flew. refusal: why poses are refused, None while they pass; fewer than `AGREEING_POSES`
    refused poses in a row don't count."""

    __slots__ = (
        "_barred", "_count", "_is_open", "_is_possible", "_newest", "_track", "_wait", "flown",
        "refusal",
    )  # fmt: skip

    def __init__(self) -> None:
        self.flown: Estimate | None = None
        self.refusal: Refusal | None = None
        self._is_open = False
        self._track = PoseTrack()
        self._newest: Time = 0
        self._count = 0
        self._wait = AGREEING_S
        self._is_possible = False
        self._barred: Pose | None = None

    def current(self, time: Time) -> Estimate | None:
        """Return the other estimator's estimate if the vehicle flies on it at `time` and the gate
        hasn't opened against it; otherwise None."""
        flown = self.flown
        if flown is None or abs(time - flown.time) > CURRENT_AGE_NS:
            self._is_open = False
            return None
        return None if self._is_open else flown

    def passes(self, pose: Pose, reference: Reference, bounds: Bounds) -> bool:
        """Return whether the vehicle can have this pose. If not, call `opened`."""
        most = min(_reachable(pose, reference, bounds), bounds.widest)
        if distance(pose.position, reference.position) > most:
            return False
        return is_same(pose.attitude, reference.attitude)

    def passed(self, time: Time) -> None:
        """Record that a pose passed. Must be called while there is a `refusal`."""
        if time - self._newest >= AGREEING_S * NS:
            self.refusal = None

    def opened(
        self, pose: Pose, reference: Reference, own: Reference | None, bounds: Bounds
    ) -> Vec3 | None:
        """Record a pose that didn't pass. If the gate opens for it and those before it, return the
        velocity at which they moved; otherwise None. own: like `reference`, but always extrapolated
        from the last pose that passed; None before the first."""
        self._note(pose, reference, own, bounds)
        first, last = self._track.first, self._track.last
        if first is None or last is not pose:
            return None  # one pose alone begins no track
        since = first.time if self.flown is None else max(first.time, self.flown.time)
        wait = min(self._wait, NEARBY_S) if self.passes(pose, reference, bounds) else self._wait
        agree = self._count >= AGREEING_POSES and pose.time - first.time >= wait * NS
        if not (self._is_possible and agree) and pose.time - since < bounds.settled * NS:
            if self.refusal is None and self._count >= AGREEING_POSES:
                self.refusal = Refusal(first.time, _reason(pose, reference, bounds))
            return None
        self.refusal, self._is_open, self._track = None, True, PoseTrack()
        seconds = (pose.time - first.time) / NS
        return scale(sub(pose.position, first.position), 1.0 / seconds)

    def _note(
        self, pose: Pose, reference: Reference, own: Reference | None, bounds: Bounds
    ) -> None:
        """Continue the track of refused poses, or begin a new one."""
        last, newest, self._newest = self._track.last, self._newest, pose.time
        has_passed = own is not None and own.time > newest
        if last is None or has_passed or pose.time - newest > MAX_GAP_S * NS:
            self._track, self._count, self._wait = PoseTrack(), 1, bounds.agreed
            self._track.follow(pose)
            barred = None if has_passed else self._barred
            self._is_possible = _may_begin(pose, own, bounds) and not (
                barred is not None
                and distance(pose.position, barred.position)
                < distance(pose.position, reference.position)
            )
        elif self._track.follow(pose) is not None:
            self._count, self._wait = AGREEING_POSES, max(bounds.agreed, ANEW_S)
            self._is_possible = _may_begin(pose, own, bounds)
        elif self._track.last is pose:
            self._count += 1
            self._is_possible = self._is_possible or (
                own is not None and self.passes(pose, own, bounds)
            )
        if self._track.last is pose:
            self._barred = None if self._is_possible else pose


def seen_from(flown: Estimate, time: Time) -> Reference:
    """Return another estimator's estimate as the reference at `time`; its spread includes its
    age."""
    position = add(flown.position, scale(flown.velocity, (time - flown.time) / NS))
    return Reference(time, position, flown.attitude, flown.spread, 0.0)


def is_same(a: Quat, b: Quat) -> bool:
    """Return whether two attitudes are within 45 degrees of each other."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return abs(aw * bw + ax * bx + ay * by + az * bz) >= SAME_ATTITUDE


def _reachable(pose: Pose, reference: Reference, bounds: Bounds) -> float:
    """Return how far the vehicle can have flown from the reference, metres."""
    t = (pose.time - reference.time) / NS
    return bounds.gate + 4.0 * reference.spread + t * (reference.pace + 0.5 * ACCELERATION * t)


def _may_begin(pose: Pose, own: Reference | None, bounds: Bounds) -> bool:
    """Return whether the vehicle can have flown to the first of the refused poses."""
    if own is None or distance(pose.position, own.position) > _reachable(pose, own, bounds):
        return False
    return pose.time - own.time > LOOK_AHEAD * NS or is_same(pose.attitude, own.attitude)


def _reason(pose: Pose, reference: Reference, bounds: Bounds) -> str:
    off = distance(pose.position, reference.position)
    most = min(_reachable(pose, reference, bounds), bounds.widest)
    if off > most:
        return f"{off:.2f} m from the estimate, {most:.2f} m allowed"
    if not is_same(pose.attitude, reference.attitude):
        return "turned by more than 45 deg from the estimated attitude"
    return f"{off:.2f} m from the estimate, more than the spreads explain"
