"""What a link asks of its connection to a drone."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.navdata.packet import Malformed, Packet, read_packet
from kybflow.drivers.ardrone.transport.stream import CommandStream

AT, NAVDATA, VIDEO, CONTROL = 5556, 5554, 5555, 5559
"""The drone's ports."""
ASKS = b"\x01\x00\x00\x00"
"""What makes a drone send navigation data to who sent it."""
Arrived = tuple[Time, Packet]
RESTARTS: Time = NS
"""After so long a silence the numbers may begin anew: the drone has started again."""
FEW = 10
"""How many refused datagrams are worth a word."""


class Gate:
    """Admits the packets of one drone. `refused`: how many were not, by reason."""

    def __init__(self) -> None:
        self.refused: Counter[str] = Counter()
        self._last, self._tells = 0, FEW
        self._heard: Time | None = None

    def admit(self, data: bytes, is_ours: bool, now: Time) -> Packet | None:
        """The packet, None where it is none. is_ours: it came from the drone's address and port."""
        if not is_ours:
            self.refused["from elsewhere"] += 1
            return None
        try:
            packet = read_packet(data)
        except Malformed as error:
            self.refused[str(error)] += 1
            return None
        is_silent = self._heard is None or now - self._heard > RESTARTS
        if packet.sequence <= self._last and not is_silent:
            self.refused["not newer"] += 1
            return None
        self._last, self._heard = packet.sequence, now
        return packet

    def report(self) -> str | None:
        """What was refused, in words: when there are `FEW`, and whenever there are ten times as
        many; else None. May be called in another thread."""
        refused = dict(self.refused)
        total = sum(refused.values())
        if total < self._tells:
            return None
        while self._tells <= total:
            self._tells *= 10
        counts = ", ".join(f"{count} {reason}" for reason, count in sorted(refused.items()))
        return f"{total} datagrams were ignored: {counts}"

    def begin_anew(self) -> None:
        """Let the numbers begin anew, as after the communication's watchdog."""
        self._last = 0


class DroneWire(ABC):
    """The connection to one drone. `stream`: what is sent. `gate`: what is admitted. Faults set
    `deaf` and `mute`."""

    def __init__(self, clock: Callable[[], Time]) -> None:
        self.stream, self.gate = CommandStream(clock), Gate()
        self.deaf = self.mute = False

    @abstractmethod
    def poll(self, now: Time) -> None:
        """Let what is due happen, where no thread does it. now: the run's time."""

    @abstractmethod
    def take(self, now: Time) -> Sequence[Arrived]:
        """The packets since the last call, oldest first, each with the run's time at which it
        arrived. Raises DriverError."""

    @abstractmethod
    def ask(self) -> None:
        """Ask the drone for navigation data."""

    @abstractmethod
    def listen_for_configuration(self) -> None:
        """Open the connection on which the drone sends its configuration when it is asked to."""

    @abstractmethod
    def configuration(self) -> bytes | None:
        """The newest whole configuration, once; None where there is none."""

    @property
    @abstractmethod
    def trouble(self) -> str:
        """Why nothing can arrive; empty while nothing is known to be wrong."""

    @abstractmethod
    def close(self) -> None: ...
