"""Motion primitives for behaviors: speed profiles, a straight leg, coasting to rest, a turn and a
dwell time.

A behavior that is entered while the vehicle moves adds two motions: a coast, which brings the entry
velocity to rest, and the behavior's own motion, which starts at rest where the coast ends. The sum
starts with the position and velocity of the last setpoint, so that the trajectory has no step, and
ends exactly like the behavior's own motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import copysign, sqrt
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add, heading_of, norm, scale, sub, wrap
from kybflow.core.signals import Estimate, Setpoint, SetpointKind
from kybflow.core.units import DEG

MAX_SLOPE = 15.0 / 8.0
"""The largest slope of the smoothstep, at its middle."""
_NO_DISTANCE = 1e-12
_SHORTEST_RAMP = 0.5
"""Duration of the ramps over a short distance, seconds."""


Progress = tuple[float, float, float, float]
"""The distance covered and its first three time derivatives."""


def smoothstep(s: float) -> tuple[float, float, float, float]:
    """Return the integral, value, first and second derivative of S at `s` in [0, 1]."""
    rest, cube = 1.0 - s, s * s * s
    return (
        cube * s * (2.5 + s * (s - 3.0)),
        cube * (10.0 + s * (6.0 * s - 15.0)),
        30.0 * s * s * rest * rest,
        60.0 * s * rest * (1.0 - 2.0 * s),
    )


class Pace(NamedTuple):
    """The timing of a profile, seconds. ramp: the duration of each ramp. cruise: the distance
    divided by the largest speed.

    Profiles with the same pace have covered the same share of their distances at every time. If two
    vehicles fly straight lines at the same pace, each therefore moves on a straight line relative
    to the other.
    """

    cruise: float
    ramp: float

    @property
    def duration(self) -> float:
        return self.ramp + self.cruise

    @classmethod
    def slowest(cls, paces: Iterable[Pace]) -> Pace:
        """Return the fastest pace that is no faster than any of `paces`: it has the longest ramp
        and the longest cruise, so that each vehicle stays within its limits of speed and
        acceleration."""
        cruises, ramps = zip(*paces, strict=True)
        return cls(max(cruises), max(ramps))


class Profile:
    """A rest-to-rest profile over `distance`, at `speed` at most, with ramps of `ramp` seconds and
    continuous jerk.

    The speed rises with the quintic smoothstep S, stays constant, and falls with its mirror image:

        S(s) = 6 s^5 - 15 s^4 + 10 s^3        s = t / ramp in [0, 1]
        v(t) = V S(t / ramp)

    S has zero first and second derivatives at both ends, so acceleration and jerk start and end at
    zero; its slope is at most 15/8, so the acceleration is at most 15/8 V / ramp; its integral is
    1/2, so a ramp covers V ramp / 2. (Perlin, "Improving noise", SIGGRAPH 2002, for S; the rest
    follows.)

    The caller chooses the unit of the distance, such as metres or radians. The profile of an
    infinite distance never ends. The ramps are shortened if the distance is too short for them.
    """

    __slots__ = ("distance", "duration", "ramp", "speed")

    def __init__(self, distance: float, speed: float, ramp: float) -> None:
        if distance <= 0.0 or speed <= _NO_DISTANCE:
            self.distance, self.speed, self.ramp, self.duration = max(distance, 0.0), 0.0, 0.0, 0.0
            return
        self.distance, self.speed = distance, speed
        self.ramp = min(ramp, distance / speed)
        self.duration = self.ramp + distance / speed

    @classmethod
    def within(cls, distance: float, speed: float, acceleration: float) -> Profile:
        """Return the fastest profile within both limits.

        V = min(speed, sqrt(distance * acceleration / (15/8))). With the second value, the two ramps
        alone cover the distance, so that a short distance has a lower peak speed and no negative
        cruise time. V is also at most distance / 0.5 s, for a profile of one second: the peak jerk
        grows with V / ramp^2, and moving a millimetre in hundredths of a second would shake the
        vehicle.
        """
        length = max(distance, 0.0)
        peak = min(speed, sqrt(length * acceleration / MAX_SLOPE))
        if length < peak * _SHORTEST_RAMP:
            return cls(distance, length / _SHORTEST_RAMP, _SHORTEST_RAMP)
        return cls(distance, peak, MAX_SLOPE * peak / acceleration)

    @classmethod
    def paced(cls, distance: float, pace: Pace) -> Profile:
        """Return a profile with the timing of `pace`."""
        return cls(distance, distance / pace.cruise, pace.ramp) if distance else cls(0.0, 0.0, 0.0)

    @property
    def pace(self) -> Pace:
        return Pace(self.duration - self.ramp, self.ramp)

    def at(self, time: float) -> Progress:
        """Return the progress at `time` (s): zero before the start, `distance` after the end."""
        if time >= self.duration:
            return (self.distance, 0.0, 0.0, 0.0)
        if time <= 0.0:
            return (0.0, 0.0, 0.0, 0.0)
        ramp, speed, left = self.ramp, self.speed, self.duration - time
        if time < ramp:
            area, value, slope, bend = smoothstep(time / ramp)
            rate = speed / ramp
            return (speed * ramp * area, speed * value, rate * slope, rate / ramp * bend)
        if left < ramp:
            area, value, slope, bend = smoothstep(left / ramp)
            rate = speed / ramp
            gone = self.distance - speed * ramp * area
            return (gone, speed * value, -rate * slope, rate / ramp * bend)
        return (speed * (time - 0.5 * ramp), speed, 0.0, 0.0)


def rising(velocity: Vec3, rise: float) -> Callable[[float], Vec3]:
    """Return the wind (m/s, world frame) as a function of the seconds since it began. It rises from
    zero to `velocity` within `rise` seconds; its speed follows the quintic smoothstep."""

    def wind(elapsed: float) -> Vec3:
        if elapsed >= rise:
            return velocity
        return scale(velocity, smoothstep(elapsed / rise)[1])

    return wind


IDLE = Setpoint(SetpointKind.IDLE)
"""The setpoint for rotors at rest, on the ground."""
COAST_ACCELERATION = 1.5
"""Deceleration (m/s^2) with which a behavior brings its entry velocity to rest."""
_MIN_STOP_S = 0.5
_REST_SPEED = 1e-6


class Motion(NamedTuple):
    """A position and its derivatives: world frame, metres and seconds."""

    position: Vec3
    velocity: Vec3 = ZERO
    acceleration: Vec3 = ZERO
    jerk: Vec3 = ZERO

    def plus(self, other: Motion) -> Motion:
        p, v, a, j = self
        q, w, b, k = other
        return Motion(add(p, q), add(v, w), add(a, b), add(j, k))

    def setpoint(self, heading: float, heading_rate: float = 0.0) -> Setpoint:
        p, v, a, j = self
        return Setpoint(SetpointKind.POSITION, p, v, a, j, heading, heading_rate)

    def setpoint_like(self, asked: Setpoint) -> Setpoint:
        """Return this motion as a setpoint of the kind and with the heading of `asked`."""
        kind, heading, rate = asked.kind, asked.heading, asked.heading_rate
        position = None if kind is SetpointKind.VELOCITY else self.position
        return Setpoint(kind, position, *self[1:], heading, rate, asked.presses)


def motion_of(setpoint: Setpoint) -> Motion:
    """Return the motion of a setpoint; fields that the setpoint omits are zero."""
    return Motion(
        setpoint.position or ZERO,
        setpoint.velocity or ZERO,
        setpoint.acceleration or ZERO,
        setpoint.jerk or ZERO,
    )


class Straight:
    """A straight line from rest to rest, within `speed` and `acceleration`."""

    __slots__ = ("_direction", "_end", "_profile", "_start", "duration")

    def __init__(self, start: Vec3, goal: Vec3, speed: float, acceleration: float) -> None:
        way = sub(goal, start)
        length = norm(way)
        self._start, self._end = start, Motion(goal)
        self._direction = scale(way, 1.0 / length) if length > 0.0 else ZERO
        self._profile = Profile.within(length, speed, acceleration)
        self.duration = self._profile.duration

    @property
    def pace(self) -> Pace:
        return self._profile.pace

    def keep(self, pace: Pace) -> None:
        """Fly the line at `pace`, which is no faster than the current one. Call it before the line
        begins."""
        self._profile = Profile.paced(self._profile.distance, pace)
        self.duration = self._profile.duration

    def at(self, time: float) -> Motion:
        """Return the motion `time` seconds after the start; after the end, exactly the goal."""
        if time >= self.duration:
            return self._end
        gone, v, a, j = self._profile.at(time)
        px, py, pz = self._start
        x, y, z = self._direction
        return Motion(
            (px + x * gone, py + y * gone, pz + z * gone),
            (x * v, y * v, z * v),
            (x * a, y * a, z * a),
            (x * j, y * j, z * j),
        )


class Coast:
    """A straight coast from a position and a velocity to rest.

    v(t) = v0 (1 - S(t / T)) with S the smoothstep. T = 15/8 |v0| / deceleration makes the peak
    deceleration the requested one; T is at least 0.5 s, because the peak jerk grows with v0 / T^2.
    The coast covers v0 T / 2.
    """

    __slots__ = ("_origin", "_velocity", "duration", "end")

    def __init__(self, origin: Vec3, velocity: Vec3, deceleration: float) -> None:
        self._origin, self._velocity = origin, velocity
        speed = norm(velocity)
        still = speed < _REST_SPEED
        self.duration = 0.0 if still else max(MAX_SLOPE * speed / deceleration, _MIN_STOP_S)
        self.end = add(origin, scale(velocity, 0.5 * self.duration))

    @classmethod
    def after(cls, motion: Motion, deceleration: float = COAST_ACCELERATION) -> Coast:
        """Return the coast from the position and velocity of `motion`."""
        return cls(motion.position, motion.velocity, deceleration)

    def at(self, time: float) -> Motion:
        """Return the motion `time` seconds after the start; after the end, at rest at `end`."""
        if time >= self.duration:
            return Motion(self.end)
        span = self.duration
        s = max(time, 0.0) / span
        area, value, slope, bend = smoothstep(s)
        v = self._velocity
        return Motion(
            add(self._origin, scale(v, span * (s - area))),
            scale(v, 1.0 - value),
            scale(v, -slope / span),
            scale(v, -bend / (span * span)),
        )

    def shift(self, time: float) -> Motion:
        """Return the motion relative to `end`, to be added to a motion that starts there."""
        position, *rest = self.at(time)
        return Motion(sub(position, self.end), *rest)

    def added(self, setpoint: Setpoint, time: float) -> Setpoint:
        """Return a position setpoint, whose motion starts at `end`, plus the rest of the coast."""
        return motion_of(setpoint).plus(self.shift(time)).setpoint_like(setpoint)


class Turn:
    """A turn from one heading to another, in the shorter direction, from rest to rest, at `rate`
    (rad/s) at most. Without a goal, the heading stays."""

    __slots__ = ("_angle", "_end", "_profile", "_start", "duration")

    def __init__(self, start: float, goal: float | None, rate: float) -> None:
        self._start = start
        self._angle = 0.0 if goal is None else wrap(goal - start)
        self._profile = Profile.within(abs(self._angle), rate, rate)
        self.duration = self._profile.duration
        self._end = self._turned(self.duration)

    def at(self, time: float) -> tuple[float, float]:
        """Return the heading and its rate `time` seconds after the start."""
        return self._end if time >= self.duration else self._turned(time)

    def _turned(self, time: float) -> tuple[float, float]:
        angle, rate, _, _ = self._profile.at(time)
        return self._start + copysign(angle, self._angle), copysign(rate, self._angle)

    def off(self, estimate: Estimate, tolerance: float | None) -> str:
        """Return a description of the heading error; empty if the error is within `tolerance`, or
        if `tolerance` is None."""
        if tolerance is None:
            return ""
        left = abs(wrap(self._start + self._angle - heading_of(estimate.attitude)))
        return "" if left <= tolerance else f" and {left / DEG:.1f} deg from the heading"


MAX_TICK_S = 0.1
"""The longest time (s) that one tick can count for: the state during a longer hang is unknown."""


class Dwell:
    """Measures how long a condition has held without interruption. A tick that comes later than
    `MAX_TICK_S` after the last one counts for that time only."""

    __slots__ = ("_held",)

    def __init__(self) -> None:
        self._held = 0.0

    def reached(self, holds: bool, wanted: float, dt: float) -> bool:
        """Return whether the condition has held for `wanted` seconds. Call it once a tick."""
        if not holds:
            self._held = 0.0
            return False
        reached = self._held >= wanted - 1e-9
        self._held += min(dt, MAX_TICK_S)
        return reached
