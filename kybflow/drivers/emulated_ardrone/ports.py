"""The ports of an emulated drone, in memory or on a loopback address.

In memory, `DroneMemoryWire` is the driver's end of the connection. On a loopback address the ports
have the numbers of a real drone: UDP 5556 for commands, UDP 5554 for navigation data, TCP 5559 for
the configuration and TCP 5555 for video. Each poll receives a bounded number of datagrams, so that
a flood can't delay a step. Navigation data goes to the client that requested it last.
"""

from __future__ import annotations

import os
import socket
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Hashable, Sequence
from errno import EADDRINUSE
from ipaddress import IPv4Address
from typing import Any

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.drivers.ardrone.at import END
from kybflow.drivers.ardrone.wire import (
    AT,
    CONTROL,
    NAVDATA,
    NAVDATA_REQUEST,
    VIDEO,
    Arrived,
    DroneWire,
)

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
        """There is not a video in memory."""

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

    def close(self) -> None:
        """There is nothing to close."""


def _emptied(waiting: deque[bytes]) -> list[tuple[bytes, Hashable]]:
    found: list[tuple[bytes, Hashable]] = [(data, CLIENT) for data in waiting]
    waiting.clear()
    return found


MOST_AT_ONCE = 64
MAX_DATAGRAM = 2048
BUFFER = 1 << 16
MOST_CLIENTS = 4
FIRST_HOST = "127.0.0.2"


def host_of(number: int, first: str = FIRST_HOST) -> str:
    """Return the address of drone `number`, counted from 0 at the address `first`. Raises
    DriverError unless it is a loopback address."""
    try:
        address = IPv4Address(first) + number
    except ValueError:
        raise DriverError(f"`{first}` is not an IPv4 address") from None
    if not address.is_loopback:
        raise DriverError(f"{address} is not a loopback address; use one of 127.x.x.x")
    return str(address)


class SocketPorts(Ports):
    """The ports of one drone at `host`. Raises DriverError if one is in use."""

    def __init__(self, host: str) -> None:
        self.host = host
        self._opened: list[socket.socket] = []
        self._clients: list[socket.socket] = []
        self._viewers: dict[socket.socket, bytes] = {}
        self._listener: Any = None
        try:
            self._at = self._open(socket.SOCK_DGRAM, AT)
            self._data = self._open(socket.SOCK_DGRAM, NAVDATA)
            self._control = self._open(socket.SOCK_STREAM, CONTROL)
            self._video = self._open(socket.SOCK_STREAM, VIDEO)
        except DriverError:
            self.close()
            raise

    def commands(self) -> Sequence[tuple[bytes, Hashable]]:
        return _received(self._at)

    def requests(self) -> Sequence[tuple[bytes, Hashable]]:
        self._accept()
        return _received(self._data)

    def answer(self, sender: Hashable) -> bool:
        self._listener = sender
        return True

    def send(self, data: bytes) -> None:
        try:
            if self._listener is not None:
                self._data.sendto(data, self._listener)
        except OSError:
            pass  # the client has gone

    def send_configuration(self, data: bytes) -> None:
        for client in [*self._clients]:
            try:
                client.sendall(data)
            except OSError:
                self._clients.remove(client)
                client.close()

    @property
    def is_watched(self) -> bool:
        return bool(self._viewers)

    def send_video(self, data: bytes) -> None:
        for viewer, left in [*self._viewers.items()]:
            try:
                rest = left or data  # a client that still receives the last picture misses this one
                self._viewers[viewer] = rest[viewer.send(rest) :] if rest else b""
            except BlockingIOError:
                continue
            except OSError:
                del self._viewers[viewer]
                viewer.close()

    def close(self) -> None:
        for opened in (*self._clients, *self._viewers, *self._opened):
            opened.close()

    def _open(self, kind: socket.SocketKind, port: int) -> socket.socket:
        opened = socket.socket(socket.AF_INET, kind)
        self._opened.append(opened)
        opened.setblocking(False)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        if kind is socket.SOCK_STREAM:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            opened.bind((self.host, port))
            if kind is socket.SOCK_STREAM:
                opened.listen(MOST_CLIENTS)
        except OSError as error:
            name = "TCP" if kind is socket.SOCK_STREAM else "UDP"
            why = os.strerror(error.errno or 0).lower()
            words = f"no drone can be at {self.host}, {name} port {port}: {why}"
            if error.errno == EADDRINUSE:
                words += "; is another emulated drone there? End it, or take another address"
            raise DriverError(words) from None
        return opened

    def _accept(self) -> None:
        client = _accepted(self._control)
        if client is not None:
            self._clients.append(client)
            if len(self._clients) > MOST_CLIENTS:
                self._clients.pop(0).close()
        viewer = _accepted(self._video)
        if viewer is not None:
            self._viewers[viewer] = b""
            if len(self._viewers) > MOST_CLIENTS:
                oldest = next(iter(self._viewers))
                del self._viewers[oldest]
                oldest.close()


def _accepted(listening: socket.socket) -> socket.socket | None:
    try:
        client, _ = listening.accept()
    except OSError:
        return None
    client.setblocking(False)
    return client


def _received(opened: socket.socket) -> list[tuple[bytes, Hashable]]:
    found: list[tuple[bytes, Hashable]] = []
    while len(found) < MOST_AT_ONCE:
        try:
            found.append(opened.recvfrom(MAX_DATAGRAM))
        except OSError:
            break
    return found
