"""The datagrams to one drone: the latest command at a fixed rate, and lines that are sent once.

The tick calls `hold`; the sender, possibly in another thread, calls `due`. They exchange immutable
values. A command that is not renewed within `HOVER_AFTER` is replaced by a hover command. After
`STOP_AFTER` nothing is sent, since the tick has stopped, and the drone's watchdog lands it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import pi
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.at import (
    FIRST_SEQUENCE,
    HOVER,
    Line,
    Move,
    datagrams,
    pcmd,
    pcmd_mag,
    ref,
)

HOVER_AFTER: Time = NS // 5
STOP_AFTER: Time = NS // 4
MOST_WAITING = 100
"""Largest number of groups of lines waiting to be sent."""
ACCURACY = 5.0 / 180.0
"""Largest error of a compass heading, as a fraction of 180 degrees."""
AT_ONCE = 8
"""Largest number of groups of lines sent along with a command."""


class Held(NamedTuple):
    """A command. flies: True to take off and fly, False to land. emergency: whether to toggle the
    emergency state. move: None unless the drone flies. at: when the command was made."""

    flies: bool
    emergency: bool
    move: Move | None
    at: Time


class CommandStream:
    """The commands of one drone. hovered, ended: how often a command was older than `HOVER_AFTER`
    and `STOP_AFTER`. bearing: of the axis to which moves are relative, clockwise from north, rad;
    None for the drone's own heading. clock: returns the time."""

    def __init__(self, clock: Callable[[], Time]) -> None:
        self._clock = clock
        self._held: Held | None = None
        self._waiting: deque[tuple[Line, ...]] = deque(maxlen=MOST_WAITING)
        self._next = FIRST_SEQUENCE
        self._again = True
        self.bearing: float | None = None
        self.hovered = self.ended = 0

    def hold(self, flies: bool, move: Move | None = None, *, emergency: bool = False) -> None:
        """Send this command from now on."""
        self._held = Held(flies, emergency, move, self._clock())

    def post(self, *lines: Line) -> None:
        """Send these lines once, in one datagram."""
        self._waiting.append(lines)

    def restart(self) -> None:
        """Restart the sequence numbers, since the drone may have restarted."""
        self._again = True

    def due(self) -> list[bytes]:
        """Return the datagrams to send in this period; none if the command is too old."""
        held, now = self._held, self._clock()
        if held is None:
            return []
        age = now - held.at
        if age > STOP_AFTER:
            self.ended += 1
            self._waiting.clear()
            return []
        move = held.move
        if move is not None and age > HOVER_AFTER:
            self.hovered += 1
            move = HOVER
        first = [ref(held.flies, held.emergency)]
        if move is not None:
            first.append(self._line(move))
        groups: list[tuple[Line, ...]] = [tuple(first)]
        while self._waiting and len(groups) <= AT_ONCE:
            groups.append(self._waiting.popleft())
        if self._again:
            self._again, self._next = False, FIRST_SEQUENCE
        packed, self._next = datagrams(groups, self._next)
        return packed

    def _line(self, move: Move) -> Line:
        if self.bearing is None or not move.progressive:
            return pcmd(move)
        return pcmd_mag(move, self.bearing / pi, ACCURACY)
