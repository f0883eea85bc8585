"""Fly the trajectory that an external planner sends, point by point, while it flies.

A point gives the position at a time of the run, with velocity, acceleration and heading
(`kybflow.core.signals.PlannedPoint`). It is sent as the command `track`, over the socket or by
`kybflow command`. Between two points the setpoint follows the quintic that matches the position,
velocity and acceleration of both; to the first point it starts from its current motion. Before the
first point it rests at the position of entry.

A velocity or acceleration that a point lacks is fitted when the vehicle sets out for the point, by
the splines of `follow_trajectory` through the points that have arrived by then, up to eight. The
last of these is passed with the speed of the curve if it is less than half a second after the one
before, as in a stream, and is otherwise reached at rest; to stop at the end of a stream, give its
last point the velocity zero.

A point is refused, with the reason, if it is not finite, not later than the last one, already past
(stale), more than `horizon` ahead, outside the fence, or so far from the last one that it requires
more than the airframe's speed. After the last point the vehicle brakes. The behavior fails after
`timeout` without a point to fly to. World frame, metres.
"""

from __future__ import annotations

from collections import deque
from itertools import islice
from math import isfinite
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, distance, norm, wrap
from kybflow.core.signals import NS, Failed, PlannedPoint, Setpoint, SetpointKind, Tick, Time
from kybflow.core.units import Duration
from kybflow.flight.motion import Coast, Motion
from kybflow.flight.trajectory import Knot, Quintic, vector_slopes
from kybflow.parts import AIR, Behavior, Entry, Footprint, param, params

_MOST_POINTS = 2000
_FITTED, _STREAMED = 8, 0.5
"""Largest number of future points to which a curve is fitted, and the time between the last two, s,
below which more are expected."""
_SPEED_FACTOR = 1.05
"""Largest mean speed to a point, as a multiple of the airframe's speed."""


@params
class TrajectoryInputParams:
    timeout: Duration = param(
        "Time to wait for a point, after which the behavior fails.", default=2.0, above=0.0
    )
    horizon: Duration = param(
        "Largest time that a point may be ahead.", default=10.0, above=0.0, at_most=600.0
    )


class _Knot(NamedTuple):
    """A point with its whole motion. time: seconds of the run. heading: as of a PlannedPoint."""

    time: float
    motion: Motion
    heading: float | None


class TrajectoryInput(
    Behavior[TrajectoryInputParams], flight=AIR >> AIR, emits=SetpointKind.POSITION
):
    def __init__(self, params: TrajectoryInputParams, entry: Entry) -> None:
        super().__init__(params, entry)
        self._context = entry.context
        self._points: deque[PlannedPoint] = deque()
        self._coast, self._coasts_since = Coast.after(entry.motion), entry.now / NS
        self._now, self._before = entry.now / NS, entry.motion
        self._from: _Knot | None = None
        self._to: _Knot | None = None
        self._heading, self._rate = entry.heading, 0.0

    def take(self, point: PlannedPoint, now: Time) -> str | None:
        reason = self._objection(point, now / NS)
        if reason is None:
            if self._from is None:
                self._from = _Knot(self._now, self._before, self._heading)
            self._points.append(point)
        return reason

    def _objection(self, point: PlannedPoint, now: float) -> str | None:
        velocity = point.velocity or ZERO
        numbers = (*point.position, *velocity, *(point.acceleration or ZERO), point.heading or 0.0)
        if not all(map(isfinite, (point.time, *numbers))):
            return "the point is not finite"
        if self._points and point.time <= self._points[-1].time:
            return f"it is not later than the last point, of {self._points[-1].time:.3f} s"
        if point.time <= now:
            return f"it is stale: the time is {now:.3f} s"
        if point.time > now + self.params.horizon or len(self._points) >= _MOST_POINTS:
            return f"it is {point.time - now:.1f} s ahead, {self.params.horizon:g} s are allowed"
        fence = self._context.fence
        if fence is not None and (outside := fence.outside_by(point.position)) > 0.0:
            return f"it is {outside:.2f} m outside the fence"
        start, since = self._before.position, now
        if self._points:
            start, since = self._points[-1].position, self._points[-1].time
        elif self._from is not None:
            start, since = self._from.motion.position, self._from.time
        speed = distance(start, point.position) / max(point.time - since, 1e-6)
        most = self._context.airframe.speed
        fastest = max(speed / _SPEED_FACTOR, norm(velocity))
        if fastest > most:
            return f"it needs {max(speed, norm(velocity)):.2f} m/s, {most:g} are allowed"
        return None

    def update(self, tick: Tick) -> Setpoint | Failed:
        self._now = now = tick.now / NS
        start = self._from
        while start is not None and self._points:
            if self._to is None:
                self._to = self._completed(start)
            if self._to.time > now:
                break
            self._points.popleft()
            self._from, self._to = self._to, None
            start = self._from
        if start is not None and self._to is not None:
            motion = self._between(start, self._to, now)
            self._coast, self._coasts_since = Coast.after(motion), now
            self.waits_for = None
        else:
            self._from, self._rate = None, 0.0
            motion = self._coast.at(now - self._coasts_since)
            self.waits_for = "a point of its trajectory"
        self._before = motion
        setpoint = motion.setpoint(self._heading, self._rate)
        if self.waits_for is not None and now - self._coasts_since > self.params.timeout:
            return Failed(setpoint, f"no point has arrived for {self.params.timeout:g} s")
        return setpoint

    def _completed(self, start: _Knot) -> _Knot:
        """Return the next point with its velocity and acceleration, fitted if it lacks them."""
        ahead = list(islice(self._points, _FITTED))
        time, position, velocity, acceleration, heading = ahead[0]
        if velocity is None or acceleration is None:
            times = [start.time, *(point.time for point in ahead)]
            goes_on = times[-1] - times[-2] < _STREAMED
            place, speed, pull, _ = start.motion
            places = [place, *(point.position for point in ahead)]
            fitted = vector_slopes(times, places, speed, goes_on=goes_on)
            speeds = [
                own if point.velocity is None else point.velocity
                for own, point in zip(fitted[1:], ahead, strict=True)
            ]
            velocity = speeds[0]
            if acceleration is None:
                pulls = vector_slopes(times, [speed, *speeds], pull, goes_on=goes_on)
                acceleration = pulls[1]
        return _Knot(time, Motion(position, velocity, acceleration), heading)

    def _between(self, a: _Knot, b: _Knot, now: float) -> Motion:
        span = b.time - a.time
        self._rate = 0.0
        if b.heading is not None:
            since = self._heading if a.heading is None else a.heading
            self._rate = wrap(b.heading - since) / span
            self._heading = wrap(since + self._rate * (now - a.time))
        axes = [
            Quintic.between(start, end, span).at(now - a.time)
            for start, end in zip(_axes(a.motion), _axes(b.motion), strict=True)
        ]
        position, velocity, acceleration, jerk = zip(*axes, strict=True)
        return Motion(position, velocity, acceleration, jerk)

    @classmethod
    def footprint(cls, params: TrajectoryInputParams, entry: Vec3 | None) -> Footprint | None:
        return Footprint(() if entry is None else (entry,), 0.0, None, is_endless=True)


def _axes(motion: Motion) -> list[Knot]:
    """Return the position, velocity and acceleration of a motion along each axis."""
    position, velocity, acceleration, _ = motion
    return [Knot(*axis) for axis in zip(position, velocity, acceleration, strict=True)]
