"""A drone's ports in this process, and the wire of the driver for real ones at their other end."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Hashable, Sequence

from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.protocol.configuration import END
from kybflow.drivers.ardrone.transport.wire import ASKS, Arrived, DroneWire

MOST_HELD = 4096
CLIENT = "client"


class Ports(ABC):
    """The ports of one drone. None of them waits."""

    @abstractmethod
    def commands(self) -> Sequence[tuple[bytes, Hashable]]:
        """The datagrams at the port for AT commands since the last call, each with its sender."""

    @abstractmethod
    def requests(self) -> Sequence[tuple[bytes, Hashable]]:
        """The same at the port for navigation data."""

    @abstractmethod
    def answer(self, sender: Hashable) -> bool:
        """Send navigation data to that sender from now on; whether it is one to be sent to."""

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send a packet of navigation data."""

    @abstractmethod
    def send_configuration(self, data: bytes) -> None:
        """Send the configuration to who is connected for it."""

    @property
    @abstractmethod
    def is_watched(self) -> bool:
        """Whether somebody is connected for video."""

    @abstractmethod
    def send_video(self, data: bytes) -> None:
        """Send a picture to who watches; one who is behind gets none of it."""

    @abstractmethod
    def close(self) -> None: ...


class MemoryPorts(Ports):
    """The drone's end."""

    def __init__(self) -> None:
        self.at: deque[bytes] = deque(maxlen=MOST_HELD)
        self.asked: deque[bytes] = deque(maxlen=MOST_HELD)
        self.told: deque[bytes] = deque(maxlen=MOST_HELD)
        self.configuration: bytes | None = None

    def commands(self) -> Sequence[tuple[bytes, Hashable]]:
        return _emptied(self.at)

    def requests(self) -> Sequence[tuple[bytes, Hashable]]:
        return _emptied(self.asked)

    def answer(self, sender: Hashable) -> bool:
        return True

    def send(self, data: bytes) -> None:
        self.told.append(data)

    def send_configuration(self, data: bytes) -> None:
        self.configuration = data

    @property
    def is_watched(self) -> bool:
        return False

    def send_video(self, data: bytes) -> None:
        """Nobody watches."""

    def close(self) -> None:
        """There is nothing to close."""


class DroneMemoryWire(DroneWire):
    """The driver's end, in lockstep: `poll` sends what is due and takes what has
    arrived. rate: of the commands, Hz."""

    def __init__(self, ports: MemoryPorts, rate: float) -> None:
        self._now: Time = 0
        super().__init__(lambda: self._now)
        self._ports, self._period = ports, round(NS / rate)
        self._due: Time = 0
        self._arrived: deque[Arrived] = deque(maxlen=MOST_HELD)

    def poll(self, now: Time) -> None:
        self._now = now
        while self._ports.told:
            packet = self.gate.admit(self._ports.told.popleft(), True, now)
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
            self._ports.asked.append(ASKS)

    def listen_for_configuration(self) -> None:
        """It is always heard."""

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
