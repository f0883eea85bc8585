"""A VRPN server: publishes poses to clients that connect by TCP or request a call-back.

One thread accepts clients and answers pings. `publish` sends from the caller's thread and never
blocks. A client that doesn't keep up is dropped, and can't delay the others.

The simulated motion capture of vehicles and moving obstacles can be published on it (`published`).
The published poses are those that the mission receives, including noise, latency and faults.
"""

from __future__ import annotations

import contextlib
import dataclasses
import random
import selectors
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from errno import EADDRINUSE
from functools import partial
from typing import Any, NamedTuple

from kybflow.core.errors import DriverError, KybflowError
from kybflow.core.geometry import LEVEL, Quat, Vec3, add, integrate
from kybflow.core.signals import Measurement, Pose, Time, Truth
from kybflow.dsl.plan import Plan
from kybflow.parts import Driver, Link, Seat, Session
from kybflow.parts.true_objects import TrueObjects
from kybflow.sensors._stream import CHUNK, Waker
from kybflow.sensors.simulated_motion_capture import (
    BodyStream,
    SimulatedMotionCaptureParams,
    SimulatedPoses,
    truth_of,
)
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
"""A client is dropped if more bytes than this wait for it in the server's buffer; the system's
buffer holds as many. Older poses are useless."""
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
        words = f"no VRPN server can be at {host}:{port}: {reason}"
        if getattr(error, "errno", None) == EADDRINUSE:
            words += "; is another VRPN server there? End it, or take another `--port`"
        raise DriverError(words) from None
    return listener, requests


Publish = Callable[[str, Pose], None]
"""A function that publishes the pose of a named body, stamped in the run's time."""


def to(server: Server, clock: Callable[[], Time] = time.time_ns) -> Publish:
    """Return a function that publishes on `server`. Time stamps are shifted such that the first
    pose has the current time."""
    began: list[Time] = []

    def publish(name: str, pose: Pose) -> None:
        if not began:
            began.append(clock() - pose.time)
        server.publish(name, pose.position, pose.attitude, began[0] + pose.time)

    return publish


def published(plan: Plan, publish: Publish) -> Plan:
    """Return the plan with drivers that also publish the poses of vehicles and moving obstacles as
    they arrive. Raises KybflowError if a vehicle is not simulated."""
    for vehicle in plan.vehicles:
        if not vehicle.driver.cls.simulated:
            raise KybflowError(f"`{vehicle.name}` flies on `{vehicle.driver.name}`, which is real")
    bodies = _Bodies(plan, publish)
    drivers: dict[Any, Any] = {
        v.driver.cls: _Published(v.driver.cls, publish, bodies) for v in plan.vehicles
    }
    vehicles = (
        dataclasses.replace(
            vehicle, driver=dataclasses.replace(vehicle.driver, cls=drivers[vehicle.driver.cls])
        )
        for vehicle in plan.vehicles
    )
    return dataclasses.replace(plan, vehicles=tuple(vehicles))


class PoseNoise(NamedTuple):
    """Standard deviations of a pose's position along each axis (metres) and of its attitude about
    each axis (radians)."""

    position: float
    attitude: float


def still(
    places: Mapping[str, Vec3], publish: Publish, noise: PoseNoise, generator: random.Random
) -> Callable[[Time], None]:
    """Return a function that publishes the poses of bodies at rest at a given time. Without noise,
    clients would regard the bodies as frozen."""

    def drawn(deviation: float) -> Vec3:
        gauss = generator.gauss
        return gauss(0.0, deviation), gauss(0.0, deviation), gauss(0.0, deviation)

    def step(now: Time) -> None:
        for name, place in places.items():
            attitude = integrate(LEVEL, drawn(noise.attitude), 1.0)
            publish(name, Pose(now, add(place, drawn(noise.position)), attitude))

    return step


class _Published:
    """Wraps a driver and publishes the poses read from its links."""

    def __init__(self, driver: type[Driver[Any]], publish: Publish, bodies: _Bodies) -> None:
        self._driver, self._publish, self._bodies = driver, publish, bodies

    def __getattr__(self, name: str) -> object:
        return getattr(self._driver, name)

    def open(self, seats: Sequence[Seat], generator: random.Random) -> Session:
        session = self._driver.open(seats, generator)
        if session.scene is not None:
            self._bodies.add_objects(session)
        for name, link in session.links.items():
            self._tap(name, link)
        return session

    def _tap(self, name: str, link: Link) -> None:
        """Make `link` publish the vehicle's poses and those of other bodies when it is read."""
        read = link.read

        def tapped(now: Time) -> Sequence[Measurement]:
            self._bodies.step(now)
            measurements = read(now)
            for measurement in measurements:
                if type(measurement) is Pose:
                    self._publish(name, measurement)
            return measurements

        link.read = tapped  # type: ignore[method-assign]


class _Bodies:
    """The moving obstacles and objects, measured by simulated motion capture."""

    def __init__(self, plan: Plan, publish: Publish) -> None:
        self._objects, self._publish = plan.objects, publish
        self._streams: dict[str, BodyStream] = {}
        for name, ball in plan.moving.items():
            self._add(name, ball.body, truth_of(ball))

    def add_objects(self, session: Session) -> None:
        """Publish the objects of a simulator."""
        truths = TrueObjects(self._objects, [session])
        for name, one in self._objects.items():
            if one.moves:
                self._add(name, one.body, truths.truth_of(name))

    def _add(self, name: str, body: str | None, truth: Callable[[Time], Truth]) -> None:
        generator = random.Random(f"published {name}")
        poses = partial(SimulatedPoses, SimulatedMotionCaptureParams(), generator=generator)
        self._streams[body or name] = BodyStream(truth, poses)

    def step(self, now: Time) -> None:
        """Publish the poses of each body that have arrived since the last call."""
        for body, stream in self._streams.items():
            for pose in stream.read(now):
                if type(pose) is Pose:
                    self._publish(body, pose)
