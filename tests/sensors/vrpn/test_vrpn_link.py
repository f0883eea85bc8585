"""Our client with our server: openings, many bodies and readers, losses, hostile peers."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator

import pytest
from waiting import HANGS, free_port, until

from kybflow.core.errors import DriverError
from kybflow.core.geometry import LEVEL
from kybflow.core.signals import NS, Time
from kybflow.sensors._stream import TrackerPose
from kybflow.sensors.vrpn.client import (
    Client,
    Key,
    ServerAddress,
    VrpnSubscription,
    read_address,
    subscribe,
)
from kybflow.sensors.vrpn.codec import COOKIE, POSE, Peer, PoseReport, encode_lob, encode_pose
from kybflow.sensors.vrpn.server import MOST_CLIENTS, Server

OPENINGS = pytest.mark.parametrize("direct", [True, False], ids=["direct", "lob"])


@pytest.fixture
def server() -> Iterator[Server]:
    opened = Server(port=0)
    yield opened
    opened.close()


def taken(subscription: VrpnSubscription, server: Server, body: str = "a") -> list[TrackerPose]:
    """What comes after poses of `body` were published until something did."""
    came: list[TrackerPose] = []

    def some() -> bool:
        server.publish(body, (1.0, 2.0, 3.0), LEVEL, sensor=subscription.key.sensor)
        came.extend(subscription.take())
        return bool(came)

    until(some, f"poses of {body}")
    return came


@pytest.mark.parametrize(
    ("text", "direct", "expected"),
    [
        ("vicon", True, ServerAddress("vicon", 3883, True)),
        ("vicon", False, ServerAddress("vicon", 3883, False)),
        (" 10.0.0.2:3884 ", True, ServerAddress("10.0.0.2", 3884, True)),
        ("tcp://vicon.lab:9", True, ServerAddress("vicon.lab", 9, True)),
        ("[::1]:3884", True, ServerAddress("::1", 3884, True)),
    ],
)
def test_a_server_is_written_like_this(text: str, direct: bool, expected: ServerAddress) -> None:
    assert read_address(text, direct) == expected


@pytest.mark.parametrize(
    "text", ["", "uav1@vicon", "vicon:0", "vicon:99999", "udp://vicon", "a b", "vicon:", "::1"]
)
def test_what_is_no_server_is_refused(text: str) -> None:
    with pytest.raises(DriverError, match=r"is not a VRPN server: write `HOST` or `HOST:3883`"):
        read_address(text, True)


def test_two_openings_at_once_are_refused() -> None:
    with pytest.raises(DriverError, match="leave out `tcp://` or `opening: lob`"):
        read_address("tcp://vicon", False)


@OPENINGS
def test_bodies_and_sensors_are_kept_apart_on_one_link(server: Server, direct: bool) -> None:
    address = ServerAddress("127.0.0.1", server.port, direct)
    readers = [subscribe(address, *key) for key in (("a", 0), ("a", 1), ("b", 0), ("a", 0))]
    came: list[list[TrackerPose]] = [[] for _ in readers]

    def all_came() -> bool:
        for x, (body, sensor) in enumerate((("a", 0), ("a", 1), ("b", 0))):
            server.publish(body, (float(x), 0.0, 0.0), LEVEL, sensor=sensor)
        for mine, reader in zip(came, readers, strict=True):
            mine.extend(reader.take())
        return all(came)

    until(all_came, "poses of all")
    assert [{report.position[0] for report in mine} for mine in came] == [{0}, {1}, {2}, {0}]
    assert server.clients == 1
    for reader in readers:
        reader.close()
    until(lambda: server.clients == 0, "the link being closed after its last reader")


def test_a_new_reader_after_the_last_opens_the_link_again(server: Server) -> None:
    address = ServerAddress("127.0.0.1", server.port)
    for _ in range(2):
        reader = subscribe(address, "a", 0)
        taken(reader, server)
        reader.close()
    until(lambda: f"vrpn {address}" not in {t.name for t in threading.enumerate()}, "its end")


@OPENINGS
def test_a_server_of_another_time_is_on_our_clock(server: Server, direct: bool) -> None:
    reader = subscribe(ServerAddress("127.0.0.1", server.port, direct), "a", 0)
    came: list[TrackerPose] = []
    stamp = [1_000 * NS]

    def enough() -> bool:
        stamp[0] += NS // 500
        server.publish("a", (stamp[0] / NS, 0.0, 0.0), LEVEL, stamp[0])
        came.extend(reader.take())
        return len(came) > 100

    until(enough, "poses")
    reader.close()
    assert all(report.time <= report.arrival for report in came)
    offsets = [round(report.time - report.position[0] * NS) for report in came]
    assert offsets[-1] <= min(r.arrival - round(r.position[0] * NS) for r in came) + 1000


def test_one_stamp_far_ahead_misdates_and_silences_nobody(server: Server) -> None:
    """Of two bodies; one has a stamp that is 0.6 s ahead, as a server can have it that was asked to
    set its clock. The client's clock goes on only when what was published has arrived."""
    now = [1_000 * NS]
    client = Client(ServerAddress("127.0.0.1", server.port), lambda: now[0])
    readers = [client.add(Key(body, 0)) for body in ("a", "b")]
    client.start()
    came: list[list[TrackerPose]] = [[], []]

    def arrived() -> bool:
        for mine, reader in zip(came, readers, strict=True):
            mine.extend(reader.take())
        return all(came)

    def publish(x: int, ahead: Time = 0) -> None:
        for body in ("a", "b"):
            stamp = now[0] + 1_000 * NS
            server.publish(body, (float(x), 0.0, 0.0), LEVEL, stamp + ahead * (body == "a"))

    until(lambda: publish(-1) or arrived(), "the first poses")  # type: ignore[func-returns-value]
    for x in range(100):
        now[0] += NS // 100
        publish(x, 600 * NS // 1000 if x == 50 else 0)
        until(lambda x=x: arrived() and all(m[-1].position[0] == x for m in came), f"pose {x}")  # type: ignore[misc]
    for reader in readers:
        reader.close()
    for mine in came:
        reports = [report for report in mine if report.position[0] >= 0.0]
        assert [report.position[0] for report in reports] == list(range(100)), "none is left out"
        assert all(report.time == report.arrival for report in reports)


def test_what_is_wrong_is_said(server: Server) -> None:
    port = free_port()
    readers = [
        subscribe(ServerAddress("127.0.0.1", server.port), body, sensor)
        for body, sensor in (("a", 0), ("a", 1), ("b", 0))
    ]
    until(lambda: "sends no" in (readers[0].trouble() or ""), "the link")
    assert readers[0].trouble() == f"127.0.0.1:{server.port} sends no `a`, but nothing else"
    taken(readers[0], server)
    until(lambda: readers[0].trouble() is None, "the body being known")
    assert readers[1].trouble() == "`a` has no sensor 1, but 0"
    assert readers[2].trouble() == f"127.0.0.1:{server.port} sends no `b`, but `a`"
    nobody = subscribe(ServerAddress("127.0.0.1", port), "a", 0)
    until(lambda: "refused" in (nobody.trouble() or ""), "the refusal")
    assert nobody.trouble() == f"no VRPN server at 127.0.0.1:{port}: Connection refused"
    for reader in (*readers, nobody):
        reader.close()


@pytest.mark.parametrize("stamp", [0, 7 * NS])
def test_time_stamps_that_stand_still_are_said_until_they_go_on(server: Server, stamp: int) -> None:
    reader = subscribe(ServerAddress("127.0.0.1", server.port), "a", 0)

    def publishes(step: int) -> bool:
        nonlocal stamp
        stamp += step
        server.publish("a", (0.0, 0.0, 0.0), LEVEL, stamp)
        return "time stamps of `a` stand still" in (reader.trouble() or "")

    until(lambda: publishes(0), "what is wrong")
    until(lambda: not publishes(NS // 100), "that it is right again")
    assert reader.trouble() is None
    reader.close()


@pytest.mark.thorough
@OPENINGS
def test_it_comes_back_when_the_server_does(direct: bool) -> None:
    port = free_port()
    reader = subscribe(ServerAddress("127.0.0.1", port, direct), "a", 0)
    for _ in range(3):
        opened = Server(port=port)
        taken(reader, opened)
        opened.close()
        until(lambda: reader.trouble() is not None, "the loss")
        reader.take()
    reader.close()


def test_a_server_that_speaks_something_else_is_told_apart() -> None:
    with socket.create_server(("127.0.0.1", 0)) as door:
        reader = subscribe(ServerAddress("127.0.0.1", door.getsockname()[1]), "a", 0)
        stream, _ = door.accept()
        with stream:
            stream.sendall(b"220 mail.example ESMTP ready\r\n")
            until(lambda: "not VRPN" in (reader.trouble() or "").partition(": ")[2], "the refusal")
        assert reader.trouble() is not None
        assert "the peer began with b'220 mail.example'" in str(reader.trouble())
        reader.close()


def test_a_datagram_that_was_overtaken_is_left_out() -> None:
    """A server by hand, because ours keeps the order."""
    with (
        socket.socket(type=socket.SOCK_DGRAM) as requests,
        socket.socket(type=socket.SOCK_DGRAM) as out,
    ):
        requests.bind(("127.0.0.1", 0))
        reader = subscribe(
            ServerAddress("127.0.0.1", requests.getsockname()[1], direct=False), "a", 0
        )
        words = requests.recv(100).rstrip(b"\0").split()
        peer = Peer()
        with socket.create_connection((words[0].decode(), int(words[1]))) as stream:
            stream.sendall(COOKIE + peer.introduce("a", POSE))
            while peer.datagrams_to is None:
                peer.receive(stream.recv(1000))
            came: list[TrackerPose] = []
            for ms in (10, 30, 20, 30, 40):
                payload = encode_pose(PoseReport(0, (float(ms), 0.0, 0.0), LEVEL))
                out.sendto(b"garbage", peer.datagrams_to)
                stamp = NS + ms * NS // 1000
                out.sendto(peer.datagram("a", POSE, stamp, payload), peer.datagrams_to)
            until(
                lambda: came.extend(reader.take()) or any(r.position[0] == 40 for r in came),  # type: ignore[func-returns-value]
                "the last",
            )
            assert [report.position[0] for report in came] == [10, 30, 40]
        reader.close()


def test_our_server_bears_hostile_clients(server: Server) -> None:
    place = ("127.0.0.1", server.port)
    reader = subscribe(ServerAddress(*place), "a", 0)
    taken(reader, server)
    closed = free_port()
    with socket.socket(type=socket.SOCK_DGRAM) as out:
        for request in (b"", b"\xff" * 100, b"nonsense", encode_lob("127.0.0.1", closed)):
            out.sendto(request, place)
    for words in (b"GET / HTTP/1.1\r\n\r\n", COOKIE + b"\xff" * 100):
        with socket.create_connection(place) as stream:
            stream.sendall(words)
            stream.settimeout(HANGS)
            while stream.recv(1000):
                pass
    with socket.create_connection(place) as stream:
        stream.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    until(lambda: server.clients == 1, "the bad ones being sent away")
    assert taken(reader, server)
    reader.close()


def test_a_client_that_can_not_be_let_in_stops_nobody(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the program has no more sockets, both for who connects and for who is called."""
    place = ("127.0.0.1", server.port)
    reader = subscribe(ServerAddress(*place), "a", 0)
    taken(reader, server)

    def none(*_: object) -> None:
        raise OSError("Too many open files")

    monkeypatch.setattr("kybflow.sensors.vrpn.server._ClientConnection", none)
    with socket.create_connection(place) as stream:
        stream.settimeout(HANGS)
        assert stream.recv(1) == b""
    with socket.create_server(("127.0.0.1", 0)) as door, socket.socket(type=socket.SOCK_DGRAM) as s:
        s.sendto(encode_lob("127.0.0.1", door.getsockname()[1]), place)
        called, _ = door.accept()
        with called:
            called.settimeout(HANGS)
            assert called.recv(1) == b""
    assert taken(reader, server)
    reader.close()


def test_a_client_that_reads_nothing_is_dropped_and_stops_nobody(server: Server) -> None:
    place = ("127.0.0.1", server.port)
    reader = subscribe(ServerAddress(*place), "a", 0)
    taken(reader, server)
    with socket.socket() as lazy:
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 14)
        lazy.connect(place)
        lazy.sendall(COOKIE)
        until(lambda: server.clients == 2, "the lazy one")

        def dropped() -> bool:
            for _ in range(100):
                server.publish("a", (0.0, 0.0, 0.0), LEVEL)
            return bool(taken(reader, server)) and server.clients == 1

        until(dropped, "its end")
    reader.close()


def test_our_server_lets_in_so_many(server: Server) -> None:
    streams = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(MOST_CLIENTS)]
    until(lambda: server.clients == MOST_CLIENTS, "all")
    with socket.create_connection(("127.0.0.1", server.port)) as one_more:
        one_more.settimeout(HANGS)
        assert one_more.recv(1) == b""
    for stream in streams:
        stream.close()


def test_a_port_that_is_taken_is_said(server: Server) -> None:
    with pytest.raises(DriverError, match=f"at 127.0.0.1:{server.port}: Address already in use"):
        Server(port=server.port)
