"""The interface of a connection to a drone, its commands, and the filter of its navigation data.

The tick calls `CommandStream.hold`; the sender, possibly in another thread, calls `due`. They
exchange immutable values. A command that is not renewed within `HOVER_AFTER` is replaced by a hover
command. After `STOP_AFTER` nothing is sent, since the tick has stopped, and the drone's watchdog
lands it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Sequence
from math import pi
from typing import NamedTuple

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.at import (
    FIRST_SEQUENCE,
    HOVER,
    Line,
    Move,
    datagrams,
    pcmd,
    pcmd_mag,
    ref,
)
from kybflow.drivers.ardrone.navdata import Malformed, Packet, read_packet

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
    """The commands of one drone.

    hovered, ended: how often a command was older than `HOVER_AFTER` and than `STOP_AFTER`.
    bearing: bearing of the axis to which moves are relative, clockwise from north, rad; None if
    moves are relative to the drone's own heading.
    clock: returns the time.
    """

    def __init__(self, clock: Callable[[], Time]) -> None:
        self._clock = clock
        self._held: Held | None = None
        self._waiting: deque[tuple[Line, ...]] = deque(maxlen=MOST_WAITING)
        self._next = FIRST_SEQUENCE
        self._again = True
        self.bearing: float | None = None
        self.hovered = self.ended = 0

    def hold(self, flies: bool, move: Move | None = None, *, emergency: bool = False) -> None:
        """Set the command to send in every period from now on."""
        self._held = Held(flies, emergency, move, self._clock())

    def post(self, *lines: Line) -> None:
        """Queue command lines, which are sent once and in one datagram."""
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
            bearing = self.bearing if move.progressive else None
            first.append(pcmd(move) if bearing is None else pcmd_mag(move, bearing / pi, ACCURACY))
        groups: list[tuple[Line, ...]] = [tuple(first)]
        while self._waiting and len(groups) <= AT_ONCE:
            groups.append(self._waiting.popleft())
        if self._again:
            self._again, self._next = False, FIRST_SEQUENCE
        packed, self._next = datagrams(groups, self._next)
        return packed


AT, NAVDATA, VIDEO, CONTROL = 5556, 5554, 5555, 5559
"""The drone's ports."""
NAVDATA_REQUEST = b"\x01\x00\x00\x00"
"""The datagram that requests navigation data."""
Arrived = tuple[Time, Packet]
RESTART_SILENCE_NS: Time = NS
"""Duration of a silence after which the sequence numbers may restart, since the drone may have
restarted."""
FIRST_REPORT = 10
"""Number of rejected datagrams after which they are first reported."""


class Gate:
    """Accepts the packets of one drone if they come from its address, are well-formed, and are
    newer than the last. refused: number of rejected datagrams by reason."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        self._last, self._next_report = 0, FIRST_REPORT
        self._last_received: Time | None = None

    def admit(self, data: bytes, is_ours: bool, now: Time) -> Packet | None:
        """Return the packet in a datagram; None if it is rejected. is_ours: whether the datagram
        came from the drone's address and port."""
        if not is_ours:
            self.refused["from elsewhere"] += 1
            return None
        try:
            packet = read_packet(data)
        except Malformed as error:
            self.refused[str(error)] += 1
            return None
        is_silent = self._last_received is None or now - self._last_received > RESTART_SILENCE_NS
        if packet.sequence <= self._last and not is_silent:
            self.refused["not newer"] += 1
            return None
        self._last, self._last_received = packet.sequence, now
        return packet

    def report(self) -> str | None:
        """Return a summary of the rejected datagrams after the first `FIRST_REPORT`, and whenever
        their number has grown tenfold; otherwise None. May be called in another thread."""
        refused = dict(self.refused)
        total = sum(refused.values())
        if total < self._next_report:
            return None
        while self._next_report <= total:
            self._next_report *= 10
        counts = ", ".join(f"{count} {reason}" for reason, count in sorted(refused.items()))
        return f"{total} datagrams were ignored: {counts}"

    def restart(self) -> None:
        """Accept any sequence number next, since the drone may have restarted its numbers."""
        self._last = 0


class DroneWire(ABC):
    """The connection to one drone.

    stream: the commands.
    gate: the filter of navigation data.
    deaf, mute: set by injected faults; received or sent datagrams are lost.
    trouble: why nothing can arrive; empty if no error is known.
    """

    def __init__(self, clock: Callable[[], Time]) -> None:
        self.stream, self.gate = CommandStream(clock), Gate()
        self.deaf = self.mute = False
        self.trouble = ""

    @abstractmethod
    def poll(self, now: Time) -> None:
        """Send and receive what is due, unless a thread does so. now: the run's time."""

    @abstractmethod
    def take(self, now: Time) -> Sequence[Arrived]:
        """Return the packets received since the last call, oldest first, each with its time of
        arrival in the run. Raises DriverError if the connection has failed."""

    @abstractmethod
    def ask(self) -> None:
        """Request navigation data."""

    @abstractmethod
    def listen_for_configuration(self) -> None:
        """Open the connection that receives the configuration."""

    @abstractmethod
    def configuration(self) -> bytes | None:
        """Return the latest complete configuration once, otherwise None."""

    @abstractmethod
    def close(self) -> None: ...
