"""Our client and our server against the C++ library of VRPN, inside the wheel `motioncapture`."""

from __future__ import annotations

import itertools

import pytest
from cpp_vrpn import CppClient, cpp_server
from waiting import free_port, until

from kybflow.sensors._stream import TrackerPose
from kybflow.sensors.vrpn.client import ServerAddress, subscribe
from kybflow.sensors.vrpn.server import Server

pytest.importorskip("motioncapture", "1.1")

pytestmark = pytest.mark.peer

OPENINGS = pytest.mark.parametrize("direct", [True, False], ids=["direct", "lob"])


@OPENINGS
def test_our_client_reads_the_cpp_server(direct: bool) -> None:
    port = free_port()
    address = ServerAddress("127.0.0.1", port, direct)
    with cpp_server(port, "uav1", "uav2"):
        keys = list(itertools.product(("uav1", "uav2"), (0, 1)))
        open_ = {key: subscribe(address, *key) for key in keys}
        came: dict[tuple[str, int], list[TrackerPose]] = {key: [] for key in keys}

        def enough() -> bool:
            for key, subscription in open_.items():
                came[key] += subscription.take()
            return all(len(reports) >= 50 for reports in came.values())

        until(enough, "poses of the C++ server")
        assert [subscription.trouble() for subscription in open_.values()] == [None] * 4
        for subscription in open_.values():
            subscription.close()
    for (name, sensor), reports in came.items():
        counts = [round(1000 * report.position[2]) for report in reports]
        if direct:
            assert counts == list(range(counts[0], counts[0] + len(counts)))
        assert counts == sorted(set(counts))
        for report in reports:
            assert report.position[:2] == (("uav1", "uav2").index(name), sensor)
            assert report.attitude == (0.8, 0.0, 0.0, 0.6)
            assert report.time <= report.arrival
        stamps = [report.time for report in reports]
        assert stamps == sorted(stamps)


@OPENINGS
def test_our_client_comes_back_when_the_cpp_server_does(direct: bool) -> None:
    port = free_port()
    subscription = subscribe(ServerAddress("127.0.0.1", port, direct), "uav1", 0)
    for _ in range(2):
        until(lambda: subscription.trouble() is not None, "the loss of the server")
        subscription.take()
        with cpp_server(port, "uav1"):
            until(lambda: len(subscription.take()) > 0, "poses of the C++ server")
            assert subscription.trouble() is None
    subscription.close()


@OPENINGS
def test_the_cpp_client_reads_our_server_and_comes_back_to_it(direct: bool) -> None:
    port = free_port()
    attitude = (0.8, 0.0, 0.0, 0.6)
    with CppClient(f"tcp://127.0.0.1:{port}" if direct else f"127.0.0.1:{port}") as client:
        for life in range(2):
            del client.lines[:]
            server = Server(port=port)
            counter = itertools.count()

            def seen(server: Server = server, counter: itertools.count[int] = counter) -> bool:
                k = next(counter)
                for i, name in enumerate(("uav1", "uav2")):
                    server.publish(name, (i + 0.25, -0.5, k / 1024), attitude)
                return len({line for line in client.lines if line[1][2] > 0}) >= 20

            until(seen, f"poses at the C++ client, in life {life} of the server")
            assert server.clients == 1
            server.close()
            for name, (x, y, z, *turn) in client.lines:
                assert (x, y) == (("uav1", "uav2").index(name) + 0.25, -0.5)
                assert (z * 1024).is_integer()
                assert turn == pytest.approx(attitude)
            assert {name for name, _ in client.lines} == {"uav1", "uav2"}


def test_our_server_survives_a_client_that_is_killed() -> None:
    server = Server(port=0)
    counter = itertools.count()

    def publish() -> None:
        server.publish("uav1", (0.0, 0.0, next(counter) / 1024), (1.0, 0.0, 0.0, 0.0))

    for _ in range(2):
        with CppClient(f"tcp://127.0.0.1:{server.port}") as client:
            until(lambda c=client: publish() or len(c.lines) > 3, "poses")  # type: ignore[misc]
        until(lambda: publish() or server.clients == 0, "its end being noticed")  # type: ignore[func-returns-value]
    server.close()
