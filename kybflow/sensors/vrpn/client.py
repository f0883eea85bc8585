"""Poses from VRPN servers. Each server has one thread, shared by all its subscriptions.

The thread connects, with growing pauses between attempts, pings silent bodies, converts the
server's time stamps to the local clock, and passes poses on as immutable values. Readers never
block and never get an exception: without a server there are no poses, and `trouble` gives the
reason.
"""

from __future__ import annotations

import re
import selectors
import socket
import struct
import threading
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from kybflow.core.clock_offset import Offset
from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.sensors._stream import CHUNK, PoseSource, TrackerPose, Waker
from kybflow.sensors.vrpn.codec import (
    COOKIE,
    PING,
    PORT,
    CodecError,
    Peer,
    PoseReport,
    SenderMessage,
    encode_lob,
)

WAIT_S = 2.0
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
        raise DriverError(f"`{text}` is not a VRPN server: write `HOST` or `HOST:{PORT}`")
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
            if address.direct:
                self._stream = socket.create_connection((address.host, address.port), WAIT_S)
            else:
                self._stream = self._ask(address)
            self._stream.settimeout(WAIT_S)
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
            deadline = time.monotonic() + WAIT_S
            while (left := deadline - time.monotonic()) > 0.0:
                ready = [key.fileobj for key, _ in selector.select(left)]
                if listener in ready:
                    return listener.accept()[0]
                self._waker.drain()
                if self._waker.ended.is_set():
                    raise InterruptedError("closed while it was opened")
        raise TimeoutError("no server answered the request to call back")


FIRST_PAUSE, LONGEST_PAUSE = 0.1, 2.0
"""Seconds between the starts of two attempts to connect: the first value, doubled after each
failure up to the second."""
PING_EVERY: Time = NS
SILENCE_NS: Time = 5 * NS
"""Time without data, in spite of pings, after which the connection counts as lost."""
REORDERING_NS: Time = NS // 5
"""A time stamp that is older than the last by less than this belongs to a reordered message. A
larger step back means that the server's clock was set."""


MOST_STILL = 20
"""Number of poses in a row with one time stamp after which the stamps count as standing still."""


class Key(NamedTuple):
    body: str
    sensor: int


class VrpnSubscription(PoseSource):
    """A subscription to one sensor of a body at a server."""

    def __init__(self, client: Client, key: Key) -> None:
        super().__init__()
        self.key = key
        self._client = client

    def trouble(self) -> str | None:
        return self._client.trouble(self.key)

    def close(self) -> None:
        with _lock:
            if self._client.drop(self):
                _clients.pop(self._client.address, None)
        self._client.end_if_unused()


class Client:
    """The connection to one server, and its thread."""

    def __init__(
        self, address: ServerAddress, clock: Callable[[], Time] = time.monotonic_ns
    ) -> None:
        self.address = address
        self._clock = clock
        self._wanted: Mapping[Key, tuple[VrpnSubscription, ...]] = {}
        self._reason: str | None = "not connected yet"
        self._sensors: frozenset[Key] = frozenset()
        self._still: frozenset[Key] = frozenset()
        self._waker = Waker()
        self._thread = threading.Thread(target=self._run, name=f"vrpn {address}", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def add(self, key: Key) -> VrpnSubscription:
        subscription = VrpnSubscription(self, key)
        self._wanted = {**self._wanted, key: (*self._wanted.get(key, ()), subscription)}
        self._waker.wake()
        return subscription

    def drop(self, subscription: VrpnSubscription) -> bool:
        """Remove a subscription; return whether it was the last."""
        left = {k: tuple(s for s in v if s is not subscription) for k, v in self._wanted.items()}
        self._wanted = {key: rest for key, rest in left.items() if rest}
        return not self._wanted

    def end_if_unused(self) -> None:
        """End the thread if there are no subscriptions."""
        if self._wanted or self._waker.ended.is_set():
            return
        self._waker.end()
        self._thread.join(1.0)

    def trouble(self, key: Key) -> str | None:
        """Return why no poses of `key` arrive; None if they do."""
        reason, sensors = self._reason, self._sensors
        if reason is not None:
            return f"no VRPN server at {self.address}: {reason}"
        if key in self._still:
            return (
                f"the time stamps of `{key.body}` stand still, so that none of its poses is new:"
                f" let {self.address} stamp each"
            )
        if key in sensors:
            return None
        others = sorted(other.sensor for other in sensors if other.body == key.body)
        if others:
            which = ", ".join(map(str, others))
            return f"`{key.body}` has no sensor {key.sensor}, but {which}"
        bodies = sorted({other.body for other in sensors})
        names = ", ".join(f"`{name}`" for name in bodies[:8]) or "nothing else"
        more = f" and {len(bodies) - 8} more" if len(bodies) > 8 else ""
        return f"{self.address} sends no `{key.body}`, but {names}{more}"

    def _run(self) -> None:
        pause = FIRST_PAUSE
        while not self._waker.ended.is_set():
            began = self._clock()
            try:
                self._connect()
            except (OSError, UnicodeError, DriverError) as error:
                connected = self._reason is None
                self._reason = getattr(error, "strerror", None) or str(error)
                self._sensors = frozenset()
                pause = FIRST_PAUSE if connected else min(2.0 * pause, LONGEST_PAUSE)
            self._waker.ended.wait(max(0.0, pause - (self._clock() - began) / NS))
        self._waker.close()

    def _connect(self) -> None:
        """Connect, and deliver poses until the thread must end. Raises OSError or CodecError if the
        connection fails or is lost."""
        connection = Connection(self.address, self._waker)
        try:
            listener = _Reader(connection, self._clock)
            while not self._waker.ended.is_set():
                listener.receive(self._wanted)
                if listener.peer.is_connected:
                    self._sensors = frozenset(listener.last)
                    self._still = frozenset(k for k, n in listener.still.items() if n > MOST_STILL)
                    self._reason = None
        finally:
            connection.close()


class _Reader:
    """Delivers the poses of one connection. last: the latest time stamp of each sensor. still: how
    many poses in a row had that same stamp."""

    def __init__(self, connection: Connection, clock: Callable[[], Time]) -> None:
        self.peer = Peer()
        self.last: dict[Key, Time] = {}
        self.still: dict[Key, int] = {}
        self._connection, self._clock = connection, clock
        self._offset = Offset()
        self._last_data = clock()
        self._pinged: Time | None = None
        self._last_pose: dict[str, Time] = {}

    def receive(self, wanted: Mapping[Key, tuple[VrpnSubscription, ...]]) -> None:
        """Wait for data until the next ping may be due, and deliver it. Raises TimeoutError if the
        server sends nothing for `SILENCE_NS`."""
        stream, datagrams = self._connection.wait(PING_EVERY / NS / 4)
        now = self._clock()
        is_connected = self.peer.is_connected
        if stream:
            self._deliver(self.peer.receive(stream), wanted, now)
        for datagram in datagrams:
            try:
                self._deliver(self.peer.receive_datagram(datagram), wanted, now)
            except CodecError:
                continue  # datagrams may come from anywhere
        if stream or datagrams:
            self._last_data = now
        elif now - self._last_data > SILENCE_NS:
            raise TimeoutError(f"no data for {SILENCE_NS / NS:g} s")
        if self.peer.is_connected:
            if not is_connected and self._connection.here is not None:
                self._connection.send(self.peer.ask_for_datagrams(*self._connection.here))
            self._ping({key.body for key in wanted}, now)

    def _ping(self, bodies: set[str], now: Time) -> None:
        """Ping bodies without a pose for `PING_EVERY`."""
        if self._pinged is not None and now - self._pinged < PING_EVERY:
            return
        self._pinged = now
        for body in sorted(bodies):
            if now - self._last_pose.get(body, now - PING_EVERY) >= PING_EVERY:
                self._connection.send(self.peer.message(body, PING, time.time_ns()))

    def _deliver(
        self,
        reports: list[SenderMessage],
        wanted: Mapping[Key, tuple[VrpnSubscription, ...]],
        now: Time,
    ) -> None:
        for sender, stamp, what in reports:
            if not isinstance(what, PoseReport):
                continue
            key = Key(sender, what.sensor)
            here = stamp + self._offset.of(now, stamp)
            if not self._offset.is_doubted:
                if 0 <= self.last.get(key, stamp - 1) - stamp < REORDERING_NS:
                    self.still[key] = self.still.get(key, 0) + (self.last[key] == stamp)
                    continue
                self.last[key] = stamp
                self.still.pop(key, None)
            self._last_pose[sender] = now
            for subscription in wanted.get(key, ()):
                subscription.poses.append(TrackerPose(here, now, what.position, what.attitude))


_clients: dict[ServerAddress, Client] = {}
_lock = threading.Lock()


def subscribe(address: ServerAddress, body: str, sensor: int) -> VrpnSubscription:
    """Return a subscription to a sensor of a body. All subscriptions at a server share one
    connection."""
    with _lock:
        client = _clients.get(address)
        if client is None:
            client = _clients[address] = Client(address)
            client.start()
        return client.add(Key(body, sensor))
