"""Two ends of a link talk without a socket."""

from __future__ import annotations

import pytest

from kybflow.sensors.vrpn.codec import (
    COOKIE,
    PING,
    POSE,
    SENDER,
    TEXT,
    CodecError,
    Peer,
    PoseReport,
    SenderMessage,
    SenderStatus,
    describe,
    encode,
    encode_pose,
)

REPORT = PoseReport(3, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0))
PAYLOAD = encode_pose(REPORT)
DARK = bytes.fromhex("00000001 00000000") + b"dark\0"
"""A text with the severity of a warning."""


def met() -> tuple[Peer, Peer]:
    """One who speaks, and one who has heard its cookie."""
    speaker, listener = Peer(), Peer()
    assert listener.receive(COOKIE) == []
    assert listener.is_connected
    return speaker, listener


def test_names_are_described_once_and_understood() -> None:
    speaker, listener = met()
    first = speaker.message("uav1", POSE, 5000, PAYLOAD)
    second = speaker.message("uav1", POSE, 6000, PAYLOAD)
    assert len(second) == 88 < len(first)
    assert listener.receive(first) == [SenderMessage("uav1", 5000, REPORT)]
    assert listener.receive(second) == [SenderMessage("uav1", 6000, REPORT)]
    assert listener.senders == {0: "uav1"}


def test_pings_and_texts_are_heard() -> None:
    speaker, listener = met()
    words = speaker.message("a", PING, 0) + speaker.message("b", TEXT, 0, DARK)
    assert listener.receive(words) == [
        SenderMessage("a", 0, SenderStatus(PING)),
        SenderMessage("b", 0, SenderStatus(TEXT, "dark", 1)),
    ]


def test_both_channels_mean_the_same_and_count_apart() -> None:
    speaker, listener = met()
    listener.receive(speaker.introduce("a", POSE))
    datagrams = [speaker.datagram("a", POSE, t, PAYLOAD) for t in (1000, 2000)]
    assert [int.from_bytes(datagram[20:24]) for datagram in datagrams] == [0, 1]
    for t, datagram in zip((1000, 2000), datagrams, strict=True):
        assert listener.receive_datagram(datagram) == [SenderMessage("a", t, REPORT)]


def test_a_datagram_that_is_faster_than_its_description_is_left_out() -> None:
    speaker, listener = met()
    described = speaker.introduce("a", POSE)
    datagram = speaker.datagram("a", POSE, 1000, PAYLOAD)
    assert listener.receive_datagram(datagram) == []
    listener.receive(described)
    assert listener.receive_datagram(datagram) == [SenderMessage("a", 1000, REPORT)]


def test_a_datagram_can_not_rename_anybody() -> None:
    _, listener = met()
    with pytest.raises(CodecError, match="a description in a datagram"):
        listener.receive_datagram(encode(describe(SENDER, 0, "other")))


def test_where_datagrams_are_to_go_is_heard() -> None:
    speaker, listener = met()
    assert listener.datagrams_to is None
    listener.receive(speaker.ask_for_datagrams("127.0.0.1", 4000))
    assert listener.datagrams_to == ("127.0.0.1", 4000)
