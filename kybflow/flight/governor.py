"""A reference governor: follows a reference within limits of speed and acceleration.

The state is the position q and the velocity u of the follower. With e the gap between its position
and the reference (p, v) in the next tick, the target velocity is

    w = v + e/|e| c(|e|),    c(e) = k e                      where e <= A / (2 k^2) ... linear
                             c(e) = sqrt(A (e - A/(4 k^2)))  beyond

Half of the acceleration A is planned for closing the gap, and half is left for the reference's own
acceleration (the square-root controller, with a linear end against chattering). w is limited to the
speed, and u follows w by at most A dt per tick. The gap decays like exp(-k t), without overshoot.
Once the follower has caught up, the reference passes through unchanged.
"""

from __future__ import annotations

from math import sqrt

from kybflow.core.geometry import ZERO, Vec3, add, norm, scale, sub
from kybflow.core.signals import NEVER, Setpoint, SetpointKind, Tick, Time
from kybflow.flight.motion import Motion

_GAIN = 4.0
CAUGHT_UP = 1e-4
"""Gap (m) below which the follower has caught up, and thus the largest step in position."""


class Follower:
    """The position and velocity of a processor's own trajectory. behind: whether it has yet to
    catch up with the requested one.

    Exists as long as its processor. It restarts from the setpoint that the tracker followed after a
    pause in the calls (such as an aborted landing), with a new behavior, and when the kind of
    setpoint changes, because a later processor may have kept the tracker away from this trajectory.
    """

    __slots__ = ("_kind", "_time", "behind", "position", "velocity")

    def __init__(self) -> None:
        self.position, self.velocity = ZERO, ZERO
        self.behind = False
        self._time: Time = -NEVER
        self._kind: SetpointKind | None = None

    def resume(self, asked: Setpoint, tick: Tick) -> None:
        """Restart the trajectory if necessary. Call it before the other methods in every tick."""
        now, kind = tick.now, asked.kind
        begins = tick.elapsed == 0.0
        if begins or now - self._time > 1.5e9 * tick.dt or kind is not self._kind:
            self._restart(asked, tick)
        self._time, self._kind = now, kind

    def _restart(self, asked: Setpoint, tick: Tick) -> None:
        last, velocity = tick.setpoint, asked.velocity or ZERO
        followed = last.velocity if last is not None else None
        self.velocity = velocity if followed is None else followed
        if last is not None and last.position is not None:
            self.position = last.position
        else:
            mean = scale(add(velocity, self.velocity), 0.5 * tick.dt)
            self.position = sub(asked.position or ZERO, mean)
        self.behind = False

    def join(self, position: Vec3, velocity: Vec3) -> None:
        """Continue on the requested trajectory, at this position and velocity."""
        self.position, self.velocity = position, velocity
        self.behind = False

    def follow(self, asked: Motion, speed: float, acceleration: float, dt: float) -> Motion:
        """Advance by one tick towards the requested motion, within both limits, and return the new
        motion."""
        wanted = self.pursuit(asked, speed, acceleration, dt)
        return self.advance(shortened(sub(wanted, self.velocity), acceleration * dt), dt)

    def pursuit(self, asked: Motion, speed: float, acceleration: float, dt: float) -> Vec3:
        """Return the velocity with which the follower would catch up."""
        gap = sub(asked.position, add(self.position, scale(self.velocity, dt)))
        length = norm(gap)
        wanted = asked.velocity
        if length > 0.0:
            wanted = add(wanted, scale(gap, _closing_speed(length, acceleration) / length))
        return shortened(wanted, speed)

    def advance(self, change: Vec3, dt: float) -> Motion:
        """Advance by one tick in which the velocity changes by `change`, and return the new
        motion."""
        after = add(self.velocity, change)
        self.position = add(self.position, scale(add(self.velocity, after), 0.5 * dt))
        self.velocity = after
        self.behind = True
        return Motion(self.position, after, scale(change, 1.0 / dt))

    def has_caught_up(self, asked: Motion, acceleration: float, dt: float) -> bool:
        """Return whether the follower can join the requested trajectory without a step."""
        close = norm(sub(asked.position, self.position)) <= CAUGHT_UP
        return close and norm(sub(asked.velocity, self.velocity)) <= acceleration * dt


def _closing_speed(gap: float, acceleration: float) -> float:
    linear = acceleration / (2.0 * _GAIN * _GAIN)
    if gap <= linear:
        return _GAIN * gap
    return sqrt(acceleration * (gap - 0.5 * linear))


def shortened(vector: Vec3, longest: float) -> Vec3:
    """Return `vector` limited to the length `longest`; the same object if it is no longer."""
    length = norm(vector)
    return vector if length <= longest else scale(vector, longest / length)
