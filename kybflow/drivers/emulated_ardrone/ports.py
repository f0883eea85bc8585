"""The ports of an emulated drone; their implementation in memory, and the driver's connection to
it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Hashable, Sequence

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.configuration import END
from kybflow.drivers.ardrone.transport.wire import NAVDATA_REQUEST, Arrived, DroneWire

MOST_HELD = 4096
CLIENT = "client"


class Ports(ABC):
    """The ports of one drone. No method blocks."""

    @abstractmethod
    def commands(self) -> Sequence[tuple[bytes, Hashable]]:
        """Return the AT command datagrams received since the last call, each with its sender."""

    @abstractmethod
    def requests(self) -> Sequence[tuple[bytes, Hashable]]:
        """Return the requests for navigation data received since the last call, each with its
        sender."""

    @abstractmethod
    def answer(self, sender: Hashable) -> bool:
        """Send navigation data to this sender from now on. Return whether the sender is
        accepted."""

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send a packet of navigation data."""

    @abstractmethod
    def send_configuration(self, data: bytes) -> None:
        """Send the configuration to connected clients."""

    @property
    @abstractmethod
    def is_watched(self) -> bool:
        """Whether a client is connected for video."""

    @abstractmethod
    def send_video(self, data: bytes) -> None:
        """Send a picture to the connected clients; a client that is still receiving one misses
        it."""

    @abstractmethod
    def close(self) -> None: ...


class MemoryPorts(Ports):
    def __init__(self) -> None:
        self.at: deque[bytes] = deque(maxlen=MOST_HELD)
        self.asked: deque[bytes] = deque(maxlen=MOST_HELD)
        self.sent: deque[bytes] = deque(maxlen=MOST_HELD)
        self.configuration: bytes | None = None

    def commands(self) -> Sequence[tuple[bytes, Hashable]]:
        return _emptied(self.at)

    def requests(self) -> Sequence[tuple[bytes, Hashable]]:
        return _emptied(self.asked)

    def answer(self, sender: Hashable) -> bool:
        return True

    def send(self, data: bytes) -> None:
        self.sent.append(data)

    def send_configuration(self, data: bytes) -> None:
        self.configuration = data

    @property
    def is_watched(self) -> bool:
        return False

    def send_video(self, data: bytes) -> None:
        """There is no video in memory."""

    def close(self) -> None:
        """There is nothing to close."""


class DroneMemoryWire(DroneWire):
    """The driver's connection to a drone in memory, in lockstep: `poll` sends what is due and
    receives what has arrived. rate: of the commands, Hz."""

    def __init__(self, ports: MemoryPorts, rate: float) -> None:
        self._now: Time = 0
        super().__init__(lambda: self._now)
        self._ports, self._period = ports, round(NS / rate)
        self._due: Time = 0
        self._arrived: deque[Arrived] = deque(maxlen=MOST_HELD)

    def poll(self, now: Time) -> None:
        self._now = now
        while self._ports.sent:
            packet = self.gate.admit(self._ports.sent.popleft(), True, now)
            if packet is not None and not self.deaf:
                self._arrived.append((now, packet))
        if now < self._due:
            return
        behind = now - self._due >= self._period
        self._due = now + self._period if behind else self._due + self._period
        sent = self.stream.due()
        if not self.mute:
            self._ports.at.extend(sent)

    def take(self, now: Time) -> Sequence[Arrived]:
        taken = [*self._arrived]
        self._arrived.clear()
        return taken

    def ask(self) -> None:
        if not self.mute:
            self._ports.asked.append(NAVDATA_REQUEST)

    def listen_for_configuration(self) -> None:
        """There is no connection to open."""

    def configuration(self) -> bytes | None:
        found, self._ports.configuration = self._ports.configuration, None
        return None if found is None or self.deaf else found.removesuffix(END)

    @property
    def trouble(self) -> str:
        return ""

    def close(self) -> None:
        """There is nothing to close."""


def _emptied(waiting: deque[bytes]) -> list[tuple[bytes, Hashable]]:
    found: list[tuple[bytes, Hashable]] = [(data, CLIENT) for data in waiting]
    waiting.clear()
    return found
