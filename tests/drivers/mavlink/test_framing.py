"""Frames: what is made is read again, by pymavlink too; what is damaged is never a message."""

from __future__ import annotations

import math
import subprocess
import sys

import pytest
from framing import SET_MODE, Framing
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.protocol.framing import Counts, Message, Packer, Parser

NAN = math.nan
ATTITUDE = mavlink.MAVLink_attitude_message(1234, 0.5, -0.25, 3.0, 0.125, 0.0, 0.0)
MESSAGES = [
    ATTITUDE,
    mavlink.MAVLink_heartbeat_message(2, 12, 81, 0x60000, 4, 3),
    mavlink.MAVLink_statustext_message(4, b"Arming denied! \xffResolve it", 7, 1),
    mavlink.MAVLink_param_set_message(1, 1, b"MPC_XY_VEL_MAX\0\0", 12.0, 9),
    mavlink.MAVLink_odometry_message(
        2**63, 20, 12, 1.0, NAN, 3.0, [1.0, 0.0, 0.0, 0.0], 0.5, 0.5, 0.5, 0.0, 0.0, 0.0,
        [0.25] * 21, [NAN] * 21, 3, 2, 100,
    ),
    mavlink.MAVLink_battery_status_message(
        0, 1, 1, 2**15 - 1, [4000] * 10, 100, -1, -1, 80, voltages_ext=[0, 0, 0, 1]
    ),
    mavlink.MAVLink_highres_imu_message(9, *[0.5] * 13, 0xFFFF, 2),
    mavlink.MAVLink_command_long_message(
        1, 1, SET_MODE, 0, 1.0, 6.0, NAN, 0.0, 0.0, 0.0, -math.inf
    ),
    mavlink.MAVLink_current_mode_message(1, 2, 3),
]  # fmt: skip
BY_TYPE = pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.get_type())
RANDOM_MESSAGES = st.sampled_from(MESSAGES)


def fields(message: Message) -> list[str]:
    """Every field, so that NaN is equal to NaN."""
    return [
        repr(getattr(message, name)) for name in mavlink.mavlink_map[message.get_msgId()].fieldnames
    ]


def frame(message: Message = ATTITUDE, system: int = 1) -> bytes:
    return Packer(system).pack(message, 1)


def version_1(message: Message = ATTITUDE, system: int = 1) -> bytes:
    theirs: bytes = message.pack(mavlink.MAVLink(None, system, 1), force_mavlink1=True)
    return theirs


@BY_TYPE
def test_what_is_packed_is_parsed(message: Message) -> None:
    theirs, ours = Framing(7, 1), Framing(245)
    (read,) = ours.parse(theirs.pack(message))
    assert (message.get_type(), 7, 1) == (
        read.get_type(), read.get_srcSystem(), read.get_srcComponent(),
    )  # fmt: skip
    assert fields(message) == fields(read)
    assert Counts(messages=1) == ours.counts


@BY_TYPE
def test_pymavlink_packs_the_same_bytes(message: Message) -> None:
    assert message.pack(mavlink.MAVLink(None, 7, 1)) == Packer(7).pack(message, 1)


def test_version_1_is_heard_too() -> None:
    (read,) = Parser().parse(version_1())
    assert fields(ATTITUDE) == fields(read)
    assert (read.get_srcSystem(), read.get_srcComponent()) == (1, 1)


def test_each_component_counts_its_own_frames() -> None:
    ours, theirs = Framing(245), Parser()
    sent = [(191, 0), (190, 0), (191, 1), (191, 2), (190, 1)]
    read = theirs.parse(b"".join(ours.pack(ATTITUDE, component) for component, _ in sent))
    assert sent == [(message.get_srcComponent(), message.get_seq()) for message in read]


def test_sequence_numbers_begin_anew_after_255() -> None:
    ours, theirs = Packer(245), Parser()
    read = [theirs.parse(ours.pack(ATTITUDE))[0].get_seq() for _ in range(257)]
    assert [*range(256), 0] == read


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (mavlink.MAVLink_attitude_message(-1, 0, 0, 0, 0, 0, 0), "a ATTITUDE can't be sent"),
        (mavlink.MAVLink_attitude_message(1, 1e39, 0, 0, 0, 0, 0), "a ATTITUDE can't be sent"),
        (mavlink.MAVLink_attitude_message(1, None, 0, 0, 0, 0, 0), "a ATTITUDE can't be sent"),
    ],
)
def test_what_does_not_fit_is_told_and_counts_nothing(message: Message, words: str) -> None:
    packer = Packer(245)
    with pytest.raises(DriverError, match=words):
        packer.pack(message)
    assert Parser().parse(packer.pack(ATTITUDE))[0].get_seq() == 0


def test_a_stream_may_be_cut_anywhere() -> None:
    stream = b"".join(frame(message) for message in MESSAGES)
    parser = Parser()
    read = [message for byte in stream for message in parser.parse(bytes([byte]))]
    assert [m.get_type() for m in MESSAGES] == [m.get_type() for m in read]
    assert Counts(messages=len(MESSAGES)) == parser.counts


def test_no_good_frame_is_lost_to_a_bad_one() -> None:
    damaged = bytearray(frame(MESSAGES[4]))
    damaged[30] ^= 1
    parser = Parser()
    read = parser.parse(b"noise" + frame() + bytes(damaged) + frame() + b"\xfd\xff\0" + frame())
    read += parser.parse(frame())
    assert len(read) == 4
    assert Counts(messages=4, bad=3) == parser.counts


def test_a_datagram_cut_short_delays_nothing() -> None:
    parser = Parser()
    assert parser.parse(frame()[:-5]) == []
    assert len(parser.parse(frame())) == 1
    assert Counts(messages=1, bad=1) == parser.counts


def test_unknown_messages_are_counted_and_skipped() -> None:
    unknown = bytearray(frame())
    unknown[7:10] = (410).to_bytes(3, "little")
    parser = Parser()
    assert len(parser.parse(bytes(unknown) + frame() + bytes(unknown))) == 1
    assert Counts(messages=1, unknown=2) == parser.counts


def test_what_must_be_understood_and_is_not_is_dropped() -> None:
    flagged = bytearray(frame())
    flagged[2] = 2
    parser = Parser()
    assert parser.parse(bytes(flagged)) == []
    assert Counts(bad=1) == parser.counts


def test_a_newer_message_with_more_fields_is_read_as_far_as_it_is_known() -> None:
    longer = frame()[1:10] + frame()[10:-2].ljust(28, b"\0") + b"\1\2\3"
    longer = bytes([len(longer) - 9]) + longer[1:]
    checksum = mavlink.x25crc(longer + bytes([ATTITUDE.crc_extra])).crc
    (read,) = Parser().parse(b"\xfd" + longer + checksum.to_bytes(2, "little"))
    assert fields(ATTITUDE) == fields(read)


def test_the_environment_does_not_turn_checksums_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mavlink, "MAVLINK_IGNORE_CRC", "1")
    assert Parser().parse(frame()[:-1] + b"!") == []


@given(st.lists(st.binary(max_size=400), max_size=5))
def test_noise_never_raises(chunks: list[bytes]) -> None:
    parser = Parser()
    for chunk in chunks:
        parser.parse(chunk)
    assert len(parser.parse(b"\0" * 600 + frame())) == 1, "and what is good comes through"


@given(RANDOM_MESSAGES, st.data())
def test_a_frame_with_a_wrong_bit_is_no_message(message: Message, data: st.DataObject) -> None:
    damaged = bytearray(frame(message))
    bit = data.draw(st.integers(8, 8 * len(damaged) - 1))
    damaged[bit // 8] ^= 1 << bit % 8
    parser = Parser()
    assert parser.parse(bytes(damaged)) == []
    assert parser.parse(b"\0" * 600) == [], "what waits for the rest of a longer frame is none"
    assert parser.counts.bad + parser.counts.unknown >= 1


@given(RANDOM_MESSAGES, st.data())
def test_a_frame_cut_short_is_no_message(message: Message, data: st.DataObject) -> None:
    whole = frame(message)
    parser = Parser()
    assert parser.parse(whole[: data.draw(st.integers(0, len(whole) - 1))]) == []


@given(st.lists(st.tuples(RANDOM_MESSAGES, st.booleans()), max_size=12), st.integers(1, 300))
def test_counts_add_up(sent: list[tuple[Message, bool]], size: int) -> None:
    """Any mixture of good frames and of those with a wrong checksum, cut anywhere."""
    stream = b"".join(frame(m) if good else frame(m)[:-1] + b"\0\0" for m, good in sent)
    good = [message.get_type() for message, is_good in sent if is_good]
    parser = Parser()
    chunks = [stream[at : at + size] for at in range(0, len(stream), size)]
    read = [
        message.get_type() for chunk in [*chunks, b"\0" * 300] for message in parser.parse(chunk)
    ]
    damaged = [m for m, is_good in sent if not is_good and frame(m)[-1] != 0]
    assert len(good) <= len(read) <= len(sent) - len(damaged)
    assert len(read) == parser.counts.messages
    assert bool(damaged) <= bool(parser.counts.bad)


def test_what_nobody_wants_is_checked_but_not_read() -> None:
    parser = Parser(wanted=frozenset({0}))
    heartbeat = MESSAGES[1]
    read = parser.parse(frame(ATTITUDE) + frame(heartbeat) + frame(ATTITUDE)[:-1] + b"\0\0")
    assert [message.get_type() for message in read] == ["HEARTBEAT"]
    assert (parser.counts.messages, parser.counts.bad) == (1, 1)


def test_without_pymavlink_it_says_what_to_install() -> None:
    program = (
        "import sys\nsys.modules['pymavlink'] = None\n"
        "from kybflow.core.errors import DriverError\n"
        "try:\n    import kybflow.drivers.mavlink.protocol.framing\n"
        "except DriverError as error:\n    print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    )
    assert "pip install 'kybflow[mavlink]'" in done.stdout
