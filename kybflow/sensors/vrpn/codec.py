"""VRPN on the wire: bytes to values and back, without a socket.

Big-endian throughout. A TCP link begins with 24 bytes from each side, the cookie; then come
messages of a 24-byte header and a payload padded to 8:

    u32 length = 24 + unpadded payload | u32 s | u32 us | i32 sender | i32 type | u32 sequence

A UDP datagram holds whole messages. Types and senders are numbers that each side chooses and
describes in system messages, whose type is negative (and whose `sender` is their argument). What
is not VRPN raises CodecError, and nothing else.

Source: the public C++ library (vrpn_Connection.C, vrpn_Tracker.C of 07.38).
"""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

from kybflow.core.errors import DriverError
from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import Time

MAGIC, VERSION = b"vrpn: ver. ", b"07.38"
COOKIE_SIZE = 24
COOKIE = (MAGIC + VERSION + b"  0").ljust(COOKIE_SIZE, b"\0")
"""What we send: our version, and that nothing is to be logged."""
SENDER, TYPE, UDP = -1, -2, -3
"""The system messages that describe a sender, a type, and where datagrams are to go."""
POSE, PING, PONG, TEXT = (
    "vrpn_Tracker Pos_Quat",
    "vrpn_Base ping_message",
    "vrpn_Base pong_message",
    "vrpn_Base text_message",
)
LONGEST = 64_000
"""Bytes of the longest message: a peer's buffer."""
LONGEST_NAME, MOST_NAMES = 99, 2000
_HEADER = struct.Struct(">IIIiiI")
_POSE = struct.Struct(">ii3d4d")
_TEXT = struct.Struct(">II")
_LENGTH = struct.Struct(">I")
_MICROSECOND = 1000


class CodecError(DriverError):
    """These bytes are not VRPN, or these values don't fit into it."""


class Message(NamedTuple):
    """One message. stamp: the sender's clock (nanoseconds since 1970, whole microseconds). sender,
    type: the sender's own numbers."""

    stamp: Time
    sender: int
    type: int
    payload: bytes = b""


class PoseReport(NamedTuple):
    """What a tracker says of one of its sensors, in its own axes and units."""

    sensor: int
    position: Vec3
    attitude: Quat


def check_cookie(cookie: bytes) -> str:
    """The peer's version, like `07.38`; the major one must be ours."""
    if not cookie.startswith(MAGIC):
        raise CodecError(f"no VRPN: the peer began with {cookie[:16]!r}")
    version = cookie[len(MAGIC) : len(MAGIC) + len(VERSION)]
    if version[:3] != VERSION[:3]:
        raise CodecError(f"VRPN of version {version!r}; {VERSION.decode()} is spoken here")
    return version.decode("ascii", "replace")


def encode(message: Message, sequence: int = 0) -> bytes:
    """The message as bytes, padded."""
    length = _HEADER.size + len(message.payload)
    if length > LONGEST:
        raise CodecError(f"a message of {length} bytes is longer than {LONGEST}")
    seconds, rest = divmod(message.stamp // _MICROSECOND, 1_000_000)
    try:
        header = _HEADER.pack(
            length, seconds, rest, message.sender, message.type, sequence & 0xFFFFFFFF
        )
    except struct.error as error:
        raise CodecError(f"a message that does not fit: {error}") from None
    return header + message.payload + bytes(-length % 8)


class MessageDecoder:
    """Messages from a stream of bytes, however it is cut; `version` is None until the cookie has
    come. After a CodecError it is of no more use: the link must be opened anew."""

    def __init__(self) -> None:
        self.version: str | None = None
        self._waiting = bytearray()

    def feed(self, data: bytes) -> list[Message]:
        """The messages that `data` completes."""
        waiting = self._waiting
        waiting += data
        if self.version is None:
            if len(waiting) < COOKIE_SIZE:
                if not MAGIC.startswith(bytes(waiting[: len(MAGIC)])):
                    raise CodecError(f"no VRPN: the peer began with {bytes(waiting[:16])!r}")
                return []
            self.version = check_cookie(bytes(waiting[:COOKIE_SIZE]))
            del waiting[:COOKIE_SIZE]
        messages, end = _split(waiting)
        del waiting[:end]
        return messages


def decode_datagram(data: bytes) -> list[Message]:
    """The messages of a datagram, which holds them whole."""
    messages, end = _split(data)
    if end != len(data):
        raise CodecError(
            f"a datagram ends within a message, {len(data) - end} bytes after it began"
        )
    return messages


def _split(data: bytes | bytearray) -> tuple[list[Message], int]:
    """The whole messages at the beginning of `data`, and where they end."""
    messages: list[Message] = []
    at, size = 0, _HEADER.size
    while at + size <= len(data):
        length, seconds, rest, sender, kind, _ = _HEADER.unpack_from(data, at)
        if not size <= length <= LONGEST:
            raise CodecError(f"a message of {length} bytes, which can have {size} to {LONGEST}")
        if at + length + -length % 8 > len(data):
            break
        stamp = (seconds * 1_000_000 + rest) * _MICROSECOND
        messages.append(Message(stamp, sender, kind, bytes(data[at + size : at + length])))
        at += length + -length % 8
    return messages, at


def describe(kind: int, number: int, name: str) -> Message:
    """The system message that says which number (of a SENDER or a TYPE) a name has from now on."""
    text = name.encode("utf-8", "replace")
    if not 0 < len(text) <= LONGEST_NAME or b"\0" in text:
        raise CodecError(f"`{name}` is no VRPN name: it needs 1 to {LONGEST_NAME} bytes, no NUL")
    if not 0 <= number < MOST_NAMES:
        raise CodecError(f"VRPN has at most {MOST_NAMES} senders and types")
    return Message(0, number, kind, _LENGTH.pack(len(text) + 1) + text + b"\0")


def described(message: Message) -> tuple[int, str]:
    """The number and the name in a description."""
    if not 0 <= message.sender < MOST_NAMES:
        raise CodecError(f"a description of number {message.sender}; they go to {MOST_NAMES - 1}")
    (length,) = _unpack(_LENGTH, message.payload[: _LENGTH.size], "description")
    text = message.payload[_LENGTH.size :]
    if length != len(text):
        raise CodecError(f"a description with a name of {length} bytes in {len(text)}")
    return message.sender, _string(text)


def point_to(address: str, port: int) -> Message:
    """The system message that asks the peer to send datagrams there."""
    return Message(0, port, UDP, address.encode("ascii") + b"\0")


def pointed_to(message: Message) -> tuple[str, int]:
    """The address and port in it."""
    return _address(_string(message.payload), message.sender)


def encode_lob(address: str, port: int) -> bytes:
    """The datagram that asks a server to open the TCP link to us."""
    return f"{address} {port}".encode("ascii") + b"\0"


def decode_lob(data: bytes) -> tuple[str, int]:
    """Where such a datagram asks to be connected."""
    words = _string(data).split(" ")
    if len(words) != 2 or not (words[1].isascii() and words[1].isdigit()) or len(words[1]) > 5:
        raise CodecError(f"no request for a connection: {data[:40]!r}")
    return _address(words[0], int(words[1]))


def encode_pose(report: PoseReport) -> bytes:
    """The payload of a POSE."""
    (w, x, y, z), sensor = report.attitude, report.sensor
    try:
        return _POSE.pack(sensor, sensor, *report.position, x, y, z, w)
    except struct.error as error:
        raise CodecError(f"a pose that does not fit: {error}") from None


def decode_pose(payload: bytes) -> PoseReport:
    """The report in it; its numbers may be anything, even NaN."""
    sensor, _, px, py, pz, x, y, z, w = _unpack(_POSE, payload, "pose")
    return PoseReport(sensor, (px, py, pz), (w, x, y, z))


def decode_text(payload: bytes) -> tuple[int, str]:
    """The severity (0 normal, 1 warning, 2 error) and the text of a TEXT."""
    severity, _ = _unpack(_TEXT, payload[: _TEXT.size], "text")
    return severity, _string(payload[_TEXT.size :])


def _unpack(layout: struct.Struct, data: bytes, what: str) -> tuple[Any, ...]:
    if len(data) != layout.size:
        raise CodecError(f"{len(data)} bytes of a {what}, which should be {layout.size}")
    return layout.unpack(data)


def _string(data: bytes) -> str:
    """The text before the first NUL."""
    return data.split(b"\0", 1)[0].decode("utf-8", "replace")


def _address(address: str, port: int) -> tuple[str, int]:
    if not 0 < port < 65536:
        raise CodecError(f"a port of {port}")
    if not address or len(address) > 253 or not address.isascii():
        raise CodecError(f"an address of {address!r}")
    return address, port
