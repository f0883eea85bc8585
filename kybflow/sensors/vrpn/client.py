"""What VRPN servers say of bodies: one thread a server, shared by all who ask for its bodies.

The thread opens the link, again and again with growing pauses where it must, asks silent bodies by
a ping, puts the server's stamps on our clock and hands poses over as immutable values. Nobody waits
for it and nothing here raises in the reader's face: a lost server is silence, and a reason.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple

from kybflow.core.clock_offset import Offset
from kybflow.core.errors import DriverError
from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import NS, Time
from kybflow.sensors._waker import Waker
from kybflow.sensors.vrpn.codec import PING, CodecError, PoseReport
from kybflow.sensors.vrpn.link import Connection, ServerAddress
from kybflow.sensors.vrpn.peer import Peer, SenderMessage

FIRST_PAUSE, LONGEST_PAUSE = 0.1, 2.0
"""Seconds from the beginning of one attempt to open a link to the next; doubled each time."""
PING_EVERY: Time = NS
SILENT: Time = 5 * NS
"""Without a byte for so long, pings and all, the link counts as lost."""
REORDERED: Time = NS // 5
"""A stamp that is older than the last by less was overtaken; by more, the clock was set."""
WAITING = 2000
"""Poses that are kept for a reader who does not come."""


class Report(NamedTuple):
    """A pose in the tracker's own axes and units. time: the server's stamp on our monotonic clock.
    arrival: when it came, on the same."""

    time: Time
    arrival: Time
    position: Vec3
    attitude: Quat


class Key(NamedTuple):
    body: str
    sensor: int


class VrpnSubscription:
    """One body's sensor at a server. Close it."""

    def __init__(self, client: Client, key: Key) -> None:
        self.key = key
        self.came: deque[Report] = deque(maxlen=WAITING)
        self._client = client

    def take(self) -> list[Report]:
        """The poses that came since the last call, oldest first."""
        came = self.came
        return [came.popleft() for _ in range(len(came))]

    def trouble(self) -> str | None:
        """Why no pose can come, None where they can."""
        return self._client.trouble(self.key)

    def close(self) -> None:
        with _lock:
            if self._client.drop(self):
                _clients.pop(self._client.address, None)
        self._client.rest()


class Client:
    """The link to one server, and its thread."""

    def __init__(
        self, address: ServerAddress, clock: Callable[[], Time] = time.monotonic_ns
    ) -> None:
        self.address = address
        self._clock = clock
        self._wanted: Mapping[Key, tuple[VrpnSubscription, ...]] = {}
        self._reason: str | None = "not connected yet"
        self._sensors: frozenset[Key] = frozenset()
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
        """Forget a subscription; whether it was the last."""
        left = {k: tuple(s for s in v if s is not subscription) for k, v in self._wanted.items()}
        self._wanted = {key: rest for key, rest in left.items() if rest}
        return not self._wanted

    def rest(self) -> None:
        """End the thread where nobody wants anything any more."""
        if self._wanted or self._waker.ended.is_set():
            return
        self._waker.end()
        self._thread.join(1.0)

    def trouble(self, key: Key) -> str | None:
        """Why nothing of `key` comes, None where it does."""
        reason, sensors = self._reason, self._sensors
        if reason is not None:
            return f"no VRPN server at {self.address}: {reason}"
        if key in sensors:
            return None
        others = sorted(other.sensor for other in sensors if other.body == key.body)
        if others:
            which = ", ".join(map(str, others))
            return f"`{key.body}` has no sensor {key.sensor}, but {which}"
        bodies = sorted({other.body for other in sensors})
        return f"{self.address} sends no `{key.body}`, but {_listed(bodies)}"

    def _run(self) -> None:
        pause = FIRST_PAUSE
        while not self._waker.ended.is_set():
            began = self._clock()
            try:
                self._talk()
            except (OSError, UnicodeError, DriverError) as error:
                connected = self._reason is None
                self._reason = getattr(error, "strerror", None) or str(error)
                self._sensors = frozenset()
                pause = FIRST_PAUSE if connected else min(2.0 * pause, LONGEST_PAUSE)
            self._waker.ended.wait(max(0.0, pause - (self._clock() - began) / NS))
        self._waker.close()

    def _talk(self) -> None:
        """Open the link and listen until nobody does. Raises OSError or CodecError when it is
        lost."""
        connection = Connection(self.address, self._waker)
        try:
            listener = _Listener(connection, self._clock)
            while not self._waker.ended.is_set():
                listener.hear(self._wanted)
                if listener.peer.greeted:
                    self._sensors = frozenset(listener.last)
                    self._reason = None
        finally:
            connection.close()


class _Listener:
    """One open link: what comes goes to those who want it. `last`: the newest stamp of each."""

    def __init__(self, connection: Connection, clock: Callable[[], Time]) -> None:
        self.peer = Peer()
        self.last: dict[Key, Time] = {}
        self._connection, self._clock = connection, clock
        self._offset = Offset()
        self._heard = clock()
        self._pinged: Time | None = None
        self._posed: dict[str, Time] = {}

    def hear(self, wanted: Mapping[Key, tuple[VrpnSubscription, ...]]) -> None:
        """Wait for what comes next, at most until the next ping is due."""
        stream, datagrams = self._connection.wait(PING_EVERY / NS / 4)
        now = self._clock()
        greeted = self.peer.greeted
        if stream:
            self._tell(self.peer.hear(stream), wanted, now)
        for datagram in datagrams:
            try:
                self._tell(self.peer.hear_datagram(datagram), wanted, now)
            except CodecError:
                continue  # anybody can send a datagram
        if stream or datagrams:
            self._heard = now
        elif now - self._heard > SILENT:
            raise TimeoutError(f"nothing heard for {SILENT / NS:g} s")
        if self.peer.greeted:
            if not greeted and self._connection.here is not None:
                self._connection.send(self.peer.ask_for_datagrams(*self._connection.here))
            self._ping({key.body for key in wanted}, now)

    def _ping(self, bodies: set[str], now: Time) -> None:
        """Ask those that have been silent whether they are there."""
        if self._pinged is not None and now - self._pinged < PING_EVERY:
            return
        self._pinged = now
        for body in sorted(bodies):
            if now - self._posed.get(body, now - PING_EVERY) >= PING_EVERY:
                self._connection.send(self.peer.say(body, PING, time.time_ns()))

    def _tell(
        self,
        heard: list[SenderMessage],
        wanted: Mapping[Key, tuple[VrpnSubscription, ...]],
        now: Time,
    ) -> None:
        for sender, stamp, what in heard:
            if not isinstance(what, PoseReport):
                continue
            key = Key(sender, what.sensor)
            here = stamp + self._offset.of(now, stamp)
            if not self._offset.is_doubted:
                if 0 <= self.last.get(key, stamp - 1) - stamp < REORDERED:
                    continue
                self.last[key] = stamp
            self._posed[sender] = now
            for subscription in wanted.get(key, ()):
                subscription.came.append(Report(here, now, what.position, what.attitude))


_clients: dict[ServerAddress, Client] = {}
_lock = threading.Lock()


def subscribe(address: ServerAddress, body: str, sensor: int) -> VrpnSubscription:
    """Ask the server for a body's sensor, over the one link that this program has to it."""
    with _lock:
        client = _clients.get(address)
        if client is None:
            client = _clients[address] = Client(address)
            client.start()
        return client.add(Key(body, sensor))


def _listed(bodies: list[str]) -> str:
    """`a`, `b` and 3 more."""
    names = ", ".join(f"`{name}`" for name in bodies[:8]) or "nothing else either"
    return f"{names} and {len(bodies) - 8} more" if len(bodies) > 8 else names
