"""The interface of a connection to a drone, and the filter of its navigation data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.navdata.packet import Malformed, Packet, read_packet
from kybflow.drivers.ardrone.transport.stream import CommandStream

AT, NAVDATA, VIDEO, CONTROL = 5556, 5554, 5555, 5559
"""The drone's ports."""
NAVDATA_REQUEST = b"\x01\x00\x00\x00"
"""The datagram that requests navigation data."""
Arrived = tuple[Time, Packet]
RESTARTS: Time = NS
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
        is_silent = self._last_received is None or now - self._last_received > RESTARTS
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
        """Accept restarted sequence numbers, as after the communication watchdog."""
        self._last = 0


class DroneWire(ABC):
    """The connection to one drone. stream: the commands. gate: the filter of navigation data. deaf,
    mute: set by injected faults; received or sent datagrams are lost."""

    def __init__(self, clock: Callable[[], Time]) -> None:
        self.stream, self.gate = CommandStream(clock), Gate()
        self.deaf = self.mute = False

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

    @property
    @abstractmethod
    def trouble(self) -> str:
        """The reason why nothing can arrive; empty if no error is known."""

    @abstractmethod
    def close(self) -> None: ...
