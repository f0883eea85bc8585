"""A reference governor: follows a reference within limits of speed and acceleration, smoothly.

The output is a position q with the velocity u and the acceleration a, which follows the governor's
acceleration w with a lag:

    a' = (w - a) / T,       T = 3 / (natural frequency of the on-board attitude loop)

so that the acceleration never steps and the jerk is known: a vehicle turns no faster than its
attitude loop, and swings after a step. What matters for the limits lies ahead of the output by T:

    q^ = q + T u,    u^ = u + T a,    so that    q^' = u^,    u^' = w    exactly.

The governor, and the barriers of `kybflow.flight.avoidance`, choose w for (q^, u^), and compare it
with the reference ahead, (p + T v, v + T a), whose acceleration is a + T j. q, u and a are weighted
means of what q^, u^ and w were until now. They are therefore within each limit of speed and
acceleration, and inside each convex set (such as a box), that holds q^, u^ and w.

With e the gap between q^ and the reference ahead in the next tick, where the latter is (p, v), the
target velocity is

    v + e/|e| c(|e|),        c(e) = k e                      where e <= A / (2 k^2) ... linear
                             c(e) = sqrt(A (e - A/(4 k^2)))  beyond.

Half of the acceleration A is planned for closing the gap, and half is left for the reference's own
acceleration (the square-root controller, with a linear end against chattering). The target velocity
is limited to the speed, and u^ follows it by at most A dt per tick. The gap decays like exp(-k t),
without overshoot. Once the follower has caught up, the reference passes through unchanged.
"""

from __future__ import annotations

from math import exp, sqrt

from kybflow.core.geometry import ZERO, Vec3, add, distance, norm, scale, sub
from kybflow.core.signals import NEVER, Setpoint, SetpointKind, Tick, Time
from kybflow.flight.motion import Motion
from kybflow.world.vehicle_context import Airframe

LAGS = 3.0
"""T times the natural frequency of the on-board attitude loop."""
_GAIN = 4.0
_STEP = 0.1
"""The share of the change that `acceleration` allows in a tick by which a velocity may step."""
CAUGHT_UP = 1e-4
"""Gap (m) below which the follower has caught up, and thus the largest step in position."""


class Follower:
    """The motion of a processor's own trajectory. behind: whether it has yet to catch up with the
    requested one. lag: T, seconds.

    Exists as long as its processor. It restarts from the setpoint that the tracker followed after a
    pause in the calls (such as an aborted landing), with a new behavior, and when the kind of
    setpoint changes, because a later processor may have kept the tracker away from this trajectory.
    With setpoints of velocity it has no gap in position to close.
    """

    __slots__ = ("_kind", "_time", "acceleration", "behind", "lag", "position", "velocity")

    def __init__(self, airframe: Airframe) -> None:
        self.lag = LAGS / sqrt(airframe.attitude_loop.proportional)
        self.position, self.velocity, self.acceleration = ZERO, ZERO, ZERO
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
        self.acceleration = (asked if last is None else last).acceleration or ZERO
        if last is not None and last.position is not None:
            self.position = last.position
        else:
            mean = scale(add(velocity, self.velocity), 0.5 * tick.dt)
            self.position = sub(asked.position or ZERO, mean)
        self.behind = False

    def join(self, asked: Motion) -> None:
        """Continue on the requested trajectory, with this motion."""
        self.position, self.velocity, self.acceleration, _ = asked
        self.behind = False

    def ahead(self) -> tuple[Vec3, Vec3]:
        """Return the position and the velocity ahead, q^ and u^."""
        return (
            led(self.position, self.velocity, self.lag),
            led(self.velocity, self.acceleration, self.lag),
        )

    def follow(self, asked: Motion, speed: float, acceleration: float, dt: float) -> Motion:
        """Advance by one tick towards the requested motion, within both limits, and return the new
        motion."""
        wanted = self.pursuit(asked, speed, acceleration, dt)
        return self.advance(shortened(self.change_to(wanted, dt), acceleration), dt)

    def pursuit(self, asked: Motion, speed: float, acceleration: float, dt: float) -> Vec3:
        """Return the velocity ahead with which the follower would catch up."""
        wanted = led(asked.velocity, asked.acceleration, self.lag)
        if self._kind is not SetpointKind.VELOCITY:
            position, velocity = self.ahead()
            goal = led(asked.position, asked.velocity, self.lag)
            gap = sub(goal, led(position, velocity, dt))
            length = norm(gap)
            if length > 0.0:
                wanted = add(wanted, scale(gap, _closing_speed(length, acceleration) / length))
        return shortened(wanted, speed)

    def change_to(self, wanted: Vec3, dt: float) -> Vec3:
        """Return the acceleration with which the velocity ahead becomes `wanted` in one tick."""
        return scale(sub(wanted, self.ahead()[1]), 1.0 / dt)

    def advance(self, change: Vec3, dt: float) -> Motion:
        """Advance by one tick with the acceleration `change` ahead, and return the new motion."""
        lag = self.lag
        position, velocity = self.ahead()
        after = add(velocity, scale(change, dt))
        there = add(position, scale(add(velocity, after), 0.5 * dt))
        short = scale(sub(change, self.acceleration), exp(-dt / lag))
        self.acceleration = sub(change, short)
        self.velocity = led(after, self.acceleration, -lag)
        self.position = led(there, self.velocity, -lag)
        self.behind = True
        return Motion(self.position, self.velocity, self.acceleration, scale(short, 1.0 / lag))

    def has_caught_up(self, asked: Motion, acceleration: float, dt: float) -> bool:
        """Return whether the follower, advanced to this tick, can join the requested trajectory
        without a step."""
        most = _STEP * acceleration * dt
        return (
            (
                self._kind is SetpointKind.VELOCITY
                or distance(asked.position, self.position) <= CAUGHT_UP
            )
            and distance(asked.velocity, self.velocity) <= most
            and distance(asked.acceleration, self.acceleration) <= most / self.lag
        )


def _closing_speed(gap: float, acceleration: float) -> float:
    linear = acceleration / (2.0 * _GAIN * _GAIN)
    if gap <= linear:
        return _GAIN * gap
    return sqrt(acceleration * (gap - 0.5 * linear))


def led(value: Vec3, rate: Vec3, time: float) -> Vec3:
    """Return the value `time` seconds later, if its rate stays."""
    return add(value, scale(rate, time))


def shortened(vector: Vec3, longest: float) -> Vec3:
    """Return `vector` limited to the length `longest`; the same object if it is no longer."""
    length = norm(vector)
    return vector if length <= longest else scale(vector, longest / length)
