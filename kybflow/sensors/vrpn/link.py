"""Sockets of one VRPN link as a client: opens it in one of two ways, moves bytes, closes it."""

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
ANSWER = 2.0
"""Seconds that a server has to answer; a request by datagram may not come more often."""
_AT_ONCE = struct.pack("ii", 1, 0)
"""Close by a reset: after a server that has gone, so that its port is free for its successor. Else
it waits for a minute, and the C++ server does not ask for it regardless."""
_ADDRESS = re.compile(r"(?:(tcp)://)?([^\s:/@\[\]]+|\[[0-9A-Fa-f:.]+\])(?::(\d{1,5}))?")


class ServerAddress(NamedTuple):
    """A server. direct: open it by TCP (as VRPN's `tcp://HOST` does); else ask by a datagram to be
    called back by TCP, then poses come as datagrams (as VRPN's `HOST` does)."""

    host: str
    port: int = PORT
    direct: bool = True

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def read_address(text: str, direct: bool) -> ServerAddress:
    """`HOST`, `HOST:PORT` or, where that agrees with `direct`, `tcp://HOST:PORT`. Raises
    DriverError."""
    match = _ADDRESS.fullmatch(text.strip())
    port = int(match[3] or PORT) if match else 0
    if match is None or not 0 < port < 65536:
        raise DriverError(f"`{text}` is no VRPN server: write `HOST` or `HOST:{PORT}`")
    if match[1] and not direct:
        raise DriverError(f"`{text}` asks for TCP alone: leave out `tcp://` or `opening: lob`")
    return ServerAddress(match[2].strip("[]"), port, direct)


class Connection:
    """An open link. `here` is where datagrams are awaited, None where none are."""

    def __init__(self, address: ServerAddress, waker: Waker) -> None:
        """Raises OSError where there is no server, InterruptedError when ended meanwhile."""
        self.here: tuple[str, int] | None = None
        self._datagrams: socket.socket | None = None
        self._waker = waker
        self._selector = selectors.DefaultSelector()
        self._selector.register(waker.ear, selectors.EVENT_READ)
        self._stream: socket.socket | None = None
        try:
            self._stream = _dial(address) if address.direct else self._ask(address)
            self._stream.settimeout(ANSWER)
            self._stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._server = self._stream.getpeername()[0]
            self._stream.sendall(COOKIE)
            self._selector.register(self._stream, selectors.EVENT_READ)
        except BaseException:
            self.close()
            raise

    def send(self, data: bytes) -> None:
        """Over TCP. Raises OSError."""
        if self._stream is not None and data:
            self._stream.sendall(data)

    def wait(self, seconds: float) -> tuple[bytes, list[bytes]]:
        """What comes first within so many seconds: bytes over TCP, datagrams; both empty when
        nothing does or when woken. Raises OSError when the link is lost."""
        stream, datagrams = b"", []
        for key, _ in self._selector.select(seconds):
            if key.fileobj is self._waker.ear:
                self._waker.hush()
            elif key.fileobj is self._datagrams:
                datagrams = self._drain()
            elif self._stream is not None:
                stream = self._stream.recv(CHUNK)
                if not stream:
                    self._stream.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE)
                    raise ConnectionResetError("the server closed the link")
        return stream, datagrams

    def close(self) -> None:
        self._selector.close()
        for opened in (self._stream, self._datagrams):
            if opened is not None:
                opened.close()

    def _drain(self) -> list[bytes]:
        """Every datagram of the server that has come; another's are not for us."""
        came: list[bytes] = []
        while self._datagrams is not None and len(came) < 100:
            try:
                data, (sender, *_) = self._datagrams.recvfrom(CHUNK)
            except BlockingIOError:
                break
            if sender == self._server:
                came.append(data)
        return came

    def _ask(self, address: ServerAddress) -> socket.socket:
        """Ask the server by a datagram, and let it in when it calls."""
        family, _, _, _, place = socket.getaddrinfo(
            address.host, address.port, type=socket.SOCK_DGRAM
        )[0]
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect(place)  # sends nothing, but tells which of our addresses it sees
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
            selector.register(self._waker.ear, selectors.EVENT_READ)
            deadline = time.monotonic() + ANSWER
            while (left := deadline - time.monotonic()) > 0.0:
                ready = [key.fileobj for key, _ in selector.select(left)]
                if listener in ready:
                    return listener.accept()[0]
                self._waker.hush()
                if self._waker.ended.is_set():
                    raise InterruptedError("closed while it was opened")
        raise TimeoutError("no server answered the request to call back")


def _dial(address: ServerAddress) -> socket.socket:
    return socket.create_connection((address.host, address.port), timeout=ANSWER)
