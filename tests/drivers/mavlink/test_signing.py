"""Signed messages: with signing on, nothing that is unsigned, forged or old is ever a message."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.protocol.framing import Counts, Packer, Parser
from kybflow.drivers.mavlink.protocol.signing import (
    EPOCH_NS,
    SIGNATURE_BYTES,
    STAMP_STEP_NS,
    Signing,
    read_key,
)

KEY, OTHER = bytes(range(32)), bytes(32)
SECOND = 1_000_000_000
ATTITUDE = mavlink.MAVLink_attitude_message(1234, 0.5, -0.25, 3.0, 0.125, 0.0, 0.0)
RADIO = mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
SETUP = mavlink.MAVLink_setup_signing_message(1, 1, list(KEY), 5)


class Wall:
    """A clock that stands: nanoseconds since 1970."""

    def __init__(self, seconds: float = 360_000_000.0) -> None:
        self.now = EPOCH_NS + round(seconds * SECOND)

    def __call__(self) -> int:
        return self.now


def signing(key: bytes = KEY, wall: Wall | None = None) -> Signing:
    return Signing(key, Wall() if wall is None else wall)


def stamp(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


def test_what_is_signed_is_heard_once() -> None:
    packer, parser = Packer(1, signing()), Parser(signing())
    frames = [packer.pack(ATTITUDE, 1) for _ in range(3)]
    assert len(parser.parse(b"".join(frames))) == 3
    assert parser.parse(b"".join(frames)) == []
    assert Counts(messages=3, refused=3, stale=3) == parser.counts


def test_times_rise_while_the_clock_stands_or_goes_back() -> None:
    wall = Wall(100.0)
    packer = Packer(1, signing(wall=wall), link=3)
    first, second = packer.pack(ATTITUDE), packer.pack(ATTITUDE)
    wall.now -= 50 * SECOND
    third = packer.pack(ATTITUDE)
    wall.now += 60 * SECOND
    assert [stamp(frame) for frame in (first, second, third, packer.pack(ATTITUDE))] == [
        10_000_000,
        10_000_001,
        10_000_002,
        11_000_000,
    ]
    assert first[-SIGNATURE_BYTES] == 3


def test_ours_are_not_older_than_what_was_heard() -> None:
    theirs, ours = signing(wall=Wall(2000.0)), signing(wall=Wall(1000.0))
    Parser(ours).parse(Packer(1, theirs).pack(ATTITUDE))
    assert stamp(Packer(245, ours).pack(ATTITUDE)) == 2000 * SECOND // STAMP_STEP_NS + 1


def test_pymavlink_believes_ours_and_we_its() -> None:
    theirs = mavlink.MAVLink(None, 1, 1)
    theirs.signing.secret_key, theirs.signing.sign_outgoing = KEY, True
    theirs.signing.timestamp, theirs.signing.link_id = 360_000_000 * 100_000, 9
    ours = signing()
    assert len(Parser(ours).parse(ATTITUDE.pack(theirs))) == 1
    assert theirs.decode(bytearray(Packer(245, ours).pack(ATTITUDE))).get_signed()


@pytest.mark.parametrize("message", [ATTITUDE, RADIO, SETUP], ids=lambda m: m.get_type())
@pytest.mark.parametrize("sender", [None, signing(OTHER)], ids=["unsigned", "another key"])
def test_nothing_is_exempt(message: object, sender: Signing | None) -> None:
    parser = Parser(signing())
    assert parser.parse(Packer(1, sender).pack(message, 68)) == []
    assert Counts(refused=1) == parser.counts


def test_version_1_can_not_be_signed() -> None:
    parser = Parser(signing())
    assert parser.parse(ATTITUDE.pack(mavlink.MAVLink(None, 1, 1), force_mavlink1=True)) == []
    assert Counts(refused=1) == parser.counts


def test_without_a_key_signed_messages_are_heard_unchecked() -> None:
    assert len(Parser().parse(Packer(1, signing(OTHER)).pack(ATTITUDE))) == 1


@pytest.mark.parametrize(("late", "heard"), [(59.0, 1), (61.0, 0)])
def test_a_new_stream_may_be_a_minute_old(late: float, heard: int) -> None:
    old = Packer(1, signing(wall=Wall(1000.0 - late))).pack(ATTITUDE)
    assert heard == len(Parser(signing(wall=Wall(1000.0))).parse(old))


def test_a_forged_time_does_not_silence_a_vehicle() -> None:
    theirs, parser = Packer(1, signing()), Parser(signing())
    forged = Packer(1, signing(OTHER, Wall(9e8))).pack(ATTITUDE)
    assert parser.parse(forged) == []
    assert len(parser.parse(theirs.pack(ATTITUDE))) == 1


def test_streams_are_told_apart_by_link_system_and_component() -> None:
    wall = Wall()
    parser = Parser(signing())
    frames = [
        Packer(system, signing(wall=wall), link).pack(ATTITUDE, component)
        for system, component, link in [(1, 1, 0), (1, 1, 1), (2, 1, 0), (1, 2, 0), (1, 1, 0)]
    ]
    assert [len(parser.parse(frame)) for frame in frames] == [1, 1, 1, 1, 0]


@given(st.data())
def test_any_damage_is_refused(data: st.DataObject) -> None:
    frame = bytearray(Packer(1, signing()).pack(ATTITUDE, 1))
    bit = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[bit // 8] ^= 1 << bit % 8
    parser = Parser(signing())
    read = parser.parse(bytes(frame)) + parser.parse(b"\0" * 600)
    assert read == []
    counts = parser.counts
    assert (counts.messages, counts.bad + counts.refused + counts.unknown >= 1) == (0, True)


@given(st.lists(st.sampled_from(["good", "unsigned", "forged", "again", "noise"]), max_size=20))
def test_counts_add_up(kinds: list[str]) -> None:
    ours, plain, forger = Packer(1, signing()), Packer(1), Packer(1, signing(OTHER))
    sent = ours.pack(ATTITUDE)
    made = {
        "good": lambda: ours.pack(ATTITUDE),
        "unsigned": lambda: plain.pack(ATTITUDE),
        "forged": lambda: forger.pack(ATTITUDE),
        "again": lambda: sent,
        "noise": lambda: b"\xfd\1\0noise, and more of it",
    }
    parser = Parser(signing())
    parser.parse(sent)
    for kind in kinds:
        assert (kind == "good") == bool(parser.parse(made[kind]()))
    good, noise = kinds.count("good"), kinds.count("noise")
    refused, stale = len(kinds) - good - noise, kinds.count("again")
    expected = Counts(messages=1 + good, refused=refused, stale=stale, bad=noise)
    assert expected == parser.counts


@pytest.mark.parametrize(
    ("data", "key"),
    [
        (KEY, KEY),
        (KEY.hex().encode() + b"\n", KEY),
        (KEY.hex().upper().encode(), KEY),
        (b" correct horse\r\n", sha256(b"correct horse").digest()),
        ("Füße".encode(), sha256("Füße".encode()).digest()),
        (b"a passphrase of just 32 letters!", sha256(b"a passphrase of just 32 letters!").digest()),
    ],
    ids=["bytes", "digits", "capital digits", "passphrase", "not English", "32 letters"],
)
def test_a_key_is_written_like_this(tmp_path: Path, data: bytes, key: bytes) -> None:
    (tmp_path / "key").write_bytes(data)
    (tmp_path / "key").chmod(0o600)
    assert key == read_key(tmp_path / "key")


@pytest.mark.parametrize("mode", [0o640, 0o604])
def test_a_key_that_others_may_read_is_warned_of(tmp_path: Path, mode: int) -> None:
    (tmp_path / "key").write_bytes(KEY)
    (tmp_path / "key").chmod(mode)
    with pytest.warns(UserWarning, match="others on this machine can read the key in .*chmod 600"):
        assert read_key(tmp_path / "key") == KEY


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty: write a passphrase"),
        (b" \n", "is empty: write a passphrase"),
        (
            bytes(31),
            "has 31 bytes, which are not text: a key is 32 bytes, 64 hexadecimal digits or",
        ),
        (None, "no key can be read from .*: No such file"),
    ],
)
def test_what_is_no_key_is_refused(tmp_path: Path, data: bytes | None, words: str) -> None:
    if data is not None:
        (tmp_path / "key").write_bytes(data)
        (tmp_path / "key").chmod(0o600)
    with pytest.raises(DriverError, match=words):
        read_key(tmp_path / "key")


def test_a_key_has_32_bytes() -> None:
    with pytest.raises(DriverError, match="has 31 bytes, not 32"):
        Signing(bytes(31))
