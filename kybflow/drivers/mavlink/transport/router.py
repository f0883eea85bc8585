"""The router of a session's wires: it gives each autopilot a port for receiving and sending.

A port passes on the messages of one system id, and only those of the autopilot itself (component
1), not of its gimbal or radio. If datagrams come from several addresses, each autopilot is answered
at its own. A second vehicle with the same system id is ignored and reported while the first is
present. A sender that signs with an old time is ignored: it may have rebooted, or somebody may be
replaying an old frame. It is sent one heartbeat, from which a rebooted autopilot takes over our
time.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable, Mapping
from typing import Any

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS, Time
from kybflow.drivers.mavlink.protocol.framing import (
    NUMBERS,
    ONBOARD,
    Counts,
    Message,
    Packer,
    Parser,
    mavlink,
)
from kybflow.drivers.mavlink.protocol.signing import Signing
from kybflow.drivers.mavlink.transport.wire import MOST_HELD, Wire, to_ask

AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
"""The component id of the autopilot itself."""
ADDRESS_TIMEOUT_NS: Time = 3 * NS
"""After a silence this long a vehicle may send from another address."""
REPLY_PERIOD_NS: Time = NS
"""The pause between two heartbeats in reply to old signatures from one address."""
MOST_SENDERS = 256
LISTENERS = frozenset({mavlink.MAV_TYPE_GCS, mavlink.MAV_TYPE_ONBOARD_CONTROLLER})
"""The MAV_TYPEs of ground stations and other companion computers."""


def heartbeat(kind: int) -> Message:
    """Return our heartbeat. kind: the MAV_TYPE as which we send it."""
    invalid, active = mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_STATE_ACTIVE
    return mavlink.MAVLink_heartbeat_message(kind, invalid, 0, 0, active, 3)


HEARTBEAT = heartbeat(mavlink.MAV_TYPE_GCS)
"""A ground station's heartbeat."""


class Port:
    """The messages of one autopilot.

    last_heard: when its last message arrived, None before the first.
    counts: the frame counts of its wire, over all senders.
    deaf, mute: set by injected faults; received messages, or sent ones, are lost."""

    def __init__(self, line: _Line, system: int, packer: Packer) -> None:
        self.system = system
        self.last_heard: Time | None = None
        self.deaf = self.mute = False
        self._line, self._packer = line, packer
        self._place: Any = None
        self._clash: tuple[Time, Any] | None = None
        self._messages: deque[Message] = deque(maxlen=MOST_HELD)
        self.overheard: deque[Message] = deque(maxlen=MOST_HELD)

    @property
    def counts(self) -> Counts:
        return self._line.counts

    @property
    def to_ask(self) -> str:
        """What to check if no autopilot is heard, as a question."""
        return to_ask(self._line.wire.address)

    @property
    def heard_from(self) -> frozenset[int]:
        """The systems whose autopilots send on this wire."""
        return frozenset(self._line.autopilots)

    def want(self, names: Iterable[str]) -> None:
        """Parse these messages as well from now on, for every port of this wire."""
        self._line.wanted.update(NUMBERS[name] for name in names if name in NUMBERS)

    def unread(self) -> dict[int, int]:
        """Return how many unwanted messages the autopilot has sent since the last call, by message
        id; none on a shared wire, where another program may want them."""
        found = {
            n: count for (system, n), count in self._line.unread.items() if system == self.system
        }
        for number in found:
            del self._line.unread[self.system, number]
        return {} if self._line.is_shared else found

    def take(self) -> list[Message]:
        """Return the messages since the last call, oldest first."""
        if not self._messages:
            return []
        messages = list(self._messages)
        self._messages.clear()
        return messages

    def take_overheard(self) -> list[Message]:
        """Return the messages since the last call from other systems on the wire: neither from us,
        nor from an autopilot, nor from a system that has a port."""
        if not self.overheard:
            return []
        messages = list(self.overheard)
        self.overheard.clear()
        return messages

    def send(self, message: Message, component: int = ONBOARD) -> None:
        """Send a message from one of our components. On a wire that can only answer, nothing is
        sent before the first message has arrived. Raises DriverError if a value doesn't fit its
        field."""
        if self.mute:
            return
        data = self._packer.pack(message, component)
        wire = self._line.wire
        if self._place is not None or not wire.answers:
            wire.send(data, self._place)

    def trouble(self) -> str | None:
        """Return what is wrong with the connection, or None if nothing is known to be. Silence
        counts only before the first message."""
        if trouble := self._line.wire.trouble():
            return trouble
        if self._clash is not None and self._line.now - self._clash[0] < ADDRESS_TIMEOUT_NS:
            return (
                f"system {self.system} is heard at {self._line.wire.address} from"
                f" {_words(self._place)} and from {_words(self._clash[1])}: give one of them "
                "another system id"
            )
        return self._line.silence(self.system) if self.last_heard is None else None

    def handle(self, message: Message, place: Any, now: Time) -> None:
        """Accept a message; called by the router. A message from a second address is ignored while
        the first is in use."""
        if self.deaf:
            return
        if (
            place != self._place and self._place is not None and self.last_heard is not None
            and now - self.last_heard < ADDRESS_TIMEOUT_NS and self._line.wire.is_open(self._place)
        ):  # fmt: skip
            self._clash = now, place
            return
        self._place, self.last_heard = place, now
        self._messages.append(message)

    def answer(self, place: Any) -> None:
        """Send one heartbeat to the address `place`, unless it is the autopilot's, which gets our
        heartbeats anyway. The router calls this when frames from that address carry an outdated
        signing time."""
        if place != self._place:
            self._line.wire.send(self._packer.pack(HEARTBEAT), place)


class Router:
    """Routes messages between wires and ports.

    wires: by address.
    system: our own system id.
    signing: signs and checks messages; None if they are not signed."""

    def __init__(
        self, wires: Mapping[str, Wire], system: int, signing: Signing | None = None
    ) -> None:
        self._system, self._signing = system, signing
        self._lines = {
            address: _Line(wire, link, signing)
            for link, (address, wire) in enumerate(wires.items())
        }

    def port(self, address: str, system: int) -> Port:
        """Create the port of a system on a wire. Raises DriverError if that system has a port
        already, or is our own."""
        line = self._lines[address]
        if system == self._system:
            raise DriverError(
                f"system {system} is this program itself: choose another `own_system`"
            )
        if system in line.ports:
            raise DriverError(
                f"two vehicles are system {system} at `{address}`: give each its own `system`"
            )
        port = Port(line, system, Packer(self._system, self._signing, line.link))
        line.ports[system] = port
        return port

    def poll(self, now: Time) -> None:
        """Read every wire. Never blocks, never raises."""
        for line in self._lines.values():
            line.poll(now)

    def close(self) -> None:
        for line in self._lines.values():
            line.wire.close()


class _Line:
    """A wire with its ports. `is_shared`: whether another program uses it too."""

    def __init__(self, wire: Wire, link: int, signing: Signing | None) -> None:
        self.wire, self.link = wire, link % 256
        self.ports: dict[int, Port] = {}
        self.counts = Counts()
        self.autopilots: set[int] = set()
        self.wanted: set[int] = set()
        self.unread: Counter[tuple[int, int]] = Counter()
        self.is_shared = False
        self.now: Time = 0
        self._signing = signing
        self._parsers: dict[Any, Parser] = {}
        self._answered: tuple[Any, Time] = (None, 0)

    def poll(self, now: Time) -> None:
        self.now, parsers = now, self._parsers
        for data, place in self.wire.receive(now):
            parser = parsers.get(place) or self._new_parser(place)
            messages = parser.parse(data)
            if parser.stale:
                self._answer(parser.stale, place, now)
            for message in messages:
                system = message.get_srcSystem()
                if message.get_srcComponent() != AUTOPILOT:
                    if message.get_type() == "HEARTBEAT" and message.type in LISTENERS:
                        self.is_shared = True
                    if system not in self.ports:
                        for other in self.ports.values():
                            other.overheard.append(message)
                    continue
                self.autopilots.add(system)
                if (port := self.ports.get(system)) is not None:
                    port.handle(message, place, now)

    def _answer(self, stale: set[tuple[int, int]], place: Any, now: Time) -> None:
        """Send a heartbeat with our time to an autopilot at `place`. stale: the senders of old
        signatures, by system and component id, including those without a port, because discovery
        doesn't know the ids yet."""
        systems = sorted(system for system, component in stale if component == AUTOPILOT)
        stale.clear()
        if not systems or not self.ports or not self.wire.answers:
            return  # on other wires every receiver gets our heartbeats anyway
        last, at = self._answered
        if place != last or now - at >= REPLY_PERIOD_NS:
            self._answered = place, now
            self.ports.get(systems[0], next(iter(self.ports.values()))).answer(place)

    def silence(self, system: int) -> str:
        """Return why no message of that system may have arrived."""
        place, counts = self.wire.address, self.counts
        if counts.stale and not counts.messages:
            return f"what is heard at {place} is signed with an old time, again and again"
        if others := sorted(self.autopilots - {system}):
            names = ", ".join(str(other) for other in others)
            verb = f"system {names} is" if len(others) == 1 else f"systems {names} are"
            return f"{verb} heard at {place}, not {system}"
        if counts.refused:
            return f"what is heard at {place} is not signed with the key of this vehicle"
        if counts.messages:
            return f"no autopilot is heard at {place}, only other devices"
        if counts.bad:
            question = ": is the baud rate right?" if place.startswith("serial:") else ""
            return f"what is heard at {place} is not MAVLink{question}"
        return f"nothing is heard at {place}"

    def _new_parser(self, place: Any) -> Parser:
        if len(self._parsers) >= MOST_SENDERS:
            self._parsers.pop(next(iter(self._parsers)))
        parser = Parser(self._signing, self.counts, self.wanted, self.unread)
        self._parsers[place] = parser
        return parser


def _words(place: Any) -> str:
    host, port = place
    return f"{host}:{port}"
