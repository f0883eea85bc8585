"""A VRPN server: publishes poses of bodies to whoever connects, in either of the two ways.

One thread lets clients in, hears their pings and answers; `publish` sends from the caller's thread,
so that a pose waits for nobody. A client that does not keep up is dropped; none can stop another.
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
from kybflow.sensors._waker import CHUNK, Waker
from kybflow.sensors.vrpn.codec import (
    COOKIE,
    PING,
    PONG,
    POSE,
    SENDER,
    TEXT,
    CodecError,
    PoseReport,
    decode_lob,
    describe,
    encode_pose,
)
from kybflow.sensors.vrpn.link import PORT
from kybflow.sensors.vrpn.peer import Peer, SenderStatus

MOST_WAITING = 1 << 16
"""Bytes that a client may leave unread, here and as much again in the system's buffer: poses that
are older are of no use."""
CALL_BACK = 1.0
"""Seconds that a client who asked to be called back has to answer."""
MOST_CLIENTS = 100


class Server:
    """Serves from when it is made until it is closed. `port` is the one it listens on: with 0 a
    free one is taken. Raises DriverError where it can't listen."""

    def __init__(
        self, host: str = "127.0.0.1", port: int = PORT, clock: Callable[[], Time] = time.time_ns
    ) -> None:
        self._door, self._requests = _listen(host, port)
        self._clock = clock
        self._bodies: list[str] = []
        self._guests: dict[socket.socket, _Guest] = {}
        self._lock = threading.Lock()
        self._selector = selectors.DefaultSelector()
        self._waker = Waker()
        self.port: int = self._door.getsockname()[1]
        for opened in (self._door, self._requests, self._waker.ear):
            self._selector.register(opened, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._serve, name="vrpn server", daemon=True)
        self._thread.start()

    @property
    def clients(self) -> int:
        """How many are connected."""
        return len(self._guests)

    def publish(
        self, body: str, position: Vec3, attitude: Quat, stamp: Time | None = None, sensor: int = 0
    ) -> None:
        """Tell every client a pose; stamp: nanoseconds since 1970, now by default. Raises
        CodecError for a name that VRPN can't have."""
        stamp = self._clock() if stamp is None else stamp
        payload = encode_pose(PoseReport(sensor, position, attitude))
        with self._lock:
            if body not in self._bodies:
                describe(SENDER, len(self._bodies), body)  # refused here, not when a guest is told
                self._bodies.append(body)
            for guest in list(self._guests.values()):
                if guest.peer.greeted:
                    self._attempt(guest, partial(guest.pose, body, stamp, payload))

    def close(self) -> None:
        """Let everybody go and stop listening."""
        self._waker.end()
        self._thread.join()
        with self._lock:
            for guest in list(self._guests.values()):
                self._dismiss(guest)
        for opened in (self._door, self._requests, self._waker):
            opened.close()
        self._selector.close()

    def _serve(self) -> None:
        while not self._waker.ended.is_set():
            for key, events in self._selector.select():
                if key.fileobj is self._door:
                    self._admit()
                elif key.fileobj is self._requests:
                    self._requested()
                elif key.fileobj is self._waker.ear:
                    self._waker.hush()
                else:
                    self._attend(key.data, events)

    def _admit(self) -> None:
        with contextlib.suppress(OSError):  # gone again already
            stream, _ = self._door.accept()
            self._welcome(stream, None)

    def _requested(self) -> None:
        """Somebody asks to be called back: at the address that asks, not at one that it names, so
        that nobody can point us at a third."""
        try:
            data, (address, *_) = self._requests.recvfrom(CHUNK)
            _, port = decode_lob(data)
            stream = socket.create_connection((address, port), timeout=CALL_BACK)
        except (OSError, CodecError):
            return
        self._welcome(stream, address)

    def _welcome(self, stream: socket.socket, address: str | None) -> None:
        with self._lock:
            if len(self._guests) >= MOST_CLIENTS:
                stream.close()
                return
            try:
                guest = _Guest(stream, self._selector, address)
            except OSError:  # gone again already, or there are no more sockets
                stream.close()
                return
            self._guests[stream] = guest
            self._selector.register(stream, selectors.EVENT_READ, guest)
            self._attempt(guest, lambda: guest.send(COOKIE))

    def _attend(self, guest: _Guest, events: int) -> None:
        with self._lock:
            if guest.stream not in self._guests:
                return
            if events & selectors.EVENT_WRITE:
                self._attempt(guest, guest.flush)
            if events & selectors.EVENT_READ:
                self._attempt(guest, lambda: self._answer(guest))

    def _answer(self, guest: _Guest) -> None:
        data = guest.stream.recv(CHUNK)
        if not data:
            raise ConnectionResetError("left")
        greeted = guest.peer.greeted
        heard = guest.peer.hear(data)
        if guest.peer.greeted and not greeted:
            for body in self._bodies:
                guest.send(guest.peer.introduce(body, POSE, PING, PONG, TEXT))
        for sender, _, what in heard:
            if isinstance(what, SenderStatus) and what.kind == PING and sender in self._bodies:
                guest.send(guest.peer.say(sender, PONG, self._clock()))

    def _attempt(self, guest: _Guest, what: Callable[[], None]) -> None:
        """Do it; who can't be served, or speaks something else, goes."""
        try:
            what()
        except BlockingIOError:
            return
        except (OSError, CodecError):
            self._dismiss(guest)

    def _dismiss(self, guest: _Guest) -> None:
        if self._guests.pop(guest.stream, None) is not None:
            self._selector.unregister(guest.stream)
            guest.stream.close()
            guest.datagrams.close()


class _Guest:
    """One client. address: where it asked to be called back, None for one that connected."""

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
        """Send a pose: as a datagram to a client that said where to, else over TCP."""
        self.send(self.peer.introduce(body, POSE))
        where = self.peer.datagrams_to
        if self._address is None or where is None:
            self.send(self.peer.say(body, POSE, stamp, payload))
            return
        data = self.peer.say_in_datagram(body, POSE, stamp, payload)
        with contextlib.suppress(OSError):  # datagrams may be lost
            self.datagrams.sendto(data, (self._address, where[1]))

    def send(self, data: bytes) -> None:
        """Over TCP, later what does not fit now. Raises OSError."""
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
    """The door for TCP and the one for datagrams, on the same port."""
    door = requests = None
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        door = socket.socket(family, socket.SOCK_STREAM)
        door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        door.bind((host, port))
        door.listen()
        door.setblocking(False)
        requests = socket.socket(family, socket.SOCK_DGRAM)
        requests.setblocking(False)
        requests.bind((host, door.getsockname()[1]))
    except (OSError, UnicodeError) as error:
        for opened in (door, requests):
            if opened is not None:
                opened.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise DriverError(f"no VRPN server can be at {host}:{port}: {reason}") from None
    return door, requests
