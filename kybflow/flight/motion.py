"""Motion primitives for behaviors: a straight leg, coasting to rest, a turn and a dwell time.

A behavior that is entered while the vehicle moves adds two motions: a coast, which brings the entry
velocity to rest, and the behavior's own motion, which starts at rest where the coast ends. The sum
starts with the position and velocity of the last setpoint, so that the trajectory has no step, and
ends exactly like the behavior's own motion.
"""

from __future__ import annotations

from math import copysign
from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3, add, heading_of, norm, scale, sub, wrap
from kybflow.core.signals import Estimate, Setpoint, SetpointKind
from kybflow.core.units import DEG
from kybflow.flight.profiles import STEEPEST, Pace, Profile, smoothstep

IDLE = Setpoint(SetpointKind.IDLE)
"""The setpoint for rotors at rest, on the ground."""
COAST_ACCELERATION = 1.5
"""Deceleration (m/s^2) with which a behavior brings its entry velocity to rest."""
_SHORTEST = 0.5
_STILL = 1e-6


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
        """Return this motion as a setpoint with the heading of `asked`."""
        heading = asked.heading
        return Setpoint(SetpointKind.POSITION, *self, heading, asked.heading_rate)


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
        still = speed < _STILL
        self.duration = 0.0 if still else max(STEEPEST * speed / deceleration, _SHORTEST)
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
        """Return a description of the heading error; empty if it is within `tolerance`, or if that
        is None."""
        if tolerance is None:
            return ""
        left = abs(wrap(self._start + self._angle - heading_of(estimate.attitude)))
        return "" if left <= tolerance else f" and {left / DEG:.1f} deg from the heading"


class Dwell:
    """Measures how long a condition has held without interruption."""

    __slots__ = ("_held",)

    def __init__(self) -> None:
        self._held = 0.0

    def reached(self, holds: bool, wanted: float, dt: float) -> bool:
        """Return whether the condition has held for `wanted` seconds. Call it once a tick."""
        if not holds:
            self._held = 0.0
            return False
        reached = self._held >= wanted - 1e-9
        self._held += dt
        return reached
