"""MAVLink over UDP and TCP: datagrams from many or to one place, a TCP client that reconnects, and
a TCP server for several clients."""

from __future__ import annotations

import socket
from errno import EINPROGRESS
from typing import Any, ClassVar

from kybflow.core.signals import Time
from kybflow.drivers.mavlink.transport.address import Address
from kybflow.drivers.mavlink.transport.wire import (
    Pipe,
    Received,
    ReopeningWire,
    Wire,
    listener,
    os_error,
    resolved,
    socket_pipe,
)

MOST_AT_ONCE = 1000
MOST_BYTES = 1 << 16
"""What is taken in one poll, in datagrams and in bytes, so that a flood can't hold up a tick."""
LONGEST = 65536
ROOM = 1 << 20
"""Bytes that the system keeps for us while a tick is late."""


class _Udp(Wire):
    """One socket for datagrams, and what was last wrong with it."""

    def __init__(self, address: Address, opened: socket.socket) -> None:
        super().__init__(str(address))
        self._socket = opened
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, ROOM)
        self._trouble: str | None = None

    def trouble(self) -> str | None:
        return self._trouble

    def close(self) -> None:
        self._socket.close()


class UdpIn(_Udp):
    """Waits for datagrams, and answers whoever sent them; several vehicles may come to one port.
    `port`: where it listens."""

    answers: ClassVar[bool] = True

    def __init__(self, address: Address) -> None:
        """Raises DriverError."""
        super().__init__(address, listener(address, socket.SOCK_DGRAM))
        self.port: int = self._socket.getsockname()[1]
        self._newest: Any = None

    def _receive(self, now: Time) -> Received:
        came: list[tuple[bytes, Any]] = []
        left = MOST_BYTES
        try:
            while left > 0 and len(came) < MOST_AT_ONCE:
                came.append(self._socket.recvfrom(LONGEST))
                left -= len(came[-1][0])
        except BlockingIOError:
            pass
        except OSError as error:
            self._trouble = f"{self.address}: {os_error(error)}"
        if came:
            self._newest, self._trouble = came[-1][1], None
        return came

    def _send(self, data: bytes, to: Any) -> None:
        """To the newest sender where nobody is named; to nobody before one was heard."""
        if (to := to or self._newest) is None:
            return
        try:
            self._socket.sendto(data, to)
        except BlockingIOError:
            pass  # no room: lost, as any datagram may be
        except OSError as error:
            self._trouble = f"{self.address}: {os_error(error)}"


class UdpOut(_Udp):
    """Sends datagrams to one place, and hears what comes back from there alone."""

    def __init__(self, address: Address) -> None:
        """Raises DriverError."""
        super().__init__(address, socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self._socket.setblocking(False)
        self._socket.connect(resolved(address))

    def _receive(self, now: Time) -> Received:
        came: list[tuple[bytes, Any]] = []
        left = MOST_BYTES
        for _ in range(MOST_AT_ONCE):
            try:
                came.append((self._socket.recv(LONGEST), None))
                left -= len(came[-1][0])
            except BlockingIOError:
                break
            except OSError as error:  # that nobody listens there, after something was sent
                self._trouble = f"{self.address}: {os_error(error)}"
            if left <= 0:
                break
        if came:
            self._trouble = None
        return came

    def _send(self, data: bytes, to: Any) -> None:
        for _ in range(2):  # the first may fail for what was sent before
            try:
                self._socket.send(data)
            except BlockingIOError:
                return
            except OSError as error:
                self._trouble = f"{self.address}: {os_error(error)}"
            else:
                return


MOST_CLIENTS = 32


class TcpClient(ReopeningWire):
    """Connects, and connects again when it is lost."""

    def __init__(self, address: Address) -> None:
        """Raises DriverError where nobody knows the host."""
        super().__init__(address)
        self._place = resolved(address)
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
        self._listener = listener(address, socket.SOCK_STREAM)
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
