"""Wires: connections that carry bytes to and from autopilots and are polled without blocking. The
router reads and writes them; `MemoryWire` connects two ends within this process."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Any, ClassVar

from kybflow.core.signals import Time

MOST_HELD = 10_000
"""The largest number of messages kept until they are read."""

Received = Sequence[tuple[bytes, Any]]


class Wire(ABC):
    """One connection to autopilots.

    address: as written in the mission or on the command line.
    answers: whether it can only answer senders.
    deaf, mute: set by injected faults; what arrives, or what is sent, is lost."""

    answers: ClassVar[bool] = False

    def __init__(self, address: str) -> None:
        self.address = address
        self.deaf = False
        self.mute = False

    def receive(self, now: Time) -> Received:
        """Return the bytes since the last call, oldest first, each with its sender, which `send`
        takes as `to`. Reopens a lost connection. Never blocks, never raises."""
        received = self._receive(now)
        return () if self.deaf else received

    def send(self, data: bytes, to: Any = None) -> None:
        """Send one frame now, or lose it. to: the receiver, None if there is only one. Never
        blocks, never raises."""
        if not self.mute:
            self._send(data, to)

    @abstractmethod
    def trouble(self) -> str | None:
        """Return why nothing arrives or is sent, or None if nothing is known to be wrong."""

    @abstractmethod
    def close(self) -> None: ...

    def is_open(self, sender: Any) -> bool:
        """Return whether that sender may still be connected."""
        return True

    @abstractmethod
    def _receive(self, now: Time) -> Received: ...

    @abstractmethod
    def _send(self, data: bytes, to: Any) -> None: ...


class MemoryWire(Wire):
    """One end of a pair within this process: bytes arrive at the other end in order, at once.

    late: the delay of bytes to this end, nanoseconds, set by a fault. When it returns to zero,
    delayed bytes are lost."""

    other: MemoryWire
    late: Time = 0

    def __init__(self, address: str) -> None:
        super().__init__(address)
        self._coming: deque[bytes] = deque(maxlen=MOST_HELD)
        self._on_the_way: deque[tuple[Time, bytes]] = deque(maxlen=MOST_HELD)

    def trouble(self) -> str | None:
        return None

    def close(self) -> None:
        self._coming.clear()
        self._on_the_way.clear()

    def _receive(self, now: Time) -> Received:
        if self.late:
            return self._delayed(now)
        if self._on_the_way:
            self._on_the_way.clear()
        came = [(data, None) for data in self._coming]
        self._coming.clear()
        return came

    def _delayed(self, now: Time) -> Received:
        """Return the bytes that arrived at least `late` before `now`."""
        waiting = self._on_the_way
        waiting.extend((now, data) for data in self._coming)
        self._coming.clear()
        came = []
        while waiting and now - waiting[0][0] >= self.late:
            came.append((waiting.popleft()[1], None))
        return came

    def _send(self, data: bytes, to: Any) -> None:
        if not self.other.deaf:
            self.other._coming.append(data)


def memory_wires(address: str = "memory") -> tuple[MemoryWire, MemoryWire]:
    """Return both ends of a pair; each can be made deaf or mute."""
    one, other = MemoryWire(address), MemoryWire(address)
    one.other, other.other = other, one
    return one, other
