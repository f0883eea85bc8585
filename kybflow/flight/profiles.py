"""Rest-to-rest speed profiles over a distance, with continuous jerk.

The speed rises with the quintic smoothstep S, stays constant, and falls with its mirror image:

    S(s) = 6 s^5 - 15 s^4 + 10 s^3        s = t / ramp in [0, 1]
    v(t) = V S(t / ramp)

S has zero first and second derivatives at both ends, so acceleration and jerk start and end at
zero; its slope is at most 15/8, so the acceleration is at most 15/8 V / ramp; its integral is 1/2,
so a ramp covers V ramp / 2. (Perlin, "Improving noise", SIGGRAPH 2002, for S; the rest follows.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import sqrt
from typing import NamedTuple

from kybflow.core.geometry import Vec3, scale

STEEPEST = 15.0 / 8.0
"""The largest slope of the smoothstep, at its middle."""
_STILL = 1e-12
_SHORTEST = 0.5
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
    """A profile over `distance` from rest to rest, at `speed` at most, with ramps of `ramp`
    seconds.

    The caller chooses the unit of the distance, such as metres or radians. The profile of an
    infinite distance never ends. The ramps are shortened if the distance is too short for them.
    """

    __slots__ = ("distance", "duration", "ramp", "speed")

    def __init__(self, distance: float, speed: float, ramp: float) -> None:
        if distance <= 0.0 or speed <= _STILL:
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
        peak = min(speed, sqrt(length * acceleration / STEEPEST))
        if length < peak * _SHORTEST:
            return cls(distance, length / _SHORTEST, _SHORTEST)
        return cls(distance, peak, STEEPEST * peak / acceleration)

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
