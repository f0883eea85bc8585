"""MAVLink over TCP: a client that opens its link again, and a server of several clients."""

from __future__ import annotations

import socket
from errno import EINPROGRESS
from typing import Any, ClassVar

from kybflow.core.signals import Time
from kybflow.drivers.mavlink.transport.address import Address
from kybflow.drivers.mavlink.transport.pipe import Pipe, Reopening, listening, socket_pipe, target
from kybflow.drivers.mavlink.transport.wire import Received, Wire

MOST_CLIENTS = 32


class TcpClient(Reopening):
    """Connects, and connects again when it is lost."""

    def __init__(self, address: Address) -> None:
        """Raises DriverError where nobody knows the host."""
        super().__init__(address)
        self._place = target(address)
        self._socket: socket.socket | None = None

    def _begin(self) -> None:
        self._socket = _quick(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
        failed = self._socket.connect_ex(self._place)
        if failed not in {0, EINPROGRESS}:
            raise OSError(failed, "")

    def _opened(self) -> Pipe | None:
        if self._socket is None:
            return None
        if failed := self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            raise OSError(failed, "")
        try:
            self._socket.getpeername()
        except OSError:
            return None
        return socket_pipe(self._socket)

    def _end(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class TcpServer(Wire):
    """Lets others connect. `port`: where it listens."""

    answers: ClassVar[bool] = True

    def __init__(self, address: Address) -> None:
        """Raises DriverError."""
        super().__init__(str(address))
        self._listener = listening(address, socket.SOCK_STREAM)
        self._listener.listen(MOST_CLIENTS)
        self.port: int = self._listener.getsockname()[1]
        self._clients: dict[tuple[str, int], tuple[socket.socket, Pipe]] = {}

    def trouble(self) -> str | None:
        return None

    def close(self) -> None:
        self._listener.close()
        for sender in list(self._clients):
            self._drop(sender)

    def is_open(self, sender: Any) -> bool:
        return sender in self._clients

    def _receive(self, now: Time) -> Received:
        self._accept()
        came: list[tuple[bytes, Any]] = []
        for sender, (_, pipe) in list(self._clients.items()):
            try:
                if data := pipe.read():
                    came.append((data, sender))
            except OSError:
                self._drop(sender)
        return came

    def _send(self, data: bytes, to: Any) -> None:
        """To every client where nobody is named."""
        for sender in list(self._clients) if to is None else [to]:
            if sender not in self._clients:
                continue
            try:
                self._clients[sender][1].write(data)
            except OSError:
                self._drop(sender)

    def _accept(self) -> None:
        while len(self._clients) < MOST_CLIENTS:
            try:
                client, sender = self._listener.accept()
            except OSError:  # nobody is there, or has gone meanwhile
                return
            self._clients[sender] = (_quick(client), socket_pipe(client))

    def _drop(self, sender: Any) -> None:
        self._clients.pop(sender)[0].close()


def _quick(opened: socket.socket) -> socket.socket:
    """Neither waits nor lets a frame wait for the next."""
    opened.setblocking(False)
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return opened
