"""What is wrong with a body of motion capture, told apart by its poses alone, whatever gives them.

stale: no pose for longer than a bound, or than three of the stream's own intervals where that is
longer. frozen: fresh stamps, but bit by bit the same pose while the vehicle is in the air; noise
and motion make that impossible for a body that is seen. On the ground nothing is said of it: what
stands still may be measured without noise, as a simulator can. jumped: further from the last pose
than

    step + speed * t,   t = seconds since the last pose, at most `memory`

(or turned further than `turn` + `rate` * t), and the next poses go on from there; a single one is a
reflection, and no finding. swapped: the same, but to where another body was: within
`near` + `pace` * t of its last place, or of the one it has just left.

In the air, a pose that is the one before it bit by bit is no measurement and is withheld, from the
first on, so that an estimate ages from when its body froze, not from when that is told; once it was
told, also on the ground, until the pose changes. All others pass: whether the vehicle can be there
is for the estimators to say (`kybflow.flight.pose_gate`).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, cos, isfinite
from typing import NamedTuple

from kybflow.core.geometry import distance
from kybflow.core.signals import NEVER, NS, Pose, Time

STALE, FROZE, JUMPED, SWAPPED, RECOVERED = (
    "body_lost",
    "body_froze",
    "body_jumped",
    "body_swapped",
    "body_recovered",
)


class Bounds(NamedTuple):
    """Seconds, metres, m/s, radians, rad/s. unknown: in place of `stale` until three poses have
    come. confirmed: so many poses that follow one another make a jump, or an end of being stale or
    frozen."""

    stale: float = 0.25
    unknown: float = 0.6
    frozen: float = 0.5
    step: float = 0.15
    speed: float = 4.0
    turn: float = 0.8
    rate: float = 12.0
    memory: float = 0.25
    near: float = 0.15
    pace: float = 2.0
    confirmed: int = 3


class Finding(NamedTuple):
    """Something that was found of a body at `time`. value, bound: seconds without a new pose;
    metres (or, for a turn, radians) off. other: whose place a swapped body took."""

    time: Time
    body: str
    event: str
    value: float = 0.0
    bound: float = 0.0
    other: str = ""


class Bodies:
    """The bodies of a fleet."""

    def __init__(self, bounds: Bounds = Bounds()) -> None:  # noqa: B008 - immutable
        self._bounds = bounds
        self._near = bounds.step**2
        self._aligned = cos(0.5 * bounds.turn)
        self._bodies: dict[str, _Body] = {}

    def judge(
        self, name: str, poses: Sequence[Pose], now: Time, in_air: bool = True
    ) -> tuple[list[Pose], list[Finding]]:
        """The new poses of a body, oldest first: those that are measurements, and what is found.
        To be asked whenever poses have come, and without any from `due` on. in_air: whether its
        vehicle is."""
        body = self._bodies.get(name)
        if body is None:
            body = self._bodies[name] = _Body(now)
        passed: list[Pose] = []
        findings: list[Finding] = []
        for pose in poses:
            if not _is_sound(pose) or pose.time <= body.stamp:
                continue
            body.come(pose.time)
            if body.repeats(pose, in_air):
                self._froze(name, body, findings)
            else:
                passed.append(pose)
                self._follow(name, body, pose, findings)
        bound, newest = self._patience(body), max(body.stamp, body.began)
        body.due = newest + round(bound * NS)
        age = (now - newest) / NS
        if age > bound and body.wrong != STALE:
            body.wrong, body.good = STALE, 0
            findings.append(Finding(now, name, STALE, age, bound))
        return passed, findings

    def due(self, name: str) -> Time:
        """When a body is stale should nothing come; to be asked once it was judged."""
        return self._bodies[name].due

    def _patience(self, body: _Body) -> float:
        if body.interval is None:
            return self._bounds.unknown
        return max(self._bounds.stale, 3.0 * body.interval)

    def _froze(self, name: str, body: _Body, findings: list[Finding]) -> None:
        since = (body.stamp - body.changed) / NS
        if since > self._bounds.frozen and body.wrong != FROZE:
            body.wrong = FROZE
            findings.append(Finding(body.stamp, name, FROZE, since, self._bounds.frozen))
        body.good = 0

    def _follow(self, name: str, body: _Body, pose: Pose, findings: list[Finding]) -> None:
        """A pose that is a new one: does the body recover, did it jump?"""
        body.good += 1
        if body.wrong and body.good >= self._bounds.confirmed:
            body.wrong = ""
            findings.append(Finding(pose.time, name, RECOVERED))
        place, elsewhere = body.place, body.elsewhere
        if place is None or self._off(place, pose) is None:
            body.place, body.elsewhere = pose, []
            return
        if elsewhere and self._off(elsewhere[-1], pose) is not None:
            elsewhere.clear()
        elsewhere.append(pose)
        if len(elsewhere) < self._bounds.confirmed:
            return
        first = elsewhere[0]
        value, bound = self._off(place, first) or (0.0, 0.0)
        other = self._whose(name, first)
        event = SWAPPED if other else JUMPED
        findings.append(Finding(first.time, name, event, value, bound, other))
        body.left, body.place, body.elsewhere = place, pose, []

    def _off(self, last: Pose, pose: Pose) -> tuple[float, float] | None:
        """By how much, and how much can be, where no flight explains how it came there."""
        (x, y, z), (u, v, w) = pose.position, last.position
        (a, b, c, d), (e, f, g, h) = pose.attitude, last.attitude
        product = abs(a * e + b * f + c * g + d * h)
        if (x - u) ** 2 + (y - v) ** 2 + (z - w) ** 2 <= self._near and product >= self._aligned:
            return None  # as nearly always
        return self._how_far_off(last, pose, product)

    def _how_far_off(self, last: Pose, pose: Pose, product: float) -> tuple[float, float] | None:
        b = self._bounds
        t = min((pose.time - last.time) / NS, b.memory)
        off, most = distance(pose.position, last.position), b.step + b.speed * t
        if off > most:
            return off, most
        turned, most = 2.0 * acos(min(1.0, product)), b.turn + b.rate * t
        return (turned, most) if turned > most else None

    def _whose(self, name: str, pose: Pose) -> str:
        """The other body that was where `pose` is, the nearest one; empty when none was."""
        best, whose = 1.0, ""
        for other, body in self._bodies.items():
            for place in () if other == name else (body.place, body.left):
                t = 0.0 if place is None else abs(pose.time - place.time) / NS
                if place is None or t > self._bounds.memory:
                    continue
                room = self._bounds.near + self._bounds.pace * t
                share = distance(pose.position, place.position) / room
                if share < best:
                    best, whose = share, other
        return whose


class _Body:
    """What is remembered of one. stamp: of its newest pose. interval: the shorter of the last two
    between poses, seconds, None before. due: when it is stale should nothing come. changed: since
    when, in the air, the pose is the same. place: where it is believed, left: where it was before
    it jumped, elsewhere: poses that may become a jump. good: new poses since something was
    wrong."""

    __slots__ = (
        "_before", "_last", "began", "changed", "due", "elsewhere", "good", "interval", "left",
        "place", "stamp", "wrong",
    )  # fmt: skip

    def __init__(self, now: Time) -> None:
        self.began = self.due = now
        self.stamp: Time = -NEVER
        self.changed: Time = 0
        self.place: Pose | None = None
        self.left: Pose | None = None
        self.elsewhere: list[Pose] = []
        self.wrong = ""
        self.good = 0
        self.interval: float | None = None
        self._before: float | None = None
        self._last: Pose | None = None

    def come(self, stamp: Time) -> None:
        """A pose of this time is new."""
        if self._last is not None:
            passed = (stamp - self.stamp) / NS
            if self._before is not None:
                self.interval = min(passed, self._before)
            self._before = passed
        self.stamp = stamp

    def repeats(self, pose: Pose, in_air: bool) -> bool:
        """Take note of a pose; whether it is the one before it, bit by bit, and must not be."""
        last, self._last = self._last, pose
        same = last is not None and last[1:] == pose[1:]
        if same and (in_air or self.wrong == FROZE):
            return True
        self.changed = pose.time
        return False


def _is_sound(pose: Pose) -> bool:
    (x, y, z), (a, b, c, d) = pose.position, pose.attitude
    return 0.8 < a * a + b * b + c * c + d * d < 1.25 and isfinite(x + y + z)
