"""A VRPN server: publishes poses to clients that connect by TCP or request a call-back.

One thread accepts clients and answers pings. `publish` sends from the caller's thread and never
blocks. A client that doesn't keep up is dropped, and can't delay the others.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Callable
from functools import partial

from kybflow.core.errors import DriverError
from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import Time
from kybflow.sensors._stream import CHUNK, Waker
from kybflow.sensors.vrpn.codec import (
    COOKIE,
    PING,
    PONG,
    PORT,
    POSE,
    SENDER,
    TEXT,
    CodecError,
    Peer,
    PoseReport,
    SenderStatus,
    decode_lob,
    describe,
    encode_pose,
)

MOST_WAITING = 1 << 16
"""Number of bytes that a client may leave unread in the server's buffer, and as many in the
system's buffer. Older poses are useless."""
CALL_BACK = 1.0
"""Timeout of a call-back, seconds."""
MOST_CLIENTS = 100


class Server:
    """Serves clients until `close` is called. port: the port to listen on; if 0, a free port, which
    the attribute `port` then gives. Raises DriverError if it can't listen."""

    def __init__(
        self, host: str = "127.0.0.1", port: int = PORT, clock: Callable[[], Time] = time.time_ns
    ) -> None:
        self._listener, self._requests = _listen(host, port)
        self._clock = clock
        self._bodies: list[str] = []
        self._clients: dict[socket.socket, _ClientConnection] = {}
        self._lock = threading.Lock()
        self._selector = selectors.DefaultSelector()
        self._waker = Waker()
        self.port: int = self._listener.getsockname()[1]
        for opened in (self._listener, self._requests, self._waker.receiver):
            self._selector.register(opened, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._serve, name="vrpn server", daemon=True)
        self._thread.start()

    @property
    def clients(self) -> int:
        """The number of connected clients."""
        return len(self._clients)

    def publish(
        self, body: str, position: Vec3, attitude: Quat, stamp: Time | None = None, sensor: int = 0
    ) -> None:
        """Send a pose to every client. stamp: nanoseconds since 1970; the current time by default.
        Raises CodecError if the body's name is invalid in VRPN."""
        stamp = self._clock() if stamp is None else stamp
        payload = encode_pose(PoseReport(sensor, position, attitude))
        with self._lock:
            if body not in self._bodies:
                describe(SENDER, len(self._bodies), body)  # raises on an invalid name
                self._bodies.append(body)
            for client in list(self._clients.values()):
                if client.peer.is_connected:
                    self._attempt(client, partial(client.pose, body, stamp, payload))

    def close(self) -> None:
        """Disconnect all clients and stop listening."""
        self._waker.end()
        self._thread.join()
        with self._lock:
            for client in list(self._clients.values()):
                self._drop(client)
        for opened in (self._listener, self._requests, self._waker):
            opened.close()
        self._selector.close()

    def _serve(self) -> None:
        while not self._waker.ended.is_set():
            for key, events in self._selector.select():
                if key.fileobj is self._listener:
                    with contextlib.suppress(OSError):  # the client has gone already
                        self._add_client(self._listener.accept()[0], None)
                elif key.fileobj is self._requests:
                    self._requested()
                elif key.fileobj is self._waker.receiver:
                    self._waker.drain()
                else:
                    self._serve_client(key.data, events)

    def _requested(self) -> None:
        """Connect to a client that requests a call-back. The connection goes to the sender of the
        request, not to the address in it, so that the server can't be directed at a third party."""
        try:
            data, (address, *_) = self._requests.recvfrom(CHUNK)
            _, port = decode_lob(data)
            stream = socket.create_connection((address, port), timeout=CALL_BACK)
        except (OSError, CodecError):
            return
        self._add_client(stream, address)

    def _add_client(self, stream: socket.socket, address: str | None) -> None:
        with self._lock:
            if len(self._clients) >= MOST_CLIENTS:
                stream.close()
                return
            try:
                client = _ClientConnection(stream, self._selector, address)
            except OSError:  # gone again already, or there are no more sockets
                stream.close()
                return
            self._clients[stream] = client
            self._selector.register(stream, selectors.EVENT_READ, client)
            self._attempt(client, lambda: client.send(COOKIE))

    def _serve_client(self, client: _ClientConnection, events: int) -> None:
        with self._lock:
            if client.stream not in self._clients:
                return
            if events & selectors.EVENT_WRITE:
                self._attempt(client, client.flush)
            if events & selectors.EVENT_READ:
                self._attempt(client, lambda: self._answer(client))

    def _answer(self, client: _ClientConnection) -> None:
        data = client.stream.recv(CHUNK)
        if not data:
            raise ConnectionResetError("left")
        is_connected = client.peer.is_connected
        messages = client.peer.receive(data)
        if client.peer.is_connected and not is_connected:
            for body in self._bodies:
                client.send(client.peer.introduce(body, POSE, PING, PONG, TEXT))
        for sender, _, what in messages:
            if isinstance(what, SenderStatus) and what.kind == PING and sender in self._bodies:
                client.send(client.peer.message(sender, PONG, self._clock()))

    def _attempt(self, client: _ClientConnection, what: Callable[[], None]) -> None:
        """Call `what`, and drop the client if the call fails."""
        try:
            what()
        except BlockingIOError:
            return
        except (OSError, CodecError):
            self._drop(client)

    def _drop(self, client: _ClientConnection) -> None:
        if self._clients.pop(client.stream, None) is not None:
            self._selector.unregister(client.stream)
            client.stream.close()
            client.datagrams.close()


class _ClientConnection:
    """The connection to one client. address: the address that requested a call-back; None if the
    client connected by itself."""

    def __init__(
        self, stream: socket.socket, selector: selectors.BaseSelector, address: str | None
    ) -> None:
        self.stream, self.peer = stream, Peer()
        stream.setblocking(False)
        stream.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_WAITING)
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.datagrams = socket.socket(stream.family, socket.SOCK_DGRAM)
        self.datagrams.setblocking(False)
        self._selector, self._address = selector, address
        self._unsent = bytearray()

    def pose(self, body: str, stamp: Time, payload: bytes) -> None:
        """Send a pose as a datagram if the client requested datagrams, otherwise over TCP."""
        self.send(self.peer.introduce(body, POSE))
        where = self.peer.datagrams_to
        if self._address is None or where is None:
            self.send(self.peer.message(body, POSE, stamp, payload))
            return
        data = self.peer.datagram(body, POSE, stamp, payload)
        with contextlib.suppress(OSError):  # datagrams may be lost
            self.datagrams.sendto(data, (self._address, where[1]))

    def send(self, data: bytes) -> None:
        """Send data over TCP, as much as possible now and the rest later. Raises OSError."""
        if data:
            self._unsent += data
            if len(self._unsent) > MOST_WAITING:
                raise ConnectionAbortedError("does not keep up")
            self.flush()

    def flush(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._unsent:
                del self._unsent[: self.stream.send(self._unsent)]
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if self._unsent else 0)
        if self._selector.get_key(self.stream).events != events:
            self._selector.modify(self.stream, events, self)


def _listen(host: str, port: int) -> tuple[socket.socket, socket.socket]:
    """Return the sockets for TCP and for datagrams, on the same port."""
    listener = requests = None
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen()
        listener.setblocking(False)
        requests = socket.socket(family, socket.SOCK_DGRAM)
        requests.setblocking(False)
        requests.bind((host, listener.getsockname()[1]))
    except (OSError, UnicodeError) as error:
        for opened in (listener, requests):
            if opened is not None:
                opened.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise DriverError(f"no VRPN server can be at {host}:{port}: {reason}") from None
    return listener, requests
