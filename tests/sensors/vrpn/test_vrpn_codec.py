"""The bytes of VRPN: real ones, round trips, streams cut anywhere, garbage; and two ends of a link
that talk without a socket."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kybflow.sensors.vrpn.codec import (
    COOKIE,
    MAX_MESSAGE,
    PING,
    POSE,
    SENDER,
    TEXT,
    TYPE,
    CodecError,
    Message,
    MessageDecoder,
    Peer,
    PoseReport,
    SenderMessage,
    SenderStatus,
    check_cookie,
    decode_datagram,
    decode_lob,
    decode_pose,
    decode_text,
    describe,
    described,
    encode,
    encode_lob,
    encode_pose,
    read_target,
    target_message,
)

REAL = bytes.fromhex(
    "000000586b00d51c000e234a00000004000000040000001a"
    "0000000000000000"
    "000000000000000000000000000000000000000000000000"
    "3fec5207c946971f00000000000000000000000000000000bfddcbd2d363f011"
)
"""A pose as the reference server 07.38 sent it: 88 bytes."""

numbers = st.floats(allow_nan=False)
triples = st.tuples(numbers, numbers, numbers)
integers = st.integers(-(2**31), 2**31 - 1)
reports = st.builds(PoseReport, integers, triples, st.tuples(numbers, numbers, numbers, numbers))
names = st.text(st.characters(exclude_characters="\0", codec="utf-8"), min_size=1, max_size=24)
messages = st.builds(
    Message,
    st.integers(0, 2**32 * 1_000_000 - 1).map(lambda us: us * 1000),
    integers,
    integers,
    st.binary(max_size=200),
)


def test_a_real_pose_is_read_and_written_again_byte_by_byte() -> None:
    (message,) = decode_datagram(REAL)
    assert message.stamp == (0x6B00D51C * 1_000_000 + 0x000E234A) * 1000
    assert (message.sender, message.type) == (4, 4)
    w, x = -0.46556539202992536, 0.8850134786739689
    (first,) = struct.unpack(">d", bytes.fromhex("3fec5207c946971f"))
    (last,) = struct.unpack(">d", bytes.fromhex("bfddcbd2d363f011"))
    report = decode_pose(message.payload)
    assert report == PoseReport(0, (0.0, 0.0, 0.0), (last, first, 0.0, 0.0))
    assert (last, first) == pytest.approx((w, x), abs=1e-3)
    assert encode(message._replace(payload=encode_pose(report)), 26) == REAL


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (COOKIE, b"vrpn: ver. 07.38  0\0\0\0\0\0"),
        (encode_lob("127.0.0.1", 49215), b"127.0.0.1 49215\0"),
        (
            encode(describe(SENDER, 2, "uav1"), 7),
            bytes.fromhex("00000021 00000000 00000000 00000002 ffffffff 00000007 00000005")
            + b"uav1\0"
            + bytes(7),
        ),
        (
            encode(target_message("127.0.0.1", 4000)),
            bytes.fromhex("00000022 00000000 00000000 00000fa0 fffffffd 00000000")
            + b"127.0.0.1\0"
            + bytes(6),
        ),
    ],
)
def test_what_is_written_is_what_the_protocol_says(written: bytes, expected: bytes) -> None:
    assert written == expected


@given(reports)
def test_a_pose_comes_back(report: PoseReport) -> None:
    assert decode_pose(encode_pose(report)) == report


@given(st.sampled_from((SENDER, TYPE)), st.integers(0, 1999), names)
def test_a_description_comes_back(kind: int, number: int, name: str) -> None:
    (message,) = decode_datagram(encode(describe(kind, number, name)))
    assert message.type == kind
    assert described(message) == (number, name)


@given(st.integers(1, 65535))
def test_addresses_come_back(port: int) -> None:
    assert decode_lob(encode_lob("10.0.0.7", port)) == ("10.0.0.7", port)
    assert read_target(target_message("10.0.0.7", port)) == ("10.0.0.7", port)


@given(st.integers(0, 2), names)
def test_a_text_is_read(severity: int, text: str) -> None:
    payload = struct.pack(">II", severity, 0) + text.encode() + b"\0"
    assert decode_text(payload) == (severity, text)


@given(st.lists(messages, max_size=6), st.lists(st.integers(1, 60), max_size=40))
def test_a_stream_may_be_cut_anywhere(sent: list[Message], cuts: list[int]) -> None:
    stream = COOKIE + b"".join(encode(message, i) for i, message in enumerate(sent))
    decoder, came, at = MessageDecoder(), [], 0
    for length in (*cuts, len(stream)):
        came += decoder.feed(stream[at : at + length])
        at += length
    assert came == sent
    assert decoder.version == "07.38"


@given(st.lists(messages, min_size=1, max_size=5))
def test_a_datagram_holds_whole_messages(sent: list[Message]) -> None:
    data = b"".join(map(encode, sent))
    assert decode_datagram(data) == sent
    with pytest.raises(CodecError, match="ends within a message"):
        decode_datagram(data[:-1] if sent[-1].payload else data + b"\0")


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda: MessageDecoder().feed(b"HTTP/1.1"), "not VRPN: the peer began with b'HTTP/1.1'"),
        (
            lambda: check_cookie(b"vrpn: ver. 06.04  0".ljust(24, b"\0")),
            "is not supported; 07.38 is",
        ),
        (lambda: MessageDecoder().feed(COOKIE + bytes(24)), "a message of 0 bytes"),
        (lambda: decode_datagram(REAL[:-8]), "ends within a message, 80 bytes"),
        (lambda: decode_pose(bytes(63)), "63 bytes of a pose, which should be 64"),
        (lambda: decode_text(bytes(5)), "5 bytes of a text, which should be 8"),
        (lambda: described(Message(0, 2000, SENDER, b"")), "number 2000"),
        (lambda: described(Message(0, 1, SENDER, b"\0\0\0\x09x\0")), "a name of 9 bytes in 2"),
        (lambda: describe(SENDER, 0, ""), "1 to 99 bytes"),
        (lambda: describe(SENDER, 0, "a" * 100), "1 to 99 bytes"),
        (lambda: describe(TYPE, 2000, "a"), "at most 2000"),
        (lambda: encode(Message(0, 0, 0, bytes(MAX_MESSAGE))), "longer than 64000"),
        (lambda: encode(Message(-1000, 0, 0)), "does not fit"),
        (lambda: encode_pose(PoseReport(2**31, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0))), "not fit"),
        (lambda: decode_lob(b"127.0.0.1\0"), "no request"),
        (lambda: decode_lob(b"127.0.0.1 99999\0"), "a port of 99999"),
        (lambda: decode_lob(b" 80\0"), "an address of ''"),
        (lambda: decode_lob("127.0.0.1 ²\0".encode()), "no request"),
        (lambda: read_target(Message(0, 0, -3, b"127.0.0.1\0")), "a port of 0"),
    ],
)
def test_a_refusal_says_what_was_found(call: Callable[[], Any], reason: str) -> None:
    with pytest.raises(CodecError) as refused:
        call()
    assert reason in str(refused.value)


DECODERS: list[Callable[[bytes], Any]] = [
    lambda data: MessageDecoder().feed(data),
    lambda data: MessageDecoder().feed(COOKIE + data),
    check_cookie,
    decode_datagram,
    decode_pose,
    decode_text,
    decode_lob,
    lambda data: described(Message(0, 1, SENDER, data)),
    lambda data: read_target(Message(0, 1, -3, data)),
]


@pytest.mark.parametrize("decode", DECODERS)
@given(st.one_of(st.binary(max_size=200), st.binary(max_size=64).map(lambda b: REAL[:24] + b)))
def test_garbage_raises_nothing_else(decode: Callable[[bytes], Any], data: bytes) -> None:
    with contextlib.suppress(CodecError):
        decode(data)


def test_garbage_is_not_kept() -> None:
    decoder = MessageDecoder()
    decoder.feed(COOKIE)
    with pytest.raises(CodecError):
        decoder.feed(b"\xff" * 24)


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
