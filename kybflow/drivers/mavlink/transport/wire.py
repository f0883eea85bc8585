"""Wires: bytes to and from autopilots, polled, never waiting."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any, ClassVar

from kybflow.core.signals import Time
from kybflow.drivers.mavlink.transport.address import Address, read_address

MOST_HELD = 10_000
"""What is kept for a reader that does not come."""

Received = Sequence[tuple[bytes, Any]]


class Wire(ABC):
    """One way to reach autopilots. `address`: as a person writes it. `answers`: whether only those
    can be reached that were heard. Cut by a fault: `deaf`, what comes is lost; `mute`, what is sent
    is lost."""

    answers: ClassVar[bool] = False

    def __init__(self, address: str) -> None:
        self.address = address
        self.deaf = False
        self.mute = False

    def receive(self, now: Time) -> Received:
        """What has come since the last call, oldest first, each with who sent it: whatever `send`
        takes as `to`. Opens again what was lost; never waits, never raises."""
        received = self._receive(now)
        return () if self.deaf else received

    def send(self, data: bytes, to: Any = None) -> None:
        """Send one frame, or lose it: what can't go at once is not sent later. to: who is meant,
        None for the only one there is. Never waits, never raises."""
        if not self.mute:
            self._send(data, to)

    @abstractmethod
    def trouble(self) -> str | None:
        """Why nothing comes or goes, None while nothing is known against it."""

    @abstractmethod
    def close(self) -> None: ...

    def is_open(self, sender: Any) -> bool:
        """Whether that sender can still be there."""
        return True

    @abstractmethod
    def _receive(self, now: Time) -> Received: ...

    @abstractmethod
    def _send(self, data: bytes, to: Any) -> None: ...


class MemoryWire(Wire):
    """One end of two in the same process: what is sent here is received there, in order, at
    once."""

    other: MemoryWire

    def __init__(self, address: str) -> None:
        super().__init__(address)
        self._coming: deque[bytes] = deque(maxlen=MOST_HELD)

    def trouble(self) -> str | None:
        return None

    def close(self) -> None:
        self._coming.clear()

    def _receive(self, now: Time) -> Received:
        came = [(data, None) for data in self._coming]
        self._coming.clear()
        return came

    def _send(self, data: bytes, to: Any) -> None:
        if not self.other.deaf:
            self.other._coming.append(data)


def memory_wires(address: str = "memory") -> tuple[MemoryWire, MemoryWire]:
    """Two ends. Either can be made deaf or mute."""
    one, other = MemoryWire(address), MemoryWire(address)
    one.other, other.other = other, one
    return one, other


def open_wire(address: str | Address) -> Wire:
    """Raises DriverError where that can't work: a port that is taken, a host that nobody knows, no
    pyserial. What may yet come, as a device or a simulator that is not there, is `trouble`."""
    place = read_address(address) if isinstance(address, str) else address
    if place.kind == "serial":
        from kybflow.drivers.mavlink.transport.serial_line import SerialLine

        return SerialLine(place)
    if place.kind in {"tcp", "tcpin"}:
        from kybflow.drivers.mavlink.transport.tcp import TcpClient, TcpServer

        return TcpClient(place) if place.kind == "tcp" else TcpServer(place)
    from kybflow.drivers.mavlink.transport.udp import UdpIn, UdpOut

    return UdpIn(place) if place.kind == "udpin" else UdpOut(place)
