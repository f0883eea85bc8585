"""Who hears what: vehicles by system id on one wire and on several, strangers, impostors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import pytest
from framing import PX4_HEARTBEAT
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS
from kybflow.drivers.mavlink.protocol.framing import Packer, Parser
from kybflow.drivers.mavlink.protocol.signing import Signing
from kybflow.drivers.mavlink.transport.router import Port, Router
from kybflow.drivers.mavlink.transport.wire import (
    MOST_HELD,
    MemoryWire,
    Received,
    Wire,
    memory_wires,
)

KEY = bytes(range(32))
HEARTBEAT = PX4_HEARTBEAT
STICKS = mavlink.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0)
ONE, OTHER = ("10.0.0.1", 14580), ("10.0.0.2", 14580)


class Datagrams(Wire):
    """A port to which datagrams come as a test says."""

    answers: ClassVar[bool] = True

    def __init__(self) -> None:
        super().__init__("udpin:127.0.0.1:14540")
        self.coming: list[tuple[bytes, Any]] = []
        self.sent: list[tuple[Any, bytes]] = []
        self.words: str | None = None
        self.gone: set[Any] = set()
        self.is_closed = False

    def trouble(self) -> str | None:
        return self.words

    def close(self) -> None:
        self.is_closed = True

    def is_open(self, sender: Any) -> bool:
        return sender not in self.gone

    def receive(self, now: int) -> Received:
        coming, self.coming = self.coming, []
        return coming

    def send(self, data: bytes, to: Any = None) -> None:
        self.sent.append((to, data))


def frame(system: int = 1, component: int = 1, signing: Signing | None = None) -> bytes:
    return Packer(system, signing).pack(HEARTBEAT, component)


def systems(port: Port) -> list[int]:
    return [message.get_srcSystem() for message in port.take()]


def opened(wire: Wire, *ids: int, key: bytes | None = None) -> tuple[Router, list[Port]]:
    hub = Router({wire.address: wire}, 245, None if key is None else Signing(key))
    return hub, [hub.port(wire.address, system) for system in ids]


def heard_at() -> tuple[Datagrams, Router, Port]:
    """A wire for datagrams with its router, and the port of system 1."""
    wire = Datagrams()
    hub, (port,) = opened(wire, 1)
    return wire, hub, port


def test_vehicles_on_one_wire_are_told_apart_and_answered_where_they_are() -> None:
    wire = Datagrams()
    hub, (first, second) = opened(wire, 1, 2)
    wire.coming = [(frame(2), OTHER), (frame(1), ONE), (frame(2), OTHER)]
    hub.poll(7)
    assert (systems(first), systems(second)) == ([1], [2, 2])
    assert (first.last_heard, second.last_heard) == (7, 7)
    first.send(HEARTBEAT)
    second.send(HEARTBEAT, 190)
    assert [to for to, _ in wire.sent] == [ONE, OTHER]
    read = [Parser().parse(data)[0] for _, data in wire.sent]
    assert [(m.get_srcSystem(), m.get_srcComponent()) for m in read] == [(245, 191), (245, 190)]


def test_each_vehicle_hears_a_sequence_without_gaps() -> None:
    wire = Datagrams()
    hub, ports = opened(wire, 1, 2)
    wire.coming = [(frame(1), ONE), (frame(2), OTHER)]
    hub.poll(0)
    for port in ports * 3:
        port.send(HEARTBEAT)
    heard = [Parser().parse(data)[0].get_seq() for to, data in wire.sent if to == ONE]
    assert heard == [0, 1, 2]


def test_vehicles_have_wires_of_their_own_with_the_same_id() -> None:
    (first, there), (second, elsewhere) = memory_wires("a"), memory_wires("b")
    hub = Router({"a": first, "b": second}, 245)
    one, other = hub.port("a", 1), hub.port("b", 1)
    there.send(frame(1))
    hub.poll(0)
    assert (systems(one), systems(other)) == ([1], [])
    other.send(HEARTBEAT)
    assert (len(there.receive(0)), len(elsewhere.receive(0))) == (0, 1)


def test_nothing_is_sent_to_a_port_where_nobody_was_heard() -> None:
    wire = Datagrams()
    _, (port,) = opened(wire, 1)
    port.send(HEARTBEAT)
    assert wire.sent == []


def test_only_the_autopilot_is_passed_on() -> None:
    """Not its gimbal (154), its radio (68), a ground station (255/190), nor ourselves."""
    wire, hub, port = heard_at()
    wire.coming = [
        (frame(1, 154), ONE),
        (frame(1, 68), ONE),
        (Packer(255).pack(STICKS, 190), OTHER),
        (Packer(1).pack(STICKS, 190), OTHER),
        (frame(245, 191), ONE),
        (frame(1, 1), ONE),
    ]
    hub.poll(0)
    assert [(m.get_type(), m.get_srcComponent()) for m in port.take()] == [("HEARTBEAT", 1)]
    assert port.counts.messages == 6


def test_what_nobody_wants_is_counted_by_the_autopilot_that_sent_it() -> None:
    wire = Datagrams()
    hub, (one, other) = opened(wire, 1, 2)
    one.want(["HEARTBEAT"])
    speed = mavlink.MAVLink_vfr_hud_message(0.0, 0.0, 0, 0, 0.0, 0.0)
    strange = bytearray(Packer(1).pack(speed, 1))
    strange[7:10] = (410).to_bytes(3, "little")
    wire.coming += [(Packer(1).pack(speed, 1), ONE)] * 3 + [(bytes(strange), ONE), (frame(), ONE)]
    hub.poll(0)
    assert (one.unread(), other.unread()) == ({speed.id: 3}, {})
    assert one.unread() == {}


def test_the_wrong_system_is_named() -> None:
    wire = Datagrams()
    hub, (port,) = opened(wire, 3)
    assert port.trouble() == "nothing is heard at udpin:127.0.0.1:14540"
    wire.coming = [(frame(255, 190), OTHER)]
    hub.poll(0)
    assert port.trouble() == "no autopilot is heard at udpin:127.0.0.1:14540, only other devices"
    wire.coming = [(frame(2), ONE)]
    hub.poll(0)
    assert port.trouble() == "system 2 is heard at udpin:127.0.0.1:14540, not 3"
    wire.coming = [(frame(1), OTHER)]
    hub.poll(0)
    assert port.trouble() == "systems 1, 2 are heard at udpin:127.0.0.1:14540, not 3"
    assert port.heard_from == {1, 2}
    wire.coming = [(frame(3), OTHER)]
    hub.poll(0)
    assert port.trouble() is None


def test_a_wrong_key_is_told() -> None:
    wire = Datagrams()
    hub, (port,) = opened(wire, 1, key=KEY)
    wire.coming = [(frame(), ONE), (frame(1, 1, Signing(bytes(32))), ONE)]
    hub.poll(0)
    assert (port.take(), port.counts.refused) == ([], 2)
    assert "is not signed with the key" in str(port.trouble())


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("serial:/dev/ttyUSB0:57600", "is not MAVLink: is the baud rate right?"),
        ("tcp:127.0.0.1:80", "is not MAVLink"),
    ],
)
def test_what_is_no_mavlink_is_told(address: str, words: str) -> None:
    wire, there = memory_wires(address)
    hub, (port,) = opened(wire, 1)
    there.send(b"HTTP/1.1 400 Bad Request")
    hub.poll(0)
    assert str(port.trouble()) == f"what is heard at {address} {words}"


def test_trouble_of_the_wire_comes_first() -> None:
    wire = Datagrams()
    _, (port,) = opened(wire, 1)
    wire.words = "network is unreachable"
    assert port.trouble() == "network is unreachable"


def test_a_second_vehicle_with_the_same_id_is_dropped_and_told() -> None:
    wire, hub, port = heard_at()
    wire.coming = [(frame(), ONE), (frame(), OTHER)]
    hub.poll(0)
    assert len(port.take()) == 1
    port.send(HEARTBEAT)
    assert wire.sent[0][0] == ONE
    assert port.trouble() == (
        "system 1 is heard at udpin:127.0.0.1:14540 from 10.0.0.1:14580 and from 10.0.0.2:14580:"
        " give one of them another system id"
    )
    wire.coming = [(frame(), ONE)]
    hub.poll(4 * NS)
    assert (len(port.take()), port.trouble()) == (1, None)


@pytest.mark.parametrize(
    ("later", "is_gone", "heard"), [(2, False, 0), (4, False, 1), (2, True, 1)]
)
def test_a_vehicle_may_come_back_from_elsewhere(later: int, is_gone: bool, heard: int) -> None:
    wire, hub, port = heard_at()
    wire.coming = [(frame(), ONE)]
    hub.poll(0)
    port.take()
    wire.coming = [(frame(), OTHER)]
    wire.gone = {ONE} if is_gone else set()
    hub.poll(later * NS)
    assert len(port.take()) == heard
    port.send(HEARTBEAT)
    assert wire.sent[-1][0] == (OTHER if heard else ONE)


def test_noise_of_one_sender_does_not_touch_another() -> None:
    wire, hub, port = heard_at()
    half = len(frame()) // 2
    wire.coming = [(frame()[:half], ONE), (b"\xfd\xff\0", OTHER), (frame()[half:], ONE)]
    hub.poll(0)
    assert len(port.take()) == 1


def test_many_strangers_take_no_more_than_their_room() -> None:
    wire, hub, port = heard_at()
    for stranger in range(3000):
        wire.coming.append((b"\xfd\xff\0", ("10.0.0.9", stranger)))
    wire.coming.append((frame(), ONE))
    hub.poll(0)
    assert len(port.take()) == 1


def test_what_nobody_takes_is_bounded() -> None:
    wire, there = memory_wires()
    hub, (port,) = opened(wire, 1)
    for _ in range(3):
        for _ in range(MOST_HELD // 2):
            there.send(frame())
        hub.poll(0)
    assert len(port.take()) == MOST_HELD


def test_two_wires_are_signed_as_two_links() -> None:
    ends = [memory_wires(name) for name in "ab"]
    hub = Router({wire.address: wire for wire, _ in ends}, 245, Signing(KEY))
    for wire, _ in ends:
        hub.port(wire.address, 1).send(HEARTBEAT)
    sent: Sequence[bytes] = [there.receive(0)[0][0] for _, there in ends]
    assert [data[-13] for data in sent] == [0, 1]
    parser = Parser(Signing(KEY))
    assert [len(parser.parse(data)) for data in sent] == [1, 1]


def test_signed_both_ways() -> None:
    wire, there = memory_wires()
    hub, (port,) = opened(wire, 1, key=KEY)
    there.send(frame(1, 1, Signing(KEY)))
    hub.poll(0)
    assert systems(port) == [1]


@pytest.mark.parametrize(
    ("system", "words"),
    [(245, "system 245 is this program itself"), (1, "two vehicles are system 1 at `memory`")],
)
def test_an_id_that_can_not_be_is_refused(system: int, words: str) -> None:
    hub, _ = opened(memory_wires()[0], 1)
    with pytest.raises(DriverError, match=words):
        hub.port("memory", system)


def test_a_cut_wire_is_silent_both_ways() -> None:
    wire, there = memory_wires()
    hub, (port,) = opened(wire, 1)
    wire.deaf = wire.mute = True
    there.send(frame())
    port.send(HEARTBEAT)
    hub.poll(0)
    assert (port.take(), list(there.receive(0))) == ([], [])


def test_closing_closes_every_wire() -> None:
    wire = Datagrams()
    hub, _ = opened(wire, 1)
    hub.close()
    assert wire.is_closed


def test_a_memory_wire_has_one_other_end() -> None:
    wire, there = memory_wires()
    assert isinstance(wire, MemoryWire)
    assert (wire.other, there.other) == (there, wire)
