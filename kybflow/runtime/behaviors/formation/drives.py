"""The drives that move a formation's frame: by hand, along a path, behind a leader, or not at
all."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from math import copysign, cos, sin

from kybflow.core.geometry import Vec3, add, norm, scale, sub, wrap
from kybflow.core.signals import Tick
from kybflow.flight.formation.frame import Asked, FrameLimits, MovingFrame, approach_speed
from kybflow.parts import Entry
from kybflow.runtime.behaviors._hand import Hand
from kybflow.runtime.behaviors._leader import Leader, Leading

_CORNER_DISTANCE = 0.03
"""Distance (m) from a corner of its path at which a frame continues to the next."""


class Drive:
    """Determines the motion of a formation's frame; this base class keeps the frame where it is.

    waits_for: what the formation waits for, as a text, empty for nothing.
    trouble: why no motion has been requested for `lost` seconds.
    ended: whether the frame has reached its final position and heading.
    path: a number that identifies the path along which the frame moves, 0 without one.
    corner: the index of the corner of the path to which it moves.
    """

    waits_for, trouble, lost, ended, path, corner = "", "", 0.0, False, 0, 0

    def hear(self, tick: Tick, delay: float, freshness: float) -> MovingFrame | None:
        """Return the frame that a leader determines, or None without one or while it is unknown.
        Must be called once a tick, before `asked`."""
        return None

    def asked(self, tick: Tick, frame: MovingFrame, limits: FrameLimits) -> Asked:
        """Return the requested motion of the frame. Must be called once a tick."""
        return Asked()

    def join(self, others: Iterable[tuple[int, int]]) -> None:
        """Continue along the path where the other members are. others: the `path` and `corner` of
        each of them."""


class ByHand(Drive):
    """Moves the frame by the axes of an input. axes: their last values."""

    def __init__(self, name: str, entry: Entry, *, in_world: bool) -> None:
        self.axes: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
        self._hand, self._in_world, self._name = Hand(name, entry), in_world, name

    def asked(self, tick: Tick, frame: MovingFrame, limits: FrameLimits) -> Asked:
        axes = self._hand.axes(tick)
        self.waits_for, self.lost = self._hand.waits_for, self._hand.lost
        self.trouble = f"`{self._name}` is lost" if self.lost else ""
        self.axes = axes or (0.0, 0.0, 0.0, 0.0)
        x, y, z, turn = self.axes
        level = scale((x, y, 0.0), limits.speed)
        if not self._in_world:
            level = frame.turned(level)
        return Asked((level[0], level[1], z * limits.climb), turn * limits.turn_rate)

    def felt(self, velocity: Vec3, frame: MovingFrame, limits: FrameLimits) -> Vec3:
        """Return the force for the hand along the axes: the difference between the swarm's velocity
        and the requested one, as a fraction of the largest velocity."""
        turned = 0.0 if self._in_world else frame.heading
        c, s, (vx, vy, vz), (x, y, z, _) = cos(turned), sin(turned), velocity, self.axes
        return (
            (c * vx + s * vy) / limits.speed - x,
            (c * vy - s * vx) / limits.speed - y,
            vz / limits.climb - z,
        )


class AlongPath(Drive):
    """Moves the centre from corner to corner, and turns to a heading."""

    def __init__(self, path: tuple[Vec3, ...], heading: float | None) -> None:
        self._corners, self._heading, self.corner = path, heading, 0
        self.path = zlib.crc32(repr((path, heading)).encode())

    def join(self, others: Iterable[tuple[int, int]]) -> None:
        """Continue to the farthest corner to which others move along the same path."""
        own = self.corner
        self.corner = max((corner for path, corner in others if path == self.path), default=own)

    def asked(self, tick: Tick, frame: MovingFrame, limits: FrameLimits) -> Asked:
        gap = sub(self._corners[self.corner], frame.centre)
        length = norm(gap)
        off = 0.0 if self._heading is None else wrap(self._heading - frame.heading)
        if length < _CORNER_DISTANCE:
            if self.corner + 1 < len(self._corners):
                self.corner += 1
            else:
                self.ended = abs(off) < _CORNER_DISTANCE
        speed = min(limits.speed, approach_speed(length, limits.acceleration))
        velocity = scale(gap, speed / length) if length > 0.0 else gap
        turn = copysign(approach_speed(abs(off), limits.turn_rate), off)
        return Asked(velocity, turn)


class BehindLeader(Drive):
    """Moves the centre with another vehicle, the leader, at an offset in the leader's frame, and
    turns the frame with it."""

    def __init__(self, name: str, offset: Vec3) -> None:
        self._leader, self._offset = Leader(name), offset
        self.leading: Leading | None = None

    def hear(self, tick: Tick, delay: float, freshness: float) -> MovingFrame | None:
        self.leading = leading = self._leader.heard(tick, delay, freshness)
        self.trouble, self.lost = self._leader.trouble, self._leader.lost
        if leading is None:
            return None
        frame = MovingFrame(leading.position, leading.velocity, heading=leading.heading)
        return frame._replace(
            centre=add(leading.position, frame.turned(self._offset)), rate=leading.rate
        )

    def asked(self, tick: Tick, frame: MovingFrame, limits: FrameLimits) -> Asked:
        leading = self.leading
        if leading is None:
            return Asked()
        turned = MovingFrame(leading.position, heading=leading.heading).turned(self._offset)
        gap = sub(add(leading.position, turned), frame.centre)
        length, swing = norm(gap), (-leading.rate * turned[1], leading.rate * turned[0], 0.0)
        velocity = add(leading.velocity, swing)
        if length > 0.0:
            speed = min(limits.speed, approach_speed(length, 0.5 * limits.acceleration))
            velocity = add(velocity, scale(gap, speed / length))
        off = wrap(leading.heading - frame.heading)
        turn = copysign(approach_speed(abs(off), limits.turn_rate), off)
        return Asked(velocity, leading.rate + turn)
