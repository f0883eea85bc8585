"""The frame of a formation: a point with a heading, both moving; places are defined in it. Also the
path of a vehicle in it, around the places that are taken (`clear_way`).

With the heading psi, its rate w, the position o(t) of a vehicle in the frame, and R the rotation by
psi,

    p = c + R o,    v = c' + w x R o + R o',
    a = c'' + w' x R o + w x (w x R o) + 2 w x R o' + R o''.

Each member moves its own frame by the same rule, and lets it drift towards the mean of the
published frames,

    c_i' = u + k (mean c_j - c_i),

so that differences in what members received don't last. World frame, metres, radians.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from math import atan2, cos, hypot, pi, sin, sqrt
from typing import NamedTuple

from kybflow.core.geometry import (
    ZERO,
    Vec3,
    add,
    distance,
    dot,
    least_distance,
    norm,
    scale,
    sub,
    wrap,
)
from kybflow.flight.avoidance.clearance import Surface, bounded, stopping_speed
from kybflow.flight.governor import shortened
from kybflow.flight.motion import MAX_SLOPE, Coast, Motion, smoothstep

CONSENSUS_RATE = 1.0
"""The rate k at which the members' frames converge, 1/s."""
_TURN_ACCELERATION = 4.0
"""The largest change of the turn rate, rad/s^2."""
_MAX_ACCELERATION = 2.5
"""The largest acceleration (m/s^2) that keeps a frame away from something."""
_DRIFT_SPEED = 0.3
"""The largest speed (m/s) at which a frame drifts towards the others."""
_SHARPEST = 10.0 / sqrt(3.0)
"""The largest second derivative of the smoothstep."""


class MovingFrame(NamedTuple):
    """The pose and motion of a formation's frame. rate: turn rate, rad/s. drift: the part of its
    velocity that only brings it towards the other members' frames, m/s. spin_up: the change of its
    turn rate, rad/s^2."""

    centre: Vec3
    velocity: Vec3 = ZERO
    acceleration: Vec3 = ZERO
    heading: float = 0.0
    rate: float = 0.0
    drift: Vec3 = ZERO
    spin_up: float = 0.0

    def after(self, dt: float) -> MovingFrame:
        """Return the frame `dt` seconds later if it continues to move in the same way."""
        (x, y, z), (vx, vy, vz), _, heading, rate, *_ = self
        ahead = (x + vx * dt, y + vy * dt, z + vz * dt)
        return self._replace(centre=ahead, heading=heading + rate * dt)

    def turned(self, vector: Vec3) -> Vec3:
        """Rotate a vector from the frame to the world."""
        c, s = cos(self.heading), sin(self.heading)
        x, y, z = vector
        return (c * x - s * y, s * x + c * y, z)

    def all_turned(self, vectors: Iterable[Vec3]) -> list[Vec3]:
        """Rotate vectors from the frame to the world."""
        c, s = cos(self.heading), sin(self.heading)
        return [(c * x - s * y, s * x + c * y, z) for x, y, z in vectors]

    def motion(self, place: Motion) -> Motion:
        """Return the motion, in the world frame, of a place that may itself move within the
        formation's frame."""
        w, k = self.rate, self.spin_up
        o, u, b = self.all_turned((place.position, place.velocity, place.acceleration))
        velocity = add(add(self.velocity, self.drift), (u[0] - w * o[1], u[1] + w * o[0], u[2]))
        turning = (
            -w * w * o[0] - 2.0 * w * u[1] - k * o[1],
            -w * w * o[1] + 2.0 * w * u[0] + k * o[0],
            0.0,
        )
        acceleration = add(self.acceleration, add(turning, b))
        return Motion(add(self.centre, o), velocity, acceleration)

    def place(self, motion: Motion) -> Motion:
        """Return the position and velocity, relative to the frame, of a motion in the world."""
        c, s, w = cos(self.heading), sin(self.heading), self.rate
        x, y, z = sub(motion.position, self.centre)
        u, v, r = sub(motion.velocity, self.velocity)
        u, v = u + w * y, v - w * x
        return Motion((c * x + s * y, c * y - s * x, z), (c * u + s * v, c * v - s * u, r))


class Shift:
    """A path in the frame from a vehicle's motion to its place. The vehicle's velocity is brought
    to rest while it moves from rest to rest within `duration` seconds.

    s(t) = S(t / T) with the quintic smoothstep S, whose largest slope is 15/8 and whose largest
    second derivative is 10/sqrt(3).
    """

    def __init__(self, start: Motion, place: Vec3, duration: float) -> None:
        self._coast = Coast.after(start)
        self._from, self._way = self._coast.end, sub(place, self._coast.end)
        self._span, self._place = duration, place
        self.duration = max(duration, self._coast.duration)

    @staticmethod
    def time_for(length: float, speed: float, acceleration: float) -> float:
        """Return the seconds that a path of this length needs within the limits."""
        return max(MAX_SLOPE * length / speed, sqrt(_SHARPEST * length / acceleration))

    def at(self, time: float) -> Motion:
        """Return the motion in the frame `time` seconds after the start."""
        if time >= self.duration:
            return Motion(self._place)
        way, span = self._way, self._span
        if time >= span or span <= 0.0:
            motion = Motion(self._place)
        else:
            _, value, slope, bend = smoothstep(max(time, 0.0) / span)
            motion = Motion(
                add(self._from, scale(way, value)),
                scale(way, slope / span),
                scale(way, bend / (span * span)),
            )
        return motion.plus(self._coast.shift(time)) if time < self._coast.duration else motion


class FrameLimits(NamedTuple):
    """How fast a frame may move and turn: horizontal and vertical speed, m/s, turn rate, rad/s, and
    acceleration, m/s^2."""

    speed: float
    climb: float
    turn_rate: float
    acceleration: float


class Asked(NamedTuple):
    """The requested motion of a frame: a velocity in the world and a turn rate."""

    velocity: Vec3 = ZERO
    rate: float = 0.0


def moved(
    frame: MovingFrame,
    asked: Asked,
    limits: FrameLimits,
    dt: float,
    mean: MovingFrame | None = None,
    reach: float = 0.0,
    near: Sequence[tuple[Vec3, Surface]] = (),
) -> MovingFrame:
    """Return the frame one tick later. mean: the current mean of all members' frames. reach: the
    largest distance of a place from the frame's axis, metres. near: surfaces near a place, each
    with the position of the place relative to the centre, in the axes of the world."""
    x, y, z = asked.velocity
    level = shortened((x, y, 0.0), limits.speed)
    wanted = (level[0], level[1], max(-limits.climb, min(limits.climb, z)))
    change = shortened(sub(wanted, frame.velocity), limits.acceleration * dt)
    wanted, surfaces = add(frame.velocity, change), [surface for _, surface in near]
    if surfaces:
        wanted = bounded(wanted, surfaces)
        change = shortened(sub(wanted, frame.velocity), _MAX_ACCELERATION * dt)
    velocity = add(frame.velocity, change)
    rate = _turning(frame, asked.rate, limits, reach, near, dt)
    drift, turn = ZERO, 0.0
    if mean is not None:
        drift = shortened(scale(sub(mean.centre, frame.centre), CONSENSUS_RATE), _DRIFT_SPEED)
        turn = CONSENSUS_RATE * wrap(mean.heading - frame.heading)
    if surfaces:
        drift = bounded(drift, surfaces)
    step = add(scale(add(frame.velocity, velocity), 0.5 * dt), scale(drift, dt))
    return MovingFrame(
        add(frame.centre, step),
        velocity,
        scale(change, 1.0 / dt) if dt > 0.0 else ZERO,
        wrap(frame.heading + (rate + turn) * dt),
        rate,
        drift,
        (rate - frame.rate) / dt if dt > 0.0 else 0.0,
    )


def _turning(
    frame: MovingFrame,
    asked: float,
    limits: FrameLimits,
    reach: float,
    near: Sequence[tuple[Vec3, Surface]],
    dt: float,
) -> float:
    """Return the turn rate in the next tick. No place circles faster than the frame may move, nor
    towards a surface faster than half of the speed that can stop before it; none is accelerated by
    the turn more than the frame may be."""
    most = limits.turn_rate if reach <= 0.0 else min(limits.turn_rate, limits.speed / reach)
    step = _step(limits.acceleration, reach) * dt
    rate = frame.rate + _clipped(_clipped(asked, most) - frame.rate, step)
    share = 1.0
    for (x, y, _), (room, normal) in near if rate != 0.0 else ():
        closing = -dot((-rate * y, rate * x, 0.0), normal)
        allowed = 0.5 * stopping_speed(room)
        if closing > allowed:
            share = min(share, allowed / closing)
    if share == 1.0:
        return rate
    return frame.rate + _clipped(rate * share - frame.rate, _step(_MAX_ACCELERATION, reach) * dt)


def _step(acceleration: float, reach: float) -> float:
    """Return the change of the turn rate (rad/s^2) that accelerates the outermost place so much."""
    return min(_TURN_ACCELERATION, acceleration / reach) if reach > 0.0 else _TURN_ACCELERATION


def _clipped(value: float, most: float) -> float:
    return max(-most, min(most, value))


def mean_frame(frames: Sequence[MovingFrame]) -> MovingFrame:
    """Return the mean of one or more frames, with zero acceleration and drift."""
    n = float(len(frames))
    c = s = rate = 0.0
    centre, velocity = ZERO, ZERO
    for frame in frames:
        centre, velocity = add(centre, frame.centre), add(velocity, frame.velocity)
        c, s, rate = c + cos(frame.heading), s + sin(frame.heading), rate + frame.rate
    return MovingFrame(
        scale(centre, 1.0 / n), scale(velocity, 1.0 / n), ZERO, mean_heading(c, s), rate / n
    )


def mean_heading(c: float, s: float) -> float:
    """Return the mean of headings from the sums of their cosines and sines; zero if it is
    undefined."""
    return atan2(s, c) if hypot(c, s) > 1e-6 else 0.0


def distance_error(here: Vec3, others: Iterable[tuple[Vec3, float]]) -> float:
    """Return the mean error of a vehicle's distances to others; zero without others. others:
    positions, each with the wanted distance."""
    errors = [abs(distance(here, other) - wanted) for other, wanted in others]
    return sum(errors) / len(errors) if errors else 0.0


def longest(ways: Iterable[tuple[Vec3, Vec3]]) -> float:
    """Return the length of the longest path, each given by its two ends."""
    return max((norm(sub(b, a)) for a, b in ways), default=0.0)


def approach_speed(gap: float, acceleration: float) -> float:
    """Return the highest speed at the distance `gap` from a goal from which the vehicle can stop
    there, proportional to small gaps (2 1/s). Works for angles in radians too."""
    linear = acceleration / 8.0
    return 2.0 * gap if gap <= linear else sqrt(2.0 * acceleration * (gap - 0.5 * linear))


_CORNERS = 8
"""Corners on each level circle round a place."""
_CORNER_DISTANCES = (1.1, 1.5, 2.2)
"""Distances of the corners from a place, as multiples of the least distance that a leg must keep;
they are larger because the legs cut the circle."""


def clear_way(
    start: Vec3,
    goal: Vec3,
    taken: Sequence[Vec3],
    apart: float,
    is_open: Callable[[Vec3, Vec3], bool],
) -> tuple[Vec3, ...] | None:
    """Return the points after `start` of a path to `goal`, or None if there is none. The path keeps
    the distance `apart` from the places in `taken`; from a place that is already nearer to the
    start or the goal, it keeps that distance. is_open: returns whether a leg is clear of other
    things; not called for the straight path.

    A vehicle that joins a standing formation flies straight to its place. If that leads too close
    to another, it flies over one corner beside, above or below that one: the corner with the
    shortest path of which both legs are clear. The others stay in their places meanwhile, so a path
    that is clear in the frame stays clear while the frame moves. Metres, in the frame.
    """
    bounds = [(one, min(apart, distance(start, one), distance(goal, one))) for one in taken]
    near = [(one, bound) for one, bound in bounds if bound > 0.0]
    in_the_way = [one for one, bound in near if not _passes(start, goal, one, bound)]
    if not in_the_way:
        return (goal,)
    corners = [corner for one in in_the_way for corner in _beside(one, apart)]
    for corner in sorted(corners, key=lambda c: distance(start, c) + distance(c, goal)):
        legs = ((start, corner), (corner, goal))
        if all(_passes(*leg, one, bound) for leg in legs for one, bound in near) and all(
            is_open(*leg) for leg in legs
        ):
            return (corner, goal)
    return None


def _passes(start: Vec3, end: Vec3, place: Vec3, apart: float) -> bool:
    """Return whether a leg stays `apart` from a place, within rounding."""
    return least_distance(sub(start, place), sub(end, place)) >= apart - 1e-6


def _beside(place: Vec3, apart: float) -> Iterator[Vec3]:
    for wider in _CORNER_DISTANCES:
        for i in range(_CORNERS):
            angle = 2.0 * pi * i / _CORNERS
            yield add(place, scale((cos(angle), sin(angle), 0.0), wider * apart))
        yield add(place, (0.0, 0.0, wider * apart))
        yield add(place, (0.0, 0.0, -wider * apart))


class WayToPlace:
    """A motion in the formation's frame from `start` through `points`, with a stop at each. length:
    if the path is straight, it takes as long as a path of this length."""

    def __init__(
        self,
        start: Motion,
        points: Sequence[Vec3],
        length: float,
        speed: float,
        acceleration: float,
    ) -> None:
        self.duration = 0.0
        legs: list[tuple[float, Shift]] = []
        for point in points:
            far = length if len(points) == 1 else distance(start.position, point)
            leg = Shift(start, point, Shift.time_for(far, speed, acceleration))
            legs.append((self.duration, leg))
            self.duration += leg.duration
            start = Motion(point)
        self._last_first = legs[::-1]

    def at(self, time: float) -> Motion:
        """Return the motion in the frame `time` seconds after the start. Raises ValueError if
        `time` is negative."""
        for began, leg in self._last_first:
            if time >= began:
                return leg.at(time - began)
        raise ValueError(f"{time} s is before the start")
