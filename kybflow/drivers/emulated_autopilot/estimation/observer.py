"""Position and velocity of the emulated autopilot: inertial, held by what is seen of the position.

Per axis a constant-gain observer with the error of the acceleration as its third state: with the
innovation e and the bandwidth w, p += 3 w dt e, v += 3 w^2 dt e, b += w^3 dt e, dt the seconds
since the last sighting. Between sightings p' = v, v' = a + b. What is seen late is compared with
where it was then. Metres, ENU.
"""

from __future__ import annotations

from collections import deque

from kybflow.core.geometry import ZERO, Vec3, add, scale, sub
from kybflow.core.signals import NS, Time

LONGEST = 0.25
"""Seconds between sightings for which the gains still grow."""
REMEMBERED: Time = NS // 2
MOST_BIAS = 0.5
"""Largest error of the acceleration that is believed, m/s^2."""


class Observer:
    """Knows nothing at first: it is at zero, at rest."""

    def __init__(self) -> None:
        self.position: Vec3 = ZERO
        self.velocity: Vec3 = ZERO
        self._bias: Vec3 = ZERO
        self._past: deque[tuple[Time, Vec3]] = deque()
        self._shifted: Vec3 = ZERO

    def feel(self, acceleration: Vec3, dt: float, now: Time) -> None:
        """Go on by `dt` with what is felt, in the world, without gravity."""
        a = add(acceleration, self._bias)
        move = add(scale(self.velocity, dt), scale(a, 0.5 * dt * dt))
        self.position = add(self.position, move)
        self.velocity = add(self.velocity, scale(a, dt))
        self._past.append((now, sub(self.position, self._shifted)))
        while self._past[0][0] < now - REMEMBERED:
            self._past.popleft()

    def off(self, position: Vec3, at: Time) -> Vec3:
        """How far what was seen at `at` is from what was believed then."""
        believed = next((p for time, p in reversed(self._past) if time <= at), None)
        if believed is None:
            believed = self._past[0][1] if self._past else sub(self.position, self._shifted)
        return sub(position, add(believed, self._shifted))

    def correct(self, off: Vec3, bandwidths: Vec3, dt: float) -> None:
        """Believe a sighting, `off` from where it was believed, `dt` seconds after the last."""
        dt = min(dt, LONGEST)
        p = [min(0.9, 3.0 * w * dt) * e for w, e in zip(bandwidths, off, strict=True)]
        v = [3.0 * w * w * dt * e for w, e in zip(bandwidths, off, strict=True)]
        b = [w**3 * dt * e for w, e in zip(bandwidths, off, strict=True)]
        self._shift((p[0], p[1], p[2]))
        self.velocity = add(self.velocity, (v[0], v[1], v[2]))
        x, y, z = add(self._bias, (b[0], b[1], b[2]))
        self._bias = (_within(x), _within(y), _within(z))

    def jump(self, off: Vec3) -> None:
        """The sightings have moved: go with them."""
        self._shift(off)

    def rest(self) -> None:
        """It stands: what it believed of its motion was an error."""
        self.velocity = ZERO

    def _shift(self, off: Vec3) -> None:
        self.position, self._shifted = add(self.position, off), add(self._shifted, off)


def _within(bias: float) -> float:
    return max(-MOST_BIAS, min(MOST_BIAS, bias))
