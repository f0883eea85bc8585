"""What our client does with one open link, by a clock of the test."""

from __future__ import annotations

import pytest

from kybflow.core.geometry import LEVEL
from kybflow.core.signals import NS
from kybflow.sensors.vrpn.client import Key, VrpnSubscription, _Reader
from kybflow.sensors.vrpn.codec import (
    COOKIE,
    PING,
    POSE,
    Peer,
    PoseReport,
    SenderStatus,
    encode_pose,
)


class Wire:
    """A connection: what comes next, and what was sent."""

    here = ("127.0.0.1", 4000)

    def __init__(self) -> None:
        self.coming: list[bytes] = []
        self.server = Peer()
        self.server.receive(COOKIE)
        self.pings: list[str] = []

    def wait(self, seconds: float) -> tuple[bytes, list[bytes]]:
        return (self.coming.pop(0) if self.coming else b""), []

    def send(self, data: bytes) -> None:
        for sender, _, what in self.server.receive(data):
            assert what == SenderStatus(PING)
            self.pings.append(sender)


@pytest.fixture
def now() -> list[int]:
    return [0]


@pytest.fixture
def wire() -> Wire:
    return Wire()


@pytest.fixture
def listener(wire: Wire, now: list[int]) -> _Reader:
    return _Reader(wire, lambda: now[0])  # type: ignore[arg-type]


def pose(server: Peer, stamp: int, body: str = "a") -> bytes:
    payload = encode_pose(PoseReport(0, (stamp / NS, 0.0, 0.0), LEVEL))
    return server.message(body, POSE, stamp, payload)


def reader() -> VrpnSubscription:
    return VrpnSubscription(None, Key("a", 0))  # type: ignore[arg-type]


def test_nothing_is_said_before_the_cookie_and_then_where_datagrams_go(
    wire: Wire, listener: _Reader, now: list[int]
) -> None:
    listener.receive({Key("a", 0): ()})
    assert wire.server.datagrams_to is None
    assert wire.pings == []
    wire.coming = [COOKIE[:10], COOKIE[10:]]
    listener.receive({})
    assert wire.server.datagrams_to is None
    listener.receive({})
    assert wire.server.datagrams_to == ("127.0.0.1", 4000)


def test_silent_bodies_are_asked_once_a_second_and_others_not(
    wire: Wire, listener: _Reader, now: list[int]
) -> None:
    wanted = {Key("a", 0): (), Key("a", 1): (), Key("b", 0): ()}
    speaker = Peer()
    wire.coming = [COOKIE]
    asked = []
    for tick in range(40):
        now[0] = tick * NS // 10
        if 10 <= tick < 20:
            wire.coming.append(pose(speaker, now[0]))
        listener.receive(wanted)
        asked += [(tick, body) for body in wire.pings]
        wire.pings.clear()
    assert asked == [
        (0, "a"), (0, "b"), (10, "b"), (20, "b"), (30, "a"), (30, "b"),
    ]  # fmt: skip


def test_a_link_that_falls_silent_is_given_up(
    wire: Wire, listener: _Reader, now: list[int]
) -> None:
    wire.coming = [COOKIE]
    for now[0] in (0, 2 * NS, 5 * NS):
        listener.receive({})
    now[0] = 5 * NS + 1
    with pytest.raises(TimeoutError, match="no data for 5 s"):
        listener.receive({})


def test_a_server_whose_clock_is_set_back_is_heard_on(
    wire: Wire, listener: _Reader, now: list[int]
) -> None:
    mine, speaker = reader(), Peer()
    wire.coming = [COOKIE]
    listener.receive({})
    stamps = [100 * NS, 101 * NS, 40 * NS, 41 * NS]
    for i, stamp in enumerate(stamps):
        now[0] = i * NS
        wire.coming = [pose(speaker, stamp)]
        listener.receive({mine.key: (mine,)})
    assert [report.position[0] for report in mine.take()] == [100, 101, 40, 41]
