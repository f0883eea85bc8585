"""A reference that follows another within a speed and an acceleration, and catches up with it.

State: the position q and the velocity u of the follower. With the gap e from where it would be next
to the reference (p, v), the velocity wanted is

    w = v + e/|e| c(|e|),    c(e) = k e                      where e <= A / (2 k^2) ... linear
                             c(e) = sqrt(A (e - A/(4 k^2)))  beyond

that is, half of the acceleration A is planned for closing the gap and half is left for the
reference's own (the square-root controller, with its linear end against chattering). w is cut to
the speed limit, and u follows w by at most A dt a tick. The gap closes like exp(-k t) at its end,
so it is not overshot. Once it has caught up the reference is passed on untouched.
"""

from __future__ import annotations

from math import sqrt

from kybflow.core.geometry import ZERO, Vec3, add, norm, scale, sub
from kybflow.core.signals import Setpoint, SetpointKind, Tick, Time
from kybflow.flight.motion import Motion

_GAIN = 4.0
CAUGHT_UP = 1e-4
"""Gap (m) at which the follower has caught up; the step that is left there."""


class Follower:
    """Where a processor's own trajectory is, how fast, and whether it is behind what it is asked.

    Lives as long as its processor. A pause in the calls (a landing that was broken off) and another
    kind of setpoint make it go on from what the tracker follows.
    """

    __slots__ = ("_kind", "_time", "behind", "position", "velocity")

    def __init__(self) -> None:
        self.position, self.velocity = ZERO, ZERO
        self.behind = False
        self._time: Time | None = None
        self._kind: SetpointKind | None = None

    def resume(self, asked: Setpoint, tick: Tick) -> None:
        """Be where the trajectory was a tick ago; the first thing in every tick."""
        now, kind, before = tick.now, asked.kind, self._time
        paused = before is None or (now - before) > 1.5e9 * tick.dt + 1.0
        if paused or kind is not self._kind:
            last, velocity = tick.setpoint, asked.velocity or ZERO
            followed = last.velocity if last is not None else None
            self.velocity = velocity if followed is None else followed
            if last is not None and last.position is not None:
                self.position = last.position
            else:
                mean = scale(add(velocity, self.velocity), 0.5 * tick.dt)
                self.position = sub(asked.position or ZERO, mean)
            self.behind = False
        self._time, self._kind = now, kind

    def join(self, position: Vec3, velocity: Vec3) -> None:
        """Go on as the trajectory that is asked for."""
        self.position, self.velocity = position, velocity
        self.behind = False

    def follow(self, asked: Motion, speed: float, acceleration: float, dt: float) -> Motion:
        """Go on by one tick towards what is asked for, within both limits."""
        gap = sub(asked.position, add(self.position, scale(self.velocity, dt)))
        length = norm(gap)
        wanted = asked.velocity
        if length > 0.0:
            wanted = add(wanted, scale(gap, _closing_speed(length, acceleration) / length))
        wanted = shortened(wanted, speed)
        change = shortened(sub(wanted, self.velocity), acceleration * dt)
        after = add(self.velocity, change)
        self.position = add(self.position, scale(add(self.velocity, after), 0.5 * dt))
        self.velocity = after
        self.behind = True
        return Motion(self.position, after, scale(change, 1.0 / dt))

    def has_caught_up(self, asked: Motion, acceleration: float, dt: float) -> bool:
        """Whether to go on as the trajectory that is asked for would be no step."""
        close = norm(sub(asked.position, self.position)) <= CAUGHT_UP
        return close and norm(sub(asked.velocity, self.velocity)) <= acceleration * dt


def _closing_speed(gap: float, acceleration: float) -> float:
    linear = acceleration / (2.0 * _GAIN * _GAIN)
    if gap <= linear:
        return _GAIN * gap
    return sqrt(acceleration * (gap - 0.5 * linear))


def shortened(vector: Vec3, longest: float) -> Vec3:
    """`vector`, cut to the length `longest`; the same object where it is no longer than that."""
    length = norm(vector)
    return vector if length <= longest else scale(vector, longest / length)


def motion_of(setpoint: Setpoint) -> Motion:
    """The motion that a setpoint asks for; what it leaves out is zero."""
    return Motion(
        setpoint.position or ZERO,
        setpoint.velocity or ZERO,
        setpoint.acceleration or ZERO,
        setpoint.jerk or ZERO,
    )
