"""Monitors motion-capture bodies. It uses only their poses, and so works for any system.

lost: no pose for longer than a bound, or than three intervals of the stream if that is longer.
froze: new time stamps with bit-identical poses while the vehicle is in the air, which noise and
motion make impossible for a tracked body. On the ground this counts only if the poses have wavered
there before, as real ones do: if the take-off were not measured, the vehicle would keep climbing.
Poses that have never wavered come from a simulator without noise.
jumped: three consecutive poses are at positions that the vehicle cannot have reached by flight
since the last pose (`kybflow.flight.pose_gate`).
swapped: the body jumped to within `near` + `pace` t of the position at which another body was t
seconds before, or of the position that the other body has just left; or the body returns after more
than `MEMORY_S` at the position of another vehicle's estimate. Its poses are then withheld
until it jumps again or is lost.

A repeated pose is not a measurement. In the air even the first repetition is withheld, so that the
estimate ages from the time when the body froze, not from the report. On the ground repetitions are
withheld only if the poses have wavered before or the body was reported as frozen. All other poses
are passed on: the estimators decide whether the vehicle can be there (`kybflow.flight.pose_gate`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from math import dist, inf
from typing import NamedTuple

from kybflow.core.events import VehicleEvent
from kybflow.core.geometry import ZERO, Quat, Vec3, distance
from kybflow.core.signals import NEVER, NS, Estimate, Measurement, Pose, Time
from kybflow.dsl.plan import VehiclePlan
from kybflow.flight.pose_gate import AGREEING_POSES, PoseTrack, unexplained
from kybflow.parts.events import BodyFroze, BodyJumped, BodyLost, BodyRecovered, BodySwapped
from kybflow.runtime.events import Events


class Trouble:
    """The fault of one motion-capture body or camera.

    A single odd observation is a measurement error. `AGREEING_POSES` consecutive observations that
    agree with one another are a jump (`kybflow.flight.pose_gate.PoseTrack`); as many consecutive
    good observations end a fault. A jump to the position of another vehicle is a swap (`nearest`).

    finding: the present fault, or None. good: the number of consecutive good observations so far.
    """

    __slots__ = ("finding", "good")

    def __init__(self) -> None:
        self.finding: VehicleEvent | None = None
        self.good = 0

    def found(self, finding: VehicleEvent) -> VehicleEvent:
        """Set the present fault; return it."""
        self.finding = finding
        return finding

    def count_anew(self) -> None:
        """Reset the count of good observations after a bad one."""
        self.good = 0

    def is_known(self, event: type[VehicleEvent]) -> bool:
        """Return whether the present fault is of this kind."""
        return isinstance(self.finding, event)

    def is_over(self) -> bool:
        """Count a good observation; return whether it ends the fault."""
        self.good += 1
        if self.finding is None or self.good < AGREEING_POSES:
            return False
        self.finding = None
        return True


def nearest(position: Vec3, others: Iterable[tuple[str, Vec3, float]]) -> str:
    """Return the name of the vehicle that was at `position` (m), empty if none was. others: for
    each vehicle its name, its position and the radius within which it counts as being there. Of
    several, the one whose distance is the smallest fraction of its radius is returned."""
    best, whose = 1.0, ""
    for vehicle, place, room in others:
        share = distance(position, place) / room
        if share < best:
            best, whose = share, vehicle
    return whose


WAVERING_POSES = 30
"""Number of consecutive poses on the ground, each slightly off the previous one, that prove the
measurement to be noisy."""
STILL_DISTANCE = 0.01
"""Largest distance (m) between two consecutive poses of a vehicle that stands still."""
MEMORY_S = 0.25
"""Seconds for which the last position of a body is taken into account."""
_MEMORY = round(MEMORY_S * NS)
_NO_ATTITUDE: Quat = (0.0, 0.0, 0.0, 0.0)


class BodyBounds(NamedTuple):
    """The bounds of the findings. lost: seconds without a pose. unknown: replaces `lost` until
    three poses have arrived (s). frozen: seconds of identical poses. near (m), pace (m/s): the
    distance at which a body counts as swapped."""

    lost: float = 0.25
    unknown: float = 0.6
    frozen: float = 0.5
    near: float = 0.15
    pace: float = 2.0


class Bodies:
    """The bodies of a fleet."""

    def __init__(self, bounds: BodyBounds = BodyBounds()) -> None:  # noqa: B008 - immutable
        self._bounds = bounds
        self._lost, self._unknown = round(bounds.lost * NS), round(bounds.unknown * NS)
        self._bodies: dict[str, _Body] = {}
        self._believed: dict[str, Callable[[], Estimate | None]] = {}

    def know(self, name: str, estimate: Callable[[], Estimate | None]) -> None:
        """Register a vehicle. estimate: returns the estimate that the vehicle flies on."""
        self._believed[name] = estimate

    def judge(
        self, name: str, poses: Sequence[Pose], now: Time, airborne: bool = True
    ) -> tuple[list[Pose], list[VehicleEvent]]:
        """Judge the new poses of a body, oldest first; return the poses to pass on and the
        findings. Must be called whenever poses arrive, and from `due` on even without poses."""
        body = self._bodies.get(name)
        if body is None:
            body = self._bodies[name] = _Body(now)
        passed: list[Pose] = []
        findings: list[VehicleEvent] = []
        for pose in poses:
            if pose.time <= body.stamp or not _is_sound(pose):
                continue
            if body.repeats(pose, airborne):
                since, bound = (body.stamp - body.changed) / NS, self._bounds.frozen
                if since > bound and not body.trouble.is_known(BodyFroze):
                    findings.append(body.trouble.found(BodyFroze(value=since, bound=bound)))
                body.trouble.count_anew()
            else:
                self._follow(name, body, pose, findings)
                if not body.of:
                    passed.append(pose)
        newest = body.expect(self._unknown, self._lost)
        if now > body.due and not body.trouble.is_known(BodyLost):
            age, bound = (now - newest) / NS, (body.due - newest) / NS
            body.trouble.count_anew()
            findings.append(body.trouble.found(BodyLost(value=age, bound=bound)))
        return passed, findings

    def due(self, name: str) -> Time:
        """Return when a body counts as lost if no pose arrives. It must have been judged before."""
        return self._bodies[name].due

    def _follow(self, name: str, body: _Body, pose: Pose, findings: list[VehicleEvent]) -> None:
        """Process a new pose: detect a recovery, a jump or a swap."""
        if body.trouble.finding is not None and body.trouble.is_over():
            findings.append(BodyRecovered())
        last = body.track.last
        if last is not None and pose.time - last.time > _MEMORY:
            body.receive(self._believer(name, pose))
            if body.of:
                value, bound = distance(pose.position, last.position), self._bounds.near
                findings.append(BodySwapped(other=body.of, value=value, bound=bound))
        first = body.track.follow(pose)
        if first is None or last is None:
            return
        value, bound = unexplained(last, first) or (0.0, 0.0)
        other = nearest(first.position, self._others(name, first))
        findings.append(
            BodySwapped(other=other, value=value, bound=bound)
            if other
            else BodyJumped(value=value, bound=bound)
        )
        body.leave(last)
        body.receive(self._believer(name, first) if body.of else other)

    def _believer(self, name: str, pose: Pose) -> str:
        """Return the name of the other vehicle whose estimate is at `pose`; empty if there is none,
        or if the body's own vehicle is nearer."""
        believed = ((other, estimate()) for other, estimate in self._believed.items())
        near = self._bounds.near
        places = ((o, e.position, near + 4.0 * e.spread) for o, e in believed if e is not None)
        whose = nearest(pose.position, places)
        return "" if whose == name else whose

    def _others(self, name: str, pose: Pose) -> Iterator[tuple[str, Vec3, float]]:
        """Yield (name, position, radius) of the other bodies at about the time of `pose`, as
        `nearest` expects them."""
        for other, body in self._bodies.items():
            for place in () if other == name else (body.track.last, body.left):
                t = 0.0 if place is None else abs(pose.time - place.time) / NS
                if place is not None and t <= MEMORY_S:
                    yield other, place.position, self._bounds.near + self._bounds.pace * t


class _Body:
    """The state of one body.

    stamp: the time of its newest pose.
    interval: the shorter of the last two intervals between poses, None before the third pose.
    due: when the body is lost if no pose arrives.
    changed: when the pose last changed.
    left: its last pose before it jumped.
    of: the name of the vehicle whose poses this body receives, empty if they are its own.
    """

    __slots__ = (
        "_before", "_last", "_wavered", "began", "changed", "due", "interval", "left", "of",
        "stamp", "track", "trouble",
    )  # fmt: skip

    def __init__(self, now: Time) -> None:
        self.began = self.due = now
        self.stamp: Time = -NEVER
        self.changed: Time = 0
        self.track = PoseTrack()
        self.left: Pose | None = None
        self.of = ""
        self.trouble = Trouble()
        self.interval: Time | None = None
        self._before: Time | None = None
        self._last: Pose | None = None
        self._wavered = 0

    def receive(self, of: str) -> None:
        """Record the vehicle whose poses arrive from now on; empty if they are the body's own."""
        self.of = of

    def leave(self, last: Pose) -> None:
        """Record the last pose before a jump."""
        self.left = last

    def expect(self, unknown: Time, lost: Time) -> Time:
        """Set `due` to three intervals, but at least `lost`, after the last pose; or to `unknown`
        after it if the interval is not known yet. Return the time of the last pose, or of the
        beginning."""
        newest = self.stamp if self.stamp > self.began else self.began
        timeout = unknown
        if self.interval is not None:
            slow = 3 * self.interval
            timeout = slow if slow > lost else lost
        self.due = newest + timeout
        return newest

    def repeats(self, pose: Pose, airborne: bool) -> bool:
        """Process a newer pose; return whether it repeats the last one and must be withheld."""
        stamp, position, attitude = pose
        last, self._last = self._last, pose
        if last is not None:
            passed, before = stamp - self.stamp, self._before
            if before is not None:
                self.interval = passed if passed < before else before
            self._before = passed
        self.stamp = stamp
        same = last is not None and last.position == position and last.attitude == attitude
        if same and (
            airborne or self._wavered >= WAVERING_POSES or self.trouble.is_known(BodyFroze)
        ):
            return True
        if self._wavered < WAVERING_POSES and not airborne and last is not None:
            stands = not same and distance(last.position, position) < STILL_DISTANCE
            self._wavered = self._wavered + 1 if stands else 0
        self.changed = stamp
        return False


def _is_sound(pose: Pose) -> bool:
    norm = dist(pose.attitude, _NO_ATTITUDE)
    return 0.8 < norm * norm < 1.25 and distance(pose.position, ZERO) < inf


class BodyMonitor:
    """Emits the findings on one vehicle's body and withholds repeated poses. Poses
    that no estimator uses are judged too, but the body is then never reported as lost.

    bodies: judges the bodies of the whole fleet.
    estimate: returns the estimate that the vehicle flies on.
    due: when `measured` must be called even without poses.
    """

    def __init__(
        self,
        plan: VehiclePlan,
        bodies: Bodies,
        events: Events,
        estimate: Callable[[], Estimate | None],
    ) -> None:
        self._name, self._bodies, self._events = plan.name, bodies, events
        bodies.know(plan.name, estimate)
        parts = (estimator.part for estimator in plan.estimators)
        asking = [p.at for p in parts if Pose in p.cls.uses(p.params)]
        self._at = asking[0] if asking else plan.at
        self._is_needed = bool(asking)
        self.due: Time = 0 if asking else NEVER

    def measured(
        self, measurements: Sequence[Measurement], now: Time, airborne: bool
    ) -> Sequence[Measurement]:
        """Return the measurements without the poses that are withheld."""
        poses = [m for m in measurements if type(m) is Pose] if measurements else ()
        if not poses and now < self.due:
            return measurements
        passed, findings = self._bodies.judge(self._name, poses, now, airborne)
        if self._is_needed:
            self.due = self._bodies.due(self._name)
        for found in findings:
            self._events.emit(found, self._name, self._at)
        if len(passed) == len(poses):
            return measurements
        good = set(map(id, passed))
        return [m for m in measurements if type(m) is not Pose or id(m) in good]
