"""One wire of an emulated autopilot, with its ground stations and the rates of its messages."""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

from kybflow.core.signals import NEVER, NS, Time
from kybflow.drivers.emulation.breaking import BreakableLink, Failures
from kybflow.drivers.mavlink.protocol.framing import LAYOUTS, Counts, Packer, Parser, mavlink
from kybflow.drivers.mavlink.protocol.signing import Signing
from kybflow.drivers.mavlink.transport.sockets import UdpIn
from kybflow.drivers.mavlink.transport.wire import Wire

AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
STATION_TIMEOUT_NS: Time = 5 * NS
"""How long a ground station counts as present after its last heartbeat."""
MAX_STREAM_HZ = 250.0


class Channel:
    """One wire of an emulated autopilot. `station`: when the last heartbeat of a ground station
    arrived. streams: the messages sent by default, Hz by name."""

    def __init__(
        self,
        wire: Wire,
        system: int,
        key: bytes | None,
        streams: Mapping[str, float],
        failures: Failures,
        generator: random.Random,
    ) -> None:
        self.wire = wire
        self.station: Time | None = None
        self.counts = Counts()
        signing = None if key is None else Signing(key)
        self._signing = signing
        self._packer = Packer(system, signing)
        self._parsers: dict[Any, Parser] = {}
        self._link = BreakableLink(failures, generator)
        self._streams: dict[str, tuple[Time, Time]] = {}
        self._default, self._soonest = dict(streams), 0
        for name, rate in streams.items():
            self.stream(name, rate)

    def receive(self, now: Time) -> list[Any]:
        """Return the messages since the last call."""
        messages: list[Any] = []
        for data, sender in self.wire.receive(now):
            parser = self._parsers.get(sender)
            if parser is None:
                parser = self._parsers[sender] = Parser(self._signing, self.counts)
            messages += parser.parse(data)
        return self._link.received(messages)

    def send(self, message: Any) -> None:
        """Send a message to all clients on this wire."""
        if self._link.sends():
            self._put(self._packer.pack(message, AUTOPILOT))

    def forward(self, message: Any) -> None:
        """Send another system's message to all clients on this wire, unsigned."""
        if self._signing is None and self._link.sends():
            sender = message.get_srcSystem(), message.get_srcComponent()
            layout = LAYOUTS[message.get_msgId()]
            self._put(layout.frame(message, message.get_seq(), sender, 0))

    def _put(self, data: bytes) -> None:
        if isinstance(self.wire, UdpIn):
            for sender in self._parsers:
                self.wire.send(data, sender)
        else:
            self.wire.send(data)

    def has_station(self, now: Time) -> bool:
        return self.station is not None and now - self.station < STATION_TIMEOUT_NS

    def stream(self, name: str, rate: float) -> None:
        """Send a message at `rate` Hz from now on; zero stops it."""
        self._soonest = 0
        if rate <= 0.0:
            self._streams.pop(name, None)
        else:
            period = round(NS / min(rate, MAX_STREAM_HZ))
            self._streams[name] = (period, self._streams.get(name, (0, 0))[1])

    def default(self, name: str) -> float:
        """Return the default rate of a message, Hz."""
        return self._default.get(name, 0.0)

    def interval(self, name: str) -> float:
        """Return the interval at which a message is sent, seconds; 0 if it is not sent."""
        return self._streams.get(name, (0, 0))[0] / NS

    def due(self, now: Time) -> list[str]:
        """Return the names of the messages to send now."""
        if now < self._soonest:
            return []
        due = []
        for name, (period, at) in self._streams.items():
            if at <= now:
                due.append(name)
                behind = now - at >= period
                self._streams[name] = (period, now + period if behind else at + period)
        self._soonest = min((at for _, at in self._streams.values()), default=NEVER)
        return due


def name_of(number: int) -> str:
    """Return the name of a message id; empty if it is unknown."""
    made = mavlink.mavlink_map.get(number)
    return "" if made is None else str(made.msgname)
