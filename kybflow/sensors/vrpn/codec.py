"""Encoding and decoding of VRPN messages, without sockets.

All numbers are big-endian. Each side of a TCP connection starts with a cookie of 24 bytes. Messages
have a header of 24 bytes and a payload padded to a multiple of 8:

    u32 length = 24 + unpadded payload | u32 s | u32 us | i32 sender | i32 type | u32 sequence

A UDP datagram holds whole messages. Each side numbers its types and senders, and announces their
names in system messages, which have a negative type and carry their argument as `sender`. Malformed
data raises CodecError.

Source: the public C++ library (vrpn_Connection.C, vrpn_Tracker.C of 07.38).
"""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

from kybflow.core.errors import DriverError
from kybflow.core.geometry import Quat, Vec3
from kybflow.core.signals import Time

PORT = 3883
MAGIC, VERSION = b"vrpn: ver. ", b"07.38"
COOKIE_SIZE = 24
COOKIE = (MAGIC + VERSION + b"  0").ljust(COOKIE_SIZE, b"\0")
"""Our cookie: the version, and 0 for no logging."""
SENDER, TYPE, UDP = -1, -2, -3
"""Types of system messages: the description of a sender, the description of a type, and the address
for datagrams."""
POSE, PING, PONG, TEXT = (
    "vrpn_Tracker Pos_Quat",
    "vrpn_Base ping_message",
    "vrpn_Base pong_message",
    "vrpn_Base text_message",
)
MAX_MESSAGE = 64_000
"""Longest message, bytes; the size of a peer's buffer."""
LONGEST_NAME, MOST_NAMES = 99, 2000
_HEADER = struct.Struct(">IIIiiI")
_POSE = struct.Struct(">ii3d4d")
_TEXT = struct.Struct(">II")
_LENGTH = struct.Struct(">I")
_MICROSECOND = 1000


class CodecError(DriverError):
    """The bytes are not VRPN, or the values can't be encoded."""


class Message(NamedTuple):
    """A message. stamp: time on the sender's clock, nanoseconds since 1970, in whole microseconds.
    sender, type: numbers that the sending side assigned."""

    stamp: Time
    sender: int
    type: int
    payload: bytes = b""


class PoseReport(NamedTuple):
    """The pose of a tracker's sensor, in the tracker's axes and units."""

    sensor: int
    position: Vec3
    attitude: Quat


def check_cookie(cookie: bytes) -> str:
    """Return the peer's version, such as `07.38`. Raises CodecError if the major version differs
    from ours."""
    if not cookie.startswith(MAGIC):
        raise CodecError(f"not VRPN: the peer began with {cookie[:16]!r}")
    version = cookie[len(MAGIC) : len(MAGIC) + len(VERSION)]
    if version[:3] != VERSION[:3]:
        raise CodecError(f"VRPN version {version!r} is not supported; {VERSION.decode()} is")
    return version.decode("ascii", "replace")


def encode(message: Message, sequence: int = 0) -> bytes:
    length = _HEADER.size + len(message.payload)
    if length > MAX_MESSAGE:
        raise CodecError(f"a message of {length} bytes is longer than {MAX_MESSAGE}")
    seconds, rest = divmod(message.stamp // _MICROSECOND, 1_000_000)
    try:
        header = _HEADER.pack(
            length, seconds, rest, message.sender, message.type, sequence & 0xFFFFFFFF
        )
    except struct.error as error:
        raise CodecError(f"a message that does not fit: {error}") from None
    return header + message.payload + bytes(-length % 8)


class MessageDecoder:
    """Splits a stream of bytes into messages. version: the peer's version, None until its cookie
    has arrived. After a CodecError, the connection must be reopened with a new decoder."""

    def __init__(self) -> None:
        self.version: str | None = None
        self._waiting = bytearray()

    def feed(self, data: bytes) -> list[Message]:
        """Return the messages that `data` completes."""
        waiting = self._waiting
        waiting += data
        if self.version is None:
            if len(waiting) < COOKIE_SIZE:
                if not MAGIC.startswith(bytes(waiting[: len(MAGIC)])):
                    raise CodecError(f"not VRPN: the peer began with {bytes(waiting[:16])!r}")
                return []
            self.version = check_cookie(bytes(waiting[:COOKIE_SIZE]))
            del waiting[:COOKIE_SIZE]
        messages, end = _split(waiting)
        del waiting[:end]
        return messages


def decode_datagram(data: bytes) -> list[Message]:
    messages, end = _split(data)
    if end != len(data):
        raise CodecError(
            f"a datagram ends within a message, {len(data) - end} bytes after it began"
        )
    return messages


def _split(data: bytes | bytearray) -> tuple[list[Message], int]:
    """Return the complete messages at the start of `data`, and the index after the last one."""
    messages: list[Message] = []
    at, size = 0, _HEADER.size
    while at + size <= len(data):
        length, seconds, rest, sender, kind, _ = _HEADER.unpack_from(data, at)
        if not size <= length <= MAX_MESSAGE:
            raise CodecError(f"a message of {length} bytes, which can have {size} to {MAX_MESSAGE}")
        if at + length + -length % 8 > len(data):
            break
        stamp = (seconds * 1_000_000 + rest) * _MICROSECOND
        messages.append(Message(stamp, sender, kind, bytes(data[at + size : at + length])))
        at += length + -length % 8
    return messages, at


def describe(kind: int, number: int, name: str) -> Message:
    """Return the system message that assigns a number to the name of a sender or type. kind: SENDER
    or TYPE. Raises CodecError if the name or the number is invalid."""
    text = name.encode("utf-8", "replace")
    if not 0 < len(text) <= LONGEST_NAME or b"\0" in text:
        raise CodecError(f"`{name}` is not a VRPN name: it needs 1 to {LONGEST_NAME} bytes, no NUL")
    if not 0 <= number < MOST_NAMES:
        raise CodecError(f"VRPN has at most {MOST_NAMES} senders and types")
    return Message(0, number, kind, _LENGTH.pack(len(text) + 1) + text + b"\0")


def described(message: Message) -> tuple[int, str]:
    """Return the number and the name that a description assigns."""
    if not 0 <= message.sender < MOST_NAMES:
        raise CodecError(f"a description of number {message.sender}; they go to {MOST_NAMES - 1}")
    (length,) = _unpack(_LENGTH, message.payload[: _LENGTH.size], "description")
    text = message.payload[_LENGTH.size :]
    if length != len(text):
        raise CodecError(f"a description with a name of {length} bytes in {len(text)}")
    return message.sender, _string(text)


def target_message(address: str, port: int) -> Message:
    """Return the system message that asks the peer to send datagrams to an address."""
    return Message(0, port, UDP, address.encode("ascii") + b"\0")


def read_target(message: Message) -> tuple[str, int]:
    return _address(_string(message.payload), message.sender)


def encode_lob(address: str, port: int) -> bytes:
    """Return the datagram that asks a server to connect to us by TCP."""
    return f"{address} {port}".encode("ascii") + b"\0"


def decode_lob(data: bytes) -> tuple[str, int]:
    """Return the address and port in a datagram that requests a connection."""
    words = _string(data).split(" ")
    if len(words) != 2 or not (words[1].isascii() and words[1].isdigit()) or len(words[1]) > 5:
        raise CodecError(f"no request for a connection: {data[:40]!r}")
    return _address(words[0], int(words[1]))


def encode_pose(report: PoseReport) -> bytes:
    (w, x, y, z), sensor = report.attitude, report.sensor
    try:
        return _POSE.pack(sensor, sensor, *report.position, x, y, z, w)
    except struct.error as error:
        raise CodecError(f"a pose that does not fit: {error}") from None


def decode_pose(payload: bytes) -> PoseReport:
    """Return the pose in a payload. Its numbers are not checked and may be NaN."""
    sensor, _, px, py, pz, x, y, z, w = _unpack(_POSE, payload, "pose")
    return PoseReport(sensor, (px, py, pz), (w, x, y, z))


def decode_text(payload: bytes) -> tuple[int, str]:
    """Return the severity (0 normal, 1 warning, 2 error) and the text of a TEXT message."""
    severity, _ = _unpack(_TEXT, payload[: _TEXT.size], "text")
    return severity, _string(payload[_TEXT.size :])


def _unpack(layout: struct.Struct, data: bytes, what: str) -> tuple[Any, ...]:
    if len(data) != layout.size:
        raise CodecError(f"{len(data)} bytes of a {what}, which should be {layout.size}")
    return layout.unpack(data)


def _string(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode("utf-8", "replace")


def _address(address: str, port: int) -> tuple[str, int]:
    if not 0 < port < 65536:
        raise CodecError(f"a port of {port}")
    if not address or len(address) > 253 or not address.isascii():
        raise CodecError(f"an address of {address!r}")
    return address, port


class SenderStatus(NamedTuple):
    """A message other than a pose. kind: PING, PONG or TEXT."""

    kind: str
    text: str = ""
    severity: int = 0


class SenderMessage(NamedTuple):
    """A decoded message. sender: its name. stamp: time on the peer's clock."""

    sender: str
    stamp: Time
    what: PoseReport | SenderStatus


class Peer:
    """One end of a connection, without its socket: decodes the messages from the other end and
    encodes those to it, with senders and types given by name. datagrams_to: the address at which
    the other end wants datagrams; None if unknown. senders: the other end's sender names by
    number."""

    def __init__(self) -> None:
        self.datagrams_to: tuple[str, int] | None = None
        self.senders: dict[int, str] = {}
        self._types: dict[int, str] = {}
        self._decoder = MessageDecoder()
        self._introduced: dict[int, dict[str, int]] = {SENDER: {}, TYPE: {}}
        self._sequence = self._datagram = 0

    @property
    def is_connected(self) -> bool:
        """Whether the peer's cookie has arrived."""
        return self._decoder.version is not None

    def receive(self, data: bytes) -> list[SenderMessage]:
        """Return the messages that bytes from TCP complete. Raises CodecError, after which the
        connection must be closed."""
        return self._decode(self._decoder.feed(data))

    def receive_datagram(self, data: bytes) -> list[SenderMessage]:
        """Return the messages in a datagram. Raises CodecError, which doesn't affect the
        connection."""
        messages = decode_datagram(data)
        if any(message.type < 0 for message in messages):
            raise CodecError("a description in a datagram")
        return self._decode(messages)

    def message(self, sender: str, kind: str, stamp: Time, payload: bytes = b"") -> bytes:
        """Encode a message for TCP, preceded by the descriptions of its sender and type if the peer
        needs them."""
        introduction = self.introduce(sender, kind)
        return introduction + self._numbered(self._message(sender, kind, stamp, payload))

    def datagram(self, sender: str, kind: str, stamp: Time, payload: bytes = b"") -> bytes:
        """Encode a message as a datagram. The peer must know its sender and its type already
        (`introduce`)."""
        self._datagram += 1
        return encode(self._message(sender, kind, stamp, payload), self._datagram - 1)

    def ask_for_datagrams(self, address: str, port: int) -> bytes:
        """Encode the request, sent over TCP, for datagrams to an address."""
        return self._numbered(target_message(address, port))

    def introduce(self, sender: str, *kinds: str) -> bytes:
        """Encode the descriptions, sent over TCP, of those names that the peer doesn't know yet."""
        out = b""
        for table, name in ((SENDER, sender), *((TYPE, kind) for kind in kinds)):
            known = self._introduced[table]
            if name not in known:
                out += self._numbered(describe(table, len(known), name))
                known[name] = len(known)
        return out

    def _message(self, sender: str, kind: str, stamp: Time, payload: bytes) -> Message:
        return Message(
            stamp, self._introduced[SENDER][sender], self._introduced[TYPE][kind], payload
        )

    def _numbered(self, message: Message) -> bytes:
        self._sequence += 1
        return encode(message, self._sequence - 1)

    def _decode(self, messages: list[Message]) -> list[SenderMessage]:
        reports = []
        for message in messages:
            if message.type < 0:  # a system message; those about logging are ignored
                if message.type in (SENDER, TYPE):
                    number, name = described(message)
                    (self.senders if message.type == SENDER else self._types)[number] = name
                elif message.type == UDP:
                    self.datagrams_to = read_target(message)
                continue
            sender, kind = self.senders.get(message.sender), self._types.get(message.type)
            if sender is None:
                continue  # a datagram may overtake the description of its sender
            if kind == POSE:
                reports.append(SenderMessage(sender, message.stamp, decode_pose(message.payload)))
            elif kind in (PING, PONG):
                reports.append(SenderMessage(sender, message.stamp, SenderStatus(kind)))
            elif kind == TEXT:
                severity, text = decode_text(message.payload)
                reports.append(
                    SenderMessage(sender, message.stamp, SenderStatus(TEXT, text, severity))
                )
        return reports
