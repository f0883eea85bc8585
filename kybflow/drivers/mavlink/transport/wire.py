"""Wires, which carry bytes to and from autopilots without blocking, and autopilots' addresses.

The router reads and writes the wires; those of the operating system are in `sockets`. `MemoryWire`
connects two ends within this process.

`udpin:[HOST:]PORT` waits for datagrams and answers their senders; `udpout:HOST:PORT` sends first;
`tcp:HOST:PORT` connects; `tcpin:[HOST:]PORT` accepts connections; `serial:DEVICE:BAUD` is a cable
or a radio. A listening address without a host listens on this machine's loopback.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

from kybflow.core.errors import DriverError
from kybflow.core.signals import Time

MOST_HELD = 10_000
"""The largest number of messages kept until they are read."""

Received = Sequence[tuple[bytes, Any]]


class Wire(ABC):
    """One connection to autopilots.

    address: as written in the mission or on the command line.
    answers: whether it can only answer senders."""

    answers: ClassVar[bool] = False

    def __init__(self, address: str) -> None:
        self.address = address

    @abstractmethod
    def receive(self, now: Time) -> Received:
        """Return the bytes since the last call, oldest first, each with its sender, which `send`
        takes as `to`. Reopens a lost connection. Never blocks, never raises."""

    @abstractmethod
    def send(self, data: bytes, to: Any = None) -> None:
        """Send one frame now, or lose it. to: the receiver, None if there is only one. Never
        blocks, never raises."""

    @abstractmethod
    def trouble(self) -> str | None:
        """Return why nothing arrives or is sent, or None if nothing is known to be wrong."""

    @abstractmethod
    def close(self) -> None: ...

    def is_open(self, sender: Any) -> bool:
        """Return whether that sender may still be connected."""
        return True


class MemoryWire(Wire):
    """One end of a pair within this process: bytes arrive at the other end in order, at once.

    deaf, mute: set by injected faults; received or sent data are lost. late: the delay of bytes to
    this end, nanoseconds, set by a fault. When it returns to zero, delayed bytes are lost."""

    other: MemoryWire
    late: Time = 0

    def __init__(self, address: str) -> None:
        super().__init__(address)
        self.deaf = self.mute = False
        self._coming: deque[bytes] = deque(maxlen=MOST_HELD)
        self._on_the_way: deque[tuple[Time, bytes]] = deque(maxlen=MOST_HELD)

    def trouble(self) -> str | None:
        return None

    def close(self) -> None:
        self._coming.clear()
        self._on_the_way.clear()

    def receive(self, now: Time) -> Received:
        waiting = self._on_the_way
        came: list[tuple[bytes, Any]] = []
        if self.late:
            waiting.extend((now, data) for data in self._coming)
            while waiting and now - waiting[0][0] >= self.late:
                came.append((waiting.popleft()[1], None))
        else:
            waiting.clear()
            came += [(data, None) for data in self._coming]
        self._coming.clear()
        return () if self.deaf else came

    def send(self, data: bytes, to: Any = None) -> None:
        if not (self.mute or self.other.deaf):
            self.other._coming.append(data)


def memory_wires(address: str = "memory") -> tuple[MemoryWire, MemoryWire]:
    """Return both ends of a pair; each can be made deaf or mute."""
    one, other = MemoryWire(address), MemoryWire(address)
    one.other, other.other = other, one
    return one, other


LOOPBACK = "127.0.0.1"
LISTENING = frozenset({"udpin", "tcpin"})
CALLING = frozenset({"udpout", "tcp"})
KINDS = ("udpin", "udpout", "tcp", "tcpin", "serial")
_PLACE = re.compile(r"(?:([^\s:/@\[\]]+):)?(\d{1,5})")
_FORMS = (
    "write `udpin:HOST:PORT`, `udpout:HOST:PORT`, `tcp:HOST:PORT`, `tcpin:HOST:PORT` or"
    " `serial:DEVICE:BAUD`"
)


_QUESTIONS = {
    "udpin": "does the autopilot send to that port, and is no other program listening on it?",
    "udpout": "does an autopilot listen there?",
    "tcp": "does an autopilot listen there, and is no other program connected?",
    "tcpin": "does the autopilot connect there?",
    "serial": "is it the right device, with the autopilot's baud rate?",
}


class Address(NamedTuple):
    """An autopilot's address. kind: one of `KINDS`. place: a host or a serial device. number: a
    port or a baud rate. Port 0, which a mission can't use, stands for any free one."""

    kind: str
    place: str
    number: int

    def __str__(self) -> str:
        return f"{self.kind}:{self.place}:{self.number}"


def read_address(text: str) -> Address:
    """Parse an address. Raises DriverError, which says what to write instead."""
    kind, _, rest = text.strip().partition(":")
    if rest.startswith("//"):  # as MAVSDK writes it
        plain = f"{kind}:{rest[2:].removeprefix(':').rstrip('/')}"
        read_address(plain)  # what else is wrong with it
        raise DriverError(f"`{text}` is no MAVLink address: write `{plain}`")
    if kind == "serial":
        device, _, baud = rest.rpartition(":")  # a device may have colons in its name
        if not device or not re.fullmatch(r"\d{3,8}", baud):
            raise DriverError(
                f"`{text}` is not a serial line: write `serial:DEVICE:BAUD`, as in"
                " `serial:/dev/ttyUSB0:57600`"
            )
        return Address("serial", device, int(baud))
    if kind == "udp":
        called = rest if ":" in rest else f"{LOOPBACK}:{rest}"
        raise DriverError(
            f"`{text}` could mean two things: write `udpin:{rest}` to wait for the autopilot to"
            f" send, or `udpout:{called}` to send first"
        )
    if kind not in KINDS:
        raise DriverError(f"`{text}` is not a MAVLink address: {_FORMS}")
    match = _PLACE.fullmatch(rest)
    if match is None:
        raise DriverError(f"`{text}` is not a MAVLink address: write `{kind}:HOST:PORT`")
    host, port = match[1], int(match[2])
    if host is None and kind in CALLING:
        raise DriverError(f"`{text}` has no host: write `{kind}:HOST:{port}`")
    if not 0 < port < 65536:
        raise DriverError(f"`{text}` has port {port}: ports go from 1 to 65535")
    return Address(kind, host or LOOPBACK, port)


def to_ask(address: str) -> str:
    """Return what to check if no autopilot is heard at an address, as a question."""
    return _QUESTIONS.get(address.partition(":")[0], "is it switched on?")
