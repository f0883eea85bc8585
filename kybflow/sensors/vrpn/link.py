"""The sockets of a VRPN client's connection to a server."""

from __future__ import annotations

import re
import selectors
import socket
import struct
import time
from typing import NamedTuple

from kybflow.core.errors import DriverError
from kybflow.sensors._waker import CHUNK, Waker
from kybflow.sensors.vrpn.codec import COOKIE, encode_lob

PORT = 3883
TIMEOUT = 2.0
"""Seconds to wait for a server's answer. Requests by datagram must be at least this far apart."""
_AT_ONCE = struct.pack("ii", 1, 0)
"""Value of SO_LINGER with which a socket closes by a reset when the server has gone, so that a new
server can use the port at once. The C++ server doesn't set SO_REUSEADDR and would have to wait for
a minute."""
_ADDRESS = re.compile(r"(?:(tcp)://)?([^\s:/@\[\]]+|\[[0-9A-Fa-f:.]+\])(?::(\d{1,5}))?")


class ServerAddress(NamedTuple):
    """The address of a server. direct: connect by TCP (VRPN's `tcp://HOST`); otherwise request a
    TCP call-back by datagram, and receive poses as datagrams (VRPN's `HOST`)."""

    host: str
    port: int = PORT
    direct: bool = True

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def read_address(text: str, direct: bool) -> ServerAddress:
    """Return the address written as `HOST`, `HOST:PORT` or, if `direct`, `tcp://HOST:PORT`. Raises
    DriverError if it is invalid."""
    match = _ADDRESS.fullmatch(text.strip())
    port = int(match[3] or PORT) if match else 0
    if match is None or not 0 < port < 65536:
        raise DriverError(f"`{text}` is no VRPN server: write `HOST` or `HOST:{PORT}`")
    if match[1] and not direct:
        raise DriverError(f"`{text}` asks for TCP alone: leave out `tcp://` or `opening: lob`")
    return ServerAddress(match[2].strip("[]"), port, direct)


class Connection:
    """An open connection. here: the local address that receives datagrams; None without
    datagrams."""

    def __init__(self, address: ServerAddress, waker: Waker) -> None:
        """Connect. Raises OSError if there is no server, and InterruptedError if `waker` is ended
        during the attempt."""
        self.here: tuple[str, int] | None = None
        self._datagrams: socket.socket | None = None
        self._waker = waker
        self._selector = selectors.DefaultSelector()
        self._selector.register(waker.receiver, selectors.EVENT_READ)
        self._stream: socket.socket | None = None
        try:
            self._stream = _dial(address) if address.direct else self._ask(address)
            self._stream.settimeout(TIMEOUT)
            self._stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._server = self._stream.getpeername()[0]
            self._stream.sendall(COOKIE)
            self._selector.register(self._stream, selectors.EVENT_READ)
        except BaseException:
            self.close()
            raise

    def send(self, data: bytes) -> None:
        """Send data over TCP. Raises OSError."""
        if self._stream is not None and data:
            self._stream.sendall(data)

    def wait(self, seconds: float) -> tuple[bytes, list[bytes]]:
        """Wait for data for at most `seconds`. Return the bytes from TCP, and the datagrams; both
        are empty after a timeout or a wake-up. Raises OSError when the connection is lost."""
        stream, datagrams = b"", []
        for key, _ in self._selector.select(seconds):
            if key.fileobj is self._waker.receiver:
                self._waker.drain()
            elif key.fileobj is self._datagrams:
                datagrams = self._drain()
            elif self._stream is not None:
                stream = self._stream.recv(CHUNK)
                if not stream:
                    self._stream.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
                    raise ConnectionResetError("the server closed the connection")
        return stream, datagrams

    def close(self) -> None:
        self._selector.close()
        for opened in (self._stream, self._datagrams):
            if opened is not None:
                opened.close()

    def _drain(self) -> list[bytes]:
        """Return the datagrams that have arrived from the server, at most 100."""
        received: list[bytes] = []
        while self._datagrams is not None and len(received) < 100:
            try:
                data, (sender, *_) = self._datagrams.recvfrom(CHUNK)
            except BlockingIOError:
                break
            if sender == self._server:
                received.append(data)
        return received

    def _ask(self, address: ServerAddress) -> socket.socket:
        """Request a call-back by datagram. Return the socket on which the server connects."""
        family, _, _, _, place = socket.getaddrinfo(
            address.host, address.port, type=socket.SOCK_DGRAM
        )[0]
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect(place)  # sends nothing, but selects our address
            own = probe.getsockname()[0]
        self._datagrams = socket.socket(family, socket.SOCK_DGRAM)
        self._datagrams.setblocking(False)
        self._datagrams.bind((own, 0))
        self.here = (own, self._datagrams.getsockname()[1])
        with socket.socket(family, socket.SOCK_STREAM) as listener:
            listener.bind((own, 0))
            listener.listen(1)
            self._datagrams.sendto(encode_lob(own, listener.getsockname()[1]), place)
            stream = self._called(listener)
        self._selector.register(self._datagrams, selectors.EVENT_READ)
        return stream

    def _called(self, listener: socket.socket) -> socket.socket:
        with selectors.DefaultSelector() as selector:
            selector.register(listener, selectors.EVENT_READ)
            selector.register(self._waker.receiver, selectors.EVENT_READ)
            deadline = time.monotonic() + TIMEOUT
            while (left := deadline - time.monotonic()) > 0.0:
                ready = [key.fileobj for key, _ in selector.select(left)]
                if listener in ready:
                    return listener.accept()[0]
                self._waker.drain()
                if self._waker.ended.is_set():
                    raise InterruptedError("closed while it was opened")
        raise TimeoutError("no server answered the request to call back")


def _dial(address: ServerAddress) -> socket.socket:
    return socket.create_connection((address.host, address.port), timeout=TIMEOUT)
