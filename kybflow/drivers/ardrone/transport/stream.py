"""What is sent to one drone: the newest command at a fixed rate, and what is to be said once.

The tick holds a command; whoever sends asks for what is due, in another thread or in the same.
Values are handed over whole. A command that is not renewed for `HOVERS` is replaced by hovering,
and from `ENDS` on nothing is sent at all: then the tick has stopped, and the drone's watchdog acts.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import pi
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.at import (
    ANEW,
    HOVER,
    Line,
    Move,
    datagrams,
    pcmd,
    pcmd_mag,
    ref,
)

HOVERS: Time = NS // 5
ENDS: Time = NS // 4
MOST_WAITING = 100
"""How many groups of lines wait to be sent."""
ACCURACY = 5.0 / 180.0
"""The largest error of a compass heading, as a share of 180 degrees."""
AT_ONCE = 8
"""How many groups go with one command."""


class Held(NamedTuple):
    """A command. flies: take off and stay in the air; else land. emergency: toggle it. move: None
    where the drone neither flies nor is to move. at: when it was made."""

    flies: bool
    emergency: bool
    move: Move | None
    at: Time


class CommandStream:
    """The commands of one drone. `hovered`, `ended`: how often a command was too old, by each
    bound. `bearing`: clockwise from north, rad, of the axis by which moves are given; None for the
    drone's own. clock: the time now."""

    def __init__(self, clock: Callable[[], Time]) -> None:
        self._clock = clock
        self._held: Held | None = None
        self._waiting: deque[tuple[Line, ...]] = deque(maxlen=MOST_WAITING)
        self._next = ANEW
        self._again = True
        self.bearing: float | None = None
        self.hovered = self.ended = 0

    def hold(self, flies: bool, move: Move | None = None, *, emergency: bool = False) -> None:
        """Send this from now on, instead of what was held before."""
        self._held = Held(flies, emergency, move, self._clock())

    def post(self, *lines: Line) -> None:
        """Send these once, in one datagram."""
        self._waiting.append(lines)

    def begin_anew(self) -> None:
        """Begin to count anew: the drone may have started again."""
        self._again = True

    def due(self) -> list[bytes]:
        """The datagrams of one period; none where the command is too old."""
        held, now = self._held, self._clock()
        if held is None:
            return []
        age = now - held.at
        if age > ENDS:
            self.ended += 1
            self._waiting.clear()
            return []
        move = held.move
        if move is not None and age > HOVERS:
            self.hovered += 1
            move = HOVER
        first = [ref(held.flies, held.emergency)]
        if move is not None:
            first.append(self._line(move))
        groups: list[tuple[Line, ...]] = [tuple(first)]
        while self._waiting and len(groups) <= AT_ONCE:
            groups.append(self._waiting.popleft())
        if self._again:
            self._again, self._next = False, ANEW
        packed, self._next = datagrams(groups, self._next)
        return packed

    def _line(self, move: Move) -> Line:
        if self.bearing is None or not move.progressive:
            return pcmd(move)
        return pcmd_mag(move, self.bearing / pi, ACCURACY)
