"""Addresses of autopilots. Wires on loopback, on a pseudo terminal and in memory: open late, lost,
opened again, flooded."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import pytest
from waiting import HANGS, free_port, until

from kybflow.core.errors import DriverError
from kybflow.core.signals import NS
from kybflow.drivers.mavlink.transport.sockets import (
    MOST_AT_ONCE,
    Pipe,
    TcpServer,
    UdpIn,
    open_wire,
)
from kybflow.drivers.mavlink.transport.wire import Address, Wire, memory_wires, read_address

HOST = "127.0.0.1"


def received(wire: Wire, now: int = 0, least: int = 1) -> bytes:
    """What comes until there are so many bytes."""
    came = b""

    def enough() -> bool:
        nonlocal came
        came += b"".join(data for data, _ in wire.receive(now))
        return len(came) >= least

    until(enough, f"{least} bytes on {wire.address}")
    return came


@contextmanager
def datagrams() -> Iterator[socket.socket]:
    with socket.socket(type=socket.SOCK_DGRAM) as opened:
        opened.bind((HOST, 0))
        opened.settimeout(HANGS)
        yield opened


def udpin() -> UdpIn:
    wire = open_wire(Address("udpin", HOST, 0))
    assert isinstance(wire, UdpIn)
    return wire


def tcpin(port: int = 0) -> TcpServer:
    wire = open_wire(Address("tcpin", HOST, port))
    assert isinstance(wire, TcpServer)
    return wire


def test_datagrams_are_answered_where_they_came_from() -> None:
    with closing(udpin()) as wire, datagrams() as one, datagrams() as other:
        wire.send(b"to nobody yet")
        for number, vehicle in enumerate((one, other)):
            vehicle.sendto(b"here %d" % number, (HOST, wire.port))
            until(lambda: wire.receive(0), "a datagram")
        wire.send(b"for one", one.getsockname())
        wire.send(b"for the newest")
        assert (one.recv(99), other.recv(99)) == (b"for one", b"for the newest")
        assert wire.trouble() is None


def test_several_senders_are_told_apart() -> None:
    with closing(udpin()) as wire, datagrams() as one, datagrams() as other:
        one.sendto(b"1", (HOST, wire.port))
        other.sendto(b"2", (HOST, wire.port))
        came: list[tuple[bytes, Any]] = []
        until(lambda: came.extend(wire.receive(0)) or len(came) == 2, "both")
        assert dict(came) == {b"1": one.getsockname(), b"2": other.getsockname()}


def test_a_flood_does_not_hold_up_a_poll() -> None:
    with closing(udpin()) as wire, datagrams() as vehicle:
        for size, most in ((1, MOST_AT_ONCE), (60_000, 2)):
            for _ in range(MOST_AT_ONCE + 500 if size == 1 else 10):
                vehicle.sendto(b"x" * size, (HOST, wire.port))
            assert len(wire.receive(0)) <= most
            while wire.receive(0):
                pass


def test_udpout_sends_first_and_hears_only_its_place() -> None:
    with datagrams() as vehicle, datagrams() as stranger:
        wire = open_wire(f"udpout:{HOST}:{vehicle.getsockname()[1]}")
        wire.send(b"hello")
        data, ours = vehicle.recvfrom(99)
        stranger.sendto(b"no", ours)
        vehicle.sendto(b"welcome", ours)
        assert (data, received(wire, least=2)) == (b"hello", b"welcome")
        wire.close()


def test_udpout_tells_that_nobody_listens_until_somebody_does() -> None:
    with datagrams() as vehicle:
        port = vehicle.getsockname()[1]
    with closing(open_wire(f"udpout:{HOST}:{port}")) as wire:
        assert wire.trouble() is None

        def refused() -> bool:
            wire.send(b"hello")
            wire.receive(0)
            return wire.trouble() is not None

        until(refused, "a refusal")
        assert wire.trouble() == f"udpout:{HOST}:{port}: connection refused"
        with socket.socket(type=socket.SOCK_DGRAM) as vehicle:
            vehicle.bind((HOST, port))
            vehicle.settimeout(HANGS)
            wire.send(b"hello")
            vehicle.sendto(b"welcome", vehicle.recvfrom(99)[1])
            assert received(wire) == b"welcome"
            assert wire.trouble() is None


@pytest.mark.parametrize("kind", ["udpin", "tcpin"])
def test_a_port_that_is_taken_says_by_whom(kind: str) -> None:
    taken = udpin() if kind == "udpin" else tcpin()
    with pytest.raises(DriverError, match=r"can't listen .*: address already in use; is a gro"):
        open_wire(f"{kind}:{HOST}:{taken.port}")
    taken.close()


def test_a_host_that_nobody_knows_is_told() -> None:
    with pytest.raises(DriverError, match=r"no host `nowhere.invalid`"):
        open_wire("tcp:nowhere.invalid:5760")


def test_tcp_goes_both_ways_between_several() -> None:
    with closing(tcpin()) as server:
        address = f"tcp:{HOST}:{server.port}"
        with closing(open_wire(address)) as one, closing(open_wire(address)) as other:
            assert one.trouble() == f"{address}: not open yet"
            one.send(b"lost before it is open")
            places: dict[bytes, Any] = {}

            def joined() -> bool:
                for wire, name in ((one, b"1"), (other, b"2")):
                    wire.receive(0)
                    if name not in places:
                        wire.send(name)
                places.update({data[:1]: place for data, place in server.receive(0)})
                return len(places) == 2

            until(joined, "both clients")
            server.send(b"all")
            server.send(b", one", places[b"1"])
            assert (received(one, least=8), received(other, least=3)) == (b"all, one", b"all")
            assert (one.trouble(), other.trouble(), server.trouble()) == (None, None, None)
            assert server.is_open(places[b"1"])


def test_tcp_is_opened_again_later_each_time() -> None:
    port = free_port()
    with closing(open_wire(f"tcp:{HOST}:{port}")) as wire:
        until(lambda: wire.receive(0) or "refused" in str(wire.trouble()), "a refusal")
        assert wire.trouble() == f"tcp:{HOST}:{port}: connection refused"
        with closing(tcpin(port)) as server:
            wire.receive(NS // 5)
            wire.send(b"early")
            assert not server.receive(0), "a quarter of a second has not passed"

            def heard() -> bool:
                wire.receive(NS // 4)
                wire.send(b"again")
                return bool(server.receive(0))

            until(heard, "the second attempt")
            assert wire.trouble() is None


def test_tcp_that_is_closed_at_the_other_end_is_told_and_opened_again() -> None:
    port, now = free_port(), 0
    with closing(open_wire(f"tcp:{HOST}:{port}")) as wire:
        for _ in range(2):
            with closing(tcpin(port)) as server:

                def heard(server: TcpServer = server) -> bool:
                    nonlocal now
                    now += NS // 100
                    wire.receive(now)
                    wire.send(b"hello")
                    return bool(server.receive(0))

                until(heard, "the client")
            until(lambda: wire.receive(now) or wire.trouble(), "the loss")
            assert any(words in str(wire.trouble()) for words in ("closed it", "reset", "pipe"))
            wire.send(b"lost")


def test_a_client_that_goes_is_forgotten() -> None:
    with closing(tcpin()) as server:
        with socket.create_connection((HOST, server.port)) as client:
            client.sendall(b"x")
            came: list[tuple[bytes, Any]] = []
            until(lambda: came.extend(server.receive(0)) or came, "the client")
        place = came[0][1]
        until(lambda: server.receive(0) or not server.is_open(place), "its end")
        server.send(b"to nobody", place)
        server.send(b"to nobody")


def test_a_frame_is_sent_whole_or_not_at_all() -> None:
    room, sent = [3], bytearray()

    def write(data: bytes) -> int:
        taken = data[: room[0]]
        room[0] -= len(taken)
        sent.extend(taken)
        return len(taken)

    pipe = Pipe(lambda most: b"", write)
    pipe.write(b"first")
    pipe.write(b"second, which is lost")
    room[0] = 100
    pipe.write(b"third")
    assert bytes(sent) == b"firstthird"
    room[0] = 0
    pipe.write(b"fourth, for which there is no room at all")
    room[0] = 100
    pipe.read()
    assert bytes(sent) == b"firstthird"


def test_a_reader_that_does_not_read_costs_nothing_but_frames() -> None:
    with socket.socket() as listener:
        listener.bind((HOST, 0))
        listener.listen()
        with closing(open_wire(f"tcp:{HOST}:{listener.getsockname()[1]}")) as wire:
            until(lambda: wire.receive(0) or wire.trouble() is None, "the link")
            for _ in range(200):
                wire.send(b"x" * 100_000)
            assert wire.trouble() is None


def test_a_serial_line_goes_both_ways_and_comes_back_when_it_was_unplugged() -> None:
    vehicle, device = os.openpty()
    name = os.ttyname(device)
    with closing(open_wire(f"serial:{name}:57600")) as wire:
        assert wire.receive(0) == ()
        assert wire.trouble() is None
        os.close(device)
        wire.send(b"hello")
        os.write(vehicle, b"welcome")
        assert (os.read(vehicle, 5), received(wire, least=7)) == (b"hello", b"welcome")
        os.close(vehicle)
        until(lambda: wire.receive(0) or wire.trouble(), "the loss")
        wire.receive(NS)
        assert wire.trouble() == f"serial:{name}:57600: there is no such device: is it plugged in?"


def test_a_serial_line_that_another_program_has_is_told() -> None:
    vehicle, device = os.openpty()
    address = f"serial:{os.ttyname(device)}:57600"
    with closing(open_wire(address)) as one, closing(open_wire(address)) as other:
        one.receive(0)
        other.receive(0)
        assert one.trouble() is None
        assert other.trouble() == f"{address}: another program is using it: close that program"
    os.close(vehicle)
    os.close(device)


def test_without_pyserial_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "serial", None)
    with pytest.raises(DriverError, match=r"pip install 'kybflow\[mavlink\]'"):
        open_wire("serial:/dev/ttyUSB0:57600")


def test_what_is_sent_in_memory_is_received_in_order() -> None:
    one, other = memory_wires()
    one.send(b"1")
    one.send(b"2")
    other.send(b"3")
    assert [data for data, _ in other.receive(0)] == [b"1", b"2"]
    assert [data for data, _ in one.receive(0)] == [b"3"]
    assert not other.receive(0)
    assert one.trouble() is None


def test_a_wire_can_be_cut_either_way() -> None:
    one, other = memory_wires()
    one.deaf = True
    other.send(b"lost")
    one.send(b"heard")
    one.deaf, one.mute = False, True
    one.send(b"lost")
    other.send(b"heard")
    one.mute = False
    assert [data for data, _ in other.receive(0)] == [b"heard"]
    assert [data for data, _ in one.receive(0)] == [b"heard"], "nothing is kept while it is cut"


def test_what_was_under_way_when_it_was_cut_is_lost() -> None:
    one, other = memory_wires()
    other.send(b"under way")
    one.deaf = True
    assert not one.receive(0)
    one.deaf = False
    assert not one.receive(0)


def test_what_is_sent_to_an_end_that_hears_late_arrives_late_and_is_lost_when_that_ends() -> None:
    one, other = memory_wires()
    other.late = 2 * NS
    one.send(b"first")
    assert [other.receive(now * NS) for now in range(4)] == [[], [], [(b"first", None)], []]
    one.send(b"lost")
    assert other.receive(4 * NS) == []
    other.late = 0
    one.send(b"next")
    assert other.receive(5 * NS) == [(b"next", None)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("udpin:0.0.0.0:14540", Address("udpin", "0.0.0.0", 14540)),
        ("udpin:14540", Address("udpin", "127.0.0.1", 14540)),
        (" udpout:drone.lab:14580 ", Address("udpout", "drone.lab", 14580)),
        ("tcp:127.0.0.1:5760", Address("tcp", "127.0.0.1", 5760)),
        ("tcpin:5760", Address("tcpin", "127.0.0.1", 5760)),
        ("serial:/dev/ttyUSB0:57600", Address("serial", "/dev/ttyUSB0", 57600)),
        ("serial:COM3:921600", Address("serial", "COM3", 921600)),
        (
            "serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0:57600",
            Address("serial", "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0", 57600),
        ),
    ],
)
def test_an_address_is_written_like_this(text: str, expected: Address) -> None:
    assert expected == read_address(text)
    assert expected == read_address(str(expected))


@pytest.mark.parametrize(
    ("text", "way_out"),
    [
        ("", "write `udpin:HOST:PORT`"),
        ("127.0.0.1:14540", "write `udpin:HOST:PORT`"),
        ("udp:127.0.0.1:14540", "write `udpin:127.0.0.1:14540` to wait .* or `udpout:"),
        ("UDPIN:1.2.3.4:1", "write `udpin:HOST:PORT`"),
        ("udpin:", "write `udpin:HOST:PORT`"),
        ("udpin:a b:14540", "write `udpin:HOST:PORT`"),
        ("udpin:[::1]:14540", "write `udpin:HOST:PORT`"),
        ("udpout:14540", "has no host: write `udpout:HOST:14540`"),
        ("tcp:5760", "has no host: write `tcp:HOST:5760`"),
        ("tcp://127.0.0.1:5760", "write `tcp:127.0.0.1:5760`"),
        ("udpout://:14540", "has no host: write `udpout:HOST:14540`"),
        ("udpin:127.0.0.1:0", "ports go from 1 to 65535"),
        ("tcp:localhost:65536", "ports go from 1 to 65535"),
        ("serial:/dev/ttyUSB0", "write `serial:DEVICE:BAUD`, as in"),
        ("serial:/dev/ttyUSB0:fast", "write `serial:DEVICE:BAUD`, as in"),
        ("serial::57600", "write `serial:DEVICE:BAUD`, as in"),
    ],
)
def test_a_bad_one_says_what_to_write(text: str, way_out: str) -> None:
    with pytest.raises(DriverError, match=way_out):
        read_address(text)


def test_neither_pymavlink_nor_pyserial_is_needed_to_read_one() -> None:
    program = (
        "import sys\nsys.modules['pymavlink'] = sys.modules['serial'] = None\n"
        "from kybflow.drivers.mavlink.transport.wire import read_address\n"
        "print(read_address('udpin:1'))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    )
    assert done.stdout == "udpin:127.0.0.1:1\n"


@pytest.mark.parametrize(
    "text",
    [
        "udp://:14540", "udp://0.0.0.0:14540", "udp:14540", "udp:192.168.1.4:14550", "udpin://:1",
        "udpout://10.0.0.1:14550", "tcp://localhost:5760", "serial:///dev/ttyUSB0:57600",
    ],
)  # fmt: skip
def test_what_is_suggested_for_an_address_is_one(text: str) -> None:
    with pytest.raises(DriverError) as caught:
        read_address(text)
    suggested = re.findall(r"`([^`]+)`", str(caught.value).partition(": write ")[2])
    assert suggested
    for one in suggested:
        read_address(one)
