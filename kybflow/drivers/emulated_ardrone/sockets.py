"""A drone's ports on a loopback address, with the port numbers of a real drone.

The ports are UDP 5556 for commands, UDP 5554 for navigation data, TCP 5559 for the configuration
and TCP 5555 for video. Each poll receives a bounded number of datagrams, so that a flood can't
delay a step. Navigation data goes to the client that requested it last.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Hashable, Sequence
from ipaddress import IPv4Address
from typing import Any

from kybflow.core.errors import DriverError
from kybflow.drivers.ardrone.transport.wire import AT, CONTROL, NAVDATA, VIDEO
from kybflow.drivers.emulated_ardrone.ports import Ports

MOST_AT_ONCE = 64
LONGEST = 2048
BUFFER = 1 << 16
MOST_CLIENTS = 4
FIRST_HOST = "127.0.0.2"


def host_of(number: int, first: str = FIRST_HOST) -> str:
    """Return the address of drone `number`, counted from 0 at the address `first`. Raises
    DriverError unless it is a loopback address."""
    try:
        address = IPv4Address(first) + number
    except ValueError:
        raise DriverError(f"`{first}` is no IPv4 address") from None
    if not address.is_loopback:
        raise DriverError(f"{address} is no loopback address; use one of 127.x.x.x")
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
        except OSError as error:
            self.close()
            words = os.strerror(error.errno or 0).lower()
            raise DriverError(f"the ports of a drone at {host}: {words}") from None

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
        opened.bind((self.host, port))
        if kind is socket.SOCK_STREAM:
            opened.listen(MOST_CLIENTS)
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
            found.append(opened.recvfrom(LONGEST))
        except OSError:
            break
    return found
