"""The hold of `pause` and `brake`: the vehicle comes to rest and holds, with its behavior frozen.

On release the vehicle flies back to the behavior's last setpoint. If that setpoint moves, the
vehicle goes to a point ahead of it, at the distance needed to regain its velocity. There the
behavior resumes, and `SetpointBlend` closes the gap. Thus the setpoint that the processors receive
has no step in position or velocity, even if the vehicle was pushed during the hold. World frame.
"""

from __future__ import annotations

from typing import Literal

from kybflow.core.geometry import ZERO, Vec3, add, norm, scale, sub
from kybflow.core.signals import NS, Setpoint, SetpointKind, Time
from kybflow.flight.motion import IDLE, MAX_SLOPE, Coast, Motion, Straight, Turn, smoothstep
from kybflow.parts import Entry

Holder = Literal["brake", "pause", "pilot"]

_DECELERATION = 2.0
"""Deceleration to rest, and largest acceleration of the blend, m/s^2."""
_SPEED, _ACCELERATION, _TURN_RATE = 0.5, 0.7, 1.0
"""Limits during the flight back: m/s, m/s^2, rad/s."""
_MIN_STOP_S = 0.4


class Hold:
    """Holds a vehicle for as long as it has a holder. wanted: the frozen behavior's last setpoint,
    or None. since: when the hold began."""

    def __init__(
        self, holders: set[Holder], entry: Entry, wanted: Setpoint | None, grounded: bool
    ) -> None:
        self.holders = holders
        self.since = entry.now
        self.wanted = wanted
        self._grounded = grounded
        self._heading = entry.heading
        self._coast = Coast.after(entry.motion, _DECELERATION)
        self._back: _WayBack | None = None

    @property
    def lasts(self) -> bool:
        """Whether a holder is left."""
        return bool(self.holders)

    def join(self, holder: Holder) -> None:
        """Add a holder."""
        self.holders.add(holder)

    def leave(self, holder: Holder, now: Time) -> None:
        """Remove a holder. When the last one leaves, a vehicle in the air starts to fly back."""
        self.holders.discard(holder)
        if not self.holders and not self._grounded:
            motion = self._coast.at((now - self.since) / NS)
            self._back = _WayBack(now, motion, self._heading, self.wanted)

    def update(self, now: Time) -> Setpoint | None:
        """Return the setpoint, or None once the flight back is over and the behavior resumes."""
        if self._grounded:
            return IDLE if self.holders else None
        if self._back is not None:
            return self._back.at(now)
        return self._coast.at((now - self.since) / NS).setpoint(self._heading)


class _WayBack:
    """The flight from the present motion to rest at the frozen setpoint and its heading."""

    def __init__(self, now: Time, motion: Motion, heading: float, goal: Setpoint | None) -> None:
        self._began = now
        self._coast = Coast(motion.position, motion.velocity, _DECELERATION)
        there = _meeting(goal) if goal is not None else None
        turned = goal.heading if goal is not None else None
        self._way = Straight(self._coast.end, there or self._coast.end, _SPEED, _ACCELERATION)
        self._turn = Turn(heading, turned, _TURN_RATE)
        self._end = max(self._coast.duration, self._way.duration, self._turn.duration)

    def at(self, now: Time) -> Setpoint | None:
        time = (now - self._began) / NS
        if time >= self._end:
            return None
        motion = self._way.at(time)
        if time < self._coast.duration:
            motion = motion.plus(self._coast.shift(time))
        return motion.setpoint(*self._turn.at(time))


class SetpointBlend:
    """Blends from the setpoint that the tracker followed last to the setpoints of a behavior.

    With the initial position gap d, the initial velocity difference w, and s = t / T, the added
    offset is

        added(t) = d (1 - 10 s^3 + 15 s^4 - 6 s^5) + w T (s - 6 s^3 + 8 s^4 - 3 s^5),

    where T is at least 0.4 s and 15/8 |w| / (2 m/s^2). A gap d = -w T / 2 is closed without a
    detour, as |added'| falls from |w| to zero; the rest of the gap is closed at 0.5 m/s at most.
    """

    def __init__(self, now: Time, followed: Setpoint | None, asked: Setpoint) -> None:
        before = followed or asked
        self._began = now
        self._gap = self._excess = ZERO
        if before.position is not None and asked.position is not None:
            self._gap = sub(before.position, asked.position)
        if asked.velocity is not None:
            self._excess = sub(before.velocity or ZERO, asked.velocity)
        self._span = _span(self._excess)
        detour = norm(add(self._gap, scale(self._excess, 0.5 * self._span)))
        self._span = max(self._span, MAX_SLOPE * detour / _SPEED)

    def added(self, setpoint: Setpoint, now: Time) -> Setpoint | None:
        """Return `setpoint` with the remaining offset added, or None once the blend is over."""
        s = (now - self._began) / (NS * self._span)
        if s >= 1.0 or setpoint.velocity is None:
            return None
        shift = self._shift(s)
        if setpoint.kind is SetpointKind.VELOCITY:
            excess = scale(self._excess, 1.0 - smoothstep(s)[1])
            return setpoint._replace(velocity=add(setpoint.velocity, excess))
        motion = Motion(
            add(setpoint.position or ZERO, shift.position),
            add(setpoint.velocity, shift.velocity),
            add(setpoint.acceleration or ZERO, shift.acceleration),
            setpoint.jerk or ZERO,
        )
        return motion.setpoint_like(setpoint)

    def _shift(self, s: float) -> Motion:
        d, w, span = self._gap, self._excess, self._span
        rest = 1.0 - s
        d0 = 1.0 + s**3 * (-10.0 + s * (15.0 - 6.0 * s))
        d1 = -30.0 * (s * rest) ** 2 / span
        d2 = -60.0 * s * rest * (rest - s) / span**2
        w0 = span * s * (1.0 + s * s * (-6.0 + s * (8.0 - 3.0 * s)))
        w1 = 1.0 + s * s * (-18.0 + s * (32.0 - 15.0 * s))
        w2 = s * (-36.0 + s * (96.0 - 60.0 * s)) / span
        return Motion(
            add(scale(d, d0), scale(w, w0)),
            add(scale(d, d1), scale(w, w1)),
            add(scale(d, d2), scale(w, w2)),
        )


def _span(excess: Vec3) -> float:
    """Return the seconds that a blend needs at least for this velocity difference (m/s)."""
    return max(MAX_SLOPE * norm(excess) / _DECELERATION, _MIN_STOP_S)


def _meeting(goal: Setpoint) -> Vec3 | None:
    """Return the position at which to rest before the behavior resumes at `goal`: as far ahead of
    `goal` as the blend takes to regain its velocity. None without a position."""
    if goal.position is None or goal.velocity is None:
        return goal.position
    return add(goal.position, scale(goal.velocity, 0.5 * _span(goal.velocity)))
