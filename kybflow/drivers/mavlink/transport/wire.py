"""Wires: bytes to and from autopilots, polled, never waiting.

`Wire` is what the router reads and writes, `MemoryWire` one in this process, and `ReopeningWire`
what a TCP client and a serial line share: a connection that is opened again after it was lost."""

from __future__ import annotations

import os
import socket
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.transport.address import Address

MOST_HELD = 10_000
"""How many messages are kept for a reader that does not come."""

Received = Sequence[tuple[bytes, Any]]


class Wire(ABC):
    """One way to reach autopilots. `address`: as written. `answers`: whether only those can be
    reached that were heard. Faults set `deaf` (what arrives is lost) and `mute` (what is sent is
    lost)."""

    answers: ClassVar[bool] = False

    def __init__(self, address: str) -> None:
        self.address = address
        self.deaf = False
        self.mute = False

    def receive(self, now: Time) -> Received:
        """What arrived since the last call, oldest first, each with its sender, which `send` takes
        as `to`. Opens a lost connection again; never waits, never raises."""
        received = self._receive(now)
        return () if self.deaf else received

    def send(self, data: bytes, to: Any = None) -> None:
        """Send one frame, or lose it: what can't be sent at once is not sent later. to: the
        receiver, None for the only one. Never waits, never raises."""
        if not self.mute:
            self._send(data, to)

    @abstractmethod
    def trouble(self) -> str | None:
        """Why nothing arrives or is sent, None while nothing is known to be wrong."""

    @abstractmethod
    def close(self) -> None: ...

    def is_open(self, sender: Any) -> bool:
        """Whether that sender may still be there."""
        return True

    @abstractmethod
    def _receive(self, now: Time) -> Received: ...

    @abstractmethod
    def _send(self, data: bytes, to: Any) -> None: ...


class MemoryWire(Wire):
    """One end of a pair in this process: what is sent here arrives at the other end, in order, at
    once. late: nanoseconds by which what is sent to this end arrives later, which a fault sets;
    what is on its way is lost when that is zero again."""

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
        """What came `late` before `now`."""
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
    """Both ends of a pair; each can be made deaf or mute."""
    one, other = MemoryWire(address), MemoryWire(address)
    one.other, other.other = other, one
    return one, other


CHUNK = 1 << 16
"""The most bytes taken in one poll, so that a flood can't hold up a tick."""
SOON: Time = NS // 4
LATE: Time = 2 * NS
"""The first and the longest pause between two attempts to open; it doubles each time."""
PATIENCE: Time = 3 * NS
"""How long an attempt to open may last."""


def os_error(error: OSError) -> str:
    """A system error in a few words."""
    return os.strerror(error.errno).lower() if error.errno else str(error).lower()


def resolved(address: Address) -> tuple[str, int]:
    """The address of a host. Raises DriverError."""
    try:
        found = socket.getaddrinfo(address.place, address.number, socket.AF_INET)
    except OSError as error:
        raise DriverError(f"`{address}`: no host `{address.place}`: {error.strerror}") from error
    host, port = found[0][4][:2]
    return str(host), int(port)


def listener(address: Address, kind: socket.SocketKind) -> socket.socket:
    """A bound socket that does not block. Raises DriverError."""
    place = resolved(address)
    opened = socket.socket(socket.AF_INET, kind)
    opened.setblocking(False)
    if kind == socket.SOCK_STREAM:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        opened.bind(place)
    except OSError as error:
        opened.close()
        raise DriverError(
            f"can't listen at `{address}`: {os_error(error)}; is a ground station or another run"
            " there? Close it, or take another port"
        ) from error
    return opened


class Pipe:
    """Bytes in and out of what does not wait. read(most): b"" where nothing has come; write: how
    many bytes it took. Both raise OSError when it is lost.

    A frame that went out in part is finished first; what is sent meanwhile is lost, since a
    setpoint that comes late is worse than none.
    """

    def __init__(self, read: Callable[[int], bytes], write: Callable[[bytes], int]) -> None:
        self._read, self._write = read, write
        self._rest = b""

    def read(self) -> bytes:
        self._flush()
        return self._read(CHUNK)

    def write(self, data: bytes) -> None:
        self._flush()
        if not self._rest:
            taken = self._write(data)
            self._rest = data[taken:] if taken else b""

    def _flush(self) -> None:
        if self._rest:
            self._rest = self._rest[self._write(self._rest) :]


def socket_pipe(opened: socket.socket) -> Pipe:
    """A pipe over a connected socket."""

    def read(most: int) -> bytes:
        try:
            data = opened.recv(most)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError("the other end closed it")
        return data

    def write(data: bytes) -> int:
        try:
            return opened.send(data)
        except BlockingIOError:
            return 0

    return Pipe(read, write)


class ReopeningWire(Wire):
    """A wire to one other end that is opened again when it is lost, with growing pauses."""

    def __init__(self, address: Address) -> None:
        super().__init__(str(address))
        self._pipe: Pipe | None = None
        self._trouble: str | None = f"{address}: not open yet"
        self._began: Time | None = None
        self._next: Time | None = None
        self._pause: Time = SOON
        self._now: Time = 0

    def trouble(self) -> str | None:
        return self._trouble

    def close(self) -> None:
        self._pipe = None
        self._end()

    def _receive(self, now: Time) -> Received:
        self._now = now
        try:
            pipe = self._pipe or self._open(now)
            data = pipe.read() if pipe is not None else b""
        except OSError as error:
            self._lost(error)
            return ()
        if data:
            self._pause = SOON
        return ((data, None),) if data else ()

    def _send(self, data: bytes, to: Any) -> None:
        if self._pipe is None:
            return
        try:
            self._pipe.write(data)
        except OSError as error:
            self._lost(error)

    def _open(self, now: Time) -> Pipe | None:
        if self._began is None:
            if self._next is not None and now < self._next:
                return None
            self._began = now
            self._begin()
        self._pipe = self._opened()
        if self._pipe is not None:
            self._trouble = None
        elif now > self._began + PATIENCE:
            raise TimeoutError("nobody answers")
        return self._pipe

    def _lost(self, error: OSError) -> None:
        self._trouble = f"{self.address}: {self._words(error)}"
        self._pipe = self._began = None
        self._next = self._now + self._pause
        self._pause = min(2 * self._pause, LATE)
        self._end()

    def _words(self, error: OSError) -> str:
        return os_error(error)

    @abstractmethod
    def _begin(self) -> None:
        """Begin to open. Raises OSError."""

    @abstractmethod
    def _opened(self) -> Pipe | None:
        """What was opened, None while opening is under way. Raises OSError."""

    @abstractmethod
    def _end(self) -> None:
        """Close what is open, if anything is."""
