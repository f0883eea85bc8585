"""Conversion between MAVLink frames and messages.

Version 2 is sent; version 1 is also read, unless messages are signed. A field may hold any float,
including NaN, which has a meaning in some fields.

pymavlink supplies the message classes with the layout of their fields. Its parser is not used: it
is many times slower, loses good frames after a bad byte, and ignores checksums if an environment
variable is set. A message with only numeric fields is read as a tuple (`FieldTuple`), at a tenth of
the cost of a pymavlink object; a message with text fields is read as a pymavlink object."""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter, itemgetter
from typing import Any, ClassVar

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.protocol.signing import SIGNATURE_BYTES, Signing

try:
    from pymavlink.dialects.v20 import all as dialect
except ImportError as missing:
    raise DriverError("MAVLink needs pymavlink: pip install 'kybflow[mavlink]'") from missing

mavlink = dialect
"""The messages and constants of MAVLink. No other module imports pymavlink."""

Message = Any
"""A message object of pymavlink, or a `FieldTuple` with the same attributes: `get_type()`,
`get_srcSystem()`, `get_srcComponent()` and the fields."""
ONBOARD: int = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""Our component id, that of an onboard computer."""
START_V1 = 0xFE
START_V2 = 0xFD
"""The first byte of a frame in version 1 and in version 2."""
SIGNED_FLAG = 1
"""The flag of a signed frame, the only known one of the flags that a receiver must understand."""
_MARKER = re.compile(b"[\xfd\xfe]")
_HEADER = struct.Struct("<BBBBBBBHB")
_FIRST_HEAD, _SECOND_HEAD, _CHECKSUM = 6, 10, 2
_SHORTEST = _SECOND_HEAD + _CHECKSUM
_SENDER = -3
"""The index at which system, component and sequence number begin in a `FieldTuple`."""


def size_of(data: bytes, at: int, end: int) -> int:
    """Return the size of the frame that begins at index `at`; 0 if none begins there, -1 if it is
    incomplete. end: the length of the data."""
    if data[at] == START_V2:
        if end - at < 3:
            return -1
        flags = data[at + 2]
        if flags & ~SIGNED_FLAG:
            return 0  # frames with unknown flags must be dropped
        size = _SECOND_HEAD + data[at + 1] + _CHECKSUM + (SIGNATURE_BYTES if flags else 0)
    elif data[at] == START_V1:
        if end - at < 2:
            return -1
        size = _FIRST_HEAD + data[at + 1] + _CHECKSUM
    else:
        return 0
    return size if size <= end - at else -1


Sender = tuple[int, int, int]
"""A frame's system id, component id and sequence number."""


def _body(frame: bytes) -> int:
    """Return the index at which the payload of a complete frame ends."""
    if frame[2] == SIGNED_FLAG and frame[0] == START_V2:
        return len(frame) - _CHECKSUM - SIGNATURE_BYTES
    return len(frame) - _CHECKSUM


def is_signed(frame: bytes) -> bool:
    return frame[0] == START_V2 and frame[2] == SIGNED_FLAG


def number_of(frame: bytes) -> int:
    """Return the frame's message id."""
    return frame[5] if frame[0] == START_V1 else frame[7] | frame[8] << 8 | frame[9] << 16


def next_of(data: bytes, at: int) -> int:
    """Return the index at or after `at` where the next frame may begin."""
    found = _MARKER.search(data, at)
    return len(data) if found is None else found.start()


class FieldTuple(tuple[Any, ...]):
    """A message with only numeric fields: the fields in the order on the wire, followed by the
    sender's system id, component id and the sequence number. Each message type has a subclass with
    the fields as attributes."""

    __slots__ = ()
    _name: ClassVar[str]
    _number: ClassVar[int]

    def get_type(self) -> str:
        return self._name

    def get_msgId(self) -> int:  # noqa: N802 - pymavlink's name
        return self._number

    def get_srcSystem(self) -> int:  # noqa: N802
        system: int = self[_SENDER]
        return system

    def get_srcComponent(self) -> int:  # noqa: N802
        component: int = self[-2]
        return component

    def get_seq(self) -> int:
        return int(self[-1])


def _list_at(span: slice) -> Callable[[tuple[Any, ...]], list[Any]]:
    return lambda message: list(message[span])


class MessageLayout:
    """The payload layout of one message type. made: the message's class in pymavlink."""

    def __init__(self, made: Any) -> None:
        self.made, self.id = made, made.id
        self.size, self._unpack_from = made.unpacker.size, made.unpacker.unpack_from
        self._pack = made.unpacker.pack
        self.extra = bytes((made.crc_extra,))
        self._has_texts = "s" in str(made.unpacker.format)
        starts = [sum(made.lengths[:place]) for place in range(len(made.lengths))]
        self._spans = [(starts[place], made.lengths[place]) for place in made.orders]
        self._arrays = dict(zip(made.ordered_fieldnames, made.array_lengths, strict=True))
        self._fields: Callable[[Message], Sequence[Any]] | None = None

    def fits(self, frame: bytes, body: int) -> bool:
        """Return whether the checksum is correct. body: the index at which the payload ends."""
        return _checksum(frame[1:body] + self.extra) == frame[body] | frame[body + 1] << 8

    def message(self, frame: bytes, head: int, body: int, sender: Sender) -> Message | None:
        """Return the message in a frame; None if a field has an impossible value, such as an
        invalid text. head, body: the indices at which the payload begins and ends."""
        if body - head < self.size:  # zeros at the end are not sent
            values = self._unpack_from(frame[head:body].ljust(self.size, b"\0"))
        else:
            values = self._unpack_from(frame, head)
        if not self._has_texts:
            return tuple.__new__(self._kind, values + sender)
        fields = []
        for start, count in self._spans:
            value = values[start]
            if isinstance(value, bytes):
                value = value.rstrip(b"\0")
            elif count > 1:
                value = list(values[start : start + count])
            fields.append(value)
        try:
            message = self.made(*fields)
        except Exception:  # pymavlink may raise anything on foreign bytes
            return None
        header = message.get_header()
        header.srcSystem, header.srcComponent, header.seq = sender
        return message

    def of(self, *values: float) -> FieldTuple:
        """Return a message to send. values: its fields in the order on the wire, with arrays
        flattened."""
        return tuple.__new__(self._kind, (*values, 0, 0, 0))

    @cached_property
    def _kind(self) -> type[FieldTuple]:
        """The `FieldTuple` subclass for this message type."""
        made = self.made
        members: dict[str, Any] = {"__slots__": (), "_name": made.msgname, "_number": made.id}
        start = 0
        for name, length, count in zip(
            made.ordered_fieldnames, made.lengths, made.array_lengths, strict=True
        ):
            members[name] = property(
                _list_at(slice(start, start + length)) if count else itemgetter(start)
            )
            start += length
        return type(made.__name__, (FieldTuple,), members)

    def frame(self, message: Message, sequence: int, sender: tuple[int, int], flags: int) -> bytes:
        """Return a version 2 frame of the message, without a signature. Raises DriverError if a
        value doesn't fit its field."""
        try:
            packed: bytes = self._pack(*self._values(message))
        except (struct.error, OverflowError, TypeError) as error:
            raise DriverError(f"a {message.get_type()} can't be sent: {error}") from error
        payload = packed.rstrip(b"\0") or b"\0"
        head = _HEADER.pack(
            START_V2, len(payload), flags, 0, sequence, *sender, self.id & 0xFFFF, self.id >> 16
        )
        data = head + payload
        return data + _checksum(data[1:] + self.extra).to_bytes(_CHECKSUM, "little")

    def _values(self, message: Message) -> Sequence[Any]:
        if isinstance(message, FieldTuple):
            return message[:_SENDER]
        if self._fields is None:
            stored = []
            for name, count in self._arrays.items():
                raw = f"_{name}_raw"  # holds the bytes of a text field
                stored.append((raw, False) if hasattr(message, raw) else (name, count > 0))
            self._fields = _reader(stored)
        return self._fields(message)


def _reader(fields: list[tuple[str, bool]]) -> Callable[[Message], Sequence[Any]]:
    """Return a function that reads these attributes in order, with arrays flattened."""
    names = [name for name, _ in fields]
    if len(names) > 1 and not any(is_array for _, is_array in fields):
        return attrgetter(*names)

    def read(message: Message) -> Sequence[Any]:
        values: list[Any] = []
        for name, is_array in fields:
            value = getattr(message, name)
            values += value if is_array else (value,)
        return values

    return read


_checksum: Callable[[bytes], int] = getattr(mavlink, "mcrf4xx", None) or (
    lambda data: int(mavlink.x25crc(data).crc)
)
"""The checksum, CRC-16/MCRF4XX."""
LAYOUTS: dict[int, MessageLayout] = {
    number: MessageLayout(made) for number, made in mavlink.mavlink_map.items()
}
NUMBERS: dict[str, int] = {layout.made.msgname: number for number, layout in LAYOUTS.items()}

_DROPPED = object()
"""The result of `Parser._frame` for a valid frame that is not read."""


@dataclass(slots=True)
class Counts:
    """Counts of received frames.

    messages: messages returned.
    bad: runs of bytes without a valid frame.
    refused: frames that are unsigned, wrongly signed or old.
    stale: refused frames that are correctly signed, but old.
    signed: frames whose signature is not checked, because there is no key.
    unknown: frames of unknown message types."""

    messages: int = 0
    bad: int = 0
    refused: int = 0
    stale: int = 0
    signed: int = 0
    unknown: int = 0


class Parser:
    """Reads the messages of one sender from whole frames or a stream of bytes. Never raises.

    wanted: the ids of the messages to return; if empty, all are returned. Other frames are dropped
    before their fields are read; without a key, a frame that fills its datagram is dropped even
    before its checksum is compared.
    unread: counts the dropped frames of known types, by the sender's system id and message id.
    stale: the senders, by system and component id, whose signature was correct but too old. The
    caller empties it.
    """

    def __init__(
        self,
        signing: Signing | None = None,
        counts: Counts | None = None,
        wanted: Set[int] = frozenset(),
        unread: Counter[tuple[int, int]] | None = None,
    ) -> None:
        self.counts = Counts() if counts is None else counts
        self._unread = Counter() if unread is None else unread
        self.stale: set[tuple[int, int]] = set()
        self._signing, self._wanted = signing, wanted
        self._rest = b""

    def parse(self, data: bytes) -> list[Message]:
        """Return the messages that are now complete, oldest first. After a bad byte the search
        continues at the next byte, so no valid frame is lost."""
        size = len(data)
        if (
            self._signing is None and not self._rest and size >= _SHORTEST and data[0] == START_V2
            and not data[2] and size == data[1] + _SHORTEST
        ):  # fmt: skip
            # exactly one unsigned frame, as in most datagrams, so no search is needed
            number = int.from_bytes(data[7:10], "little")
            if self._wanted and number not in self._wanted:
                if number in LAYOUTS:
                    self._unread[data[5], number] += 1
                return []
            layout, body = LAYOUTS.get(number), size - _CHECKSUM
            if layout is not None and layout.fits(data, body):
                sender = (data[5], data[6], data[4])
                message = layout.message(data, _SECOND_HEAD, body, sender)
                if message is not None:
                    self.counts.messages += 1
                    return [message]
        messages: list[Message] = []
        while self._rest and _is_whole(data):  # so the pending frame won't be completed:
            rest = self._rest  # its datagram was cut short, or bytes were lost
            self.counts.bad += 1
            messages += self._scan(rest[next_of(rest, 1) :])
        messages += self._scan(self._rest + data)
        self.counts.messages += len(messages)
        return messages

    def _scan(self, data: bytes) -> list[Message]:
        at, end, is_lost = 0, len(data), False
        messages: list[Message] = []
        while at < end:
            size = size_of(data, at, end)
            if size < 0:
                break
            message = self._frame(data[at : at + size], data[at + size : at + size + 1])
            if message is None:
                self.counts.bad += not is_lost
                is_lost = True
                at = next_of(data, at + 1)
                continue
            is_lost = False
            at += size
            if message is not _DROPPED:
                messages.append(message)
        self._rest = data[at:]
        return messages

    def _frame(self, frame: bytes, after: bytes) -> Message | None:
        """Return the message of a frame; `_DROPPED` if it is not for us, None if it is not a valid
        frame."""
        if not frame:
            return None
        number = number_of(frame)
        layout = LAYOUTS.get(number)
        if layout is None:  # no checksum to compare: a frame must follow instead
            if after and after[0] not in {START_V1, START_V2}:
                return None
            self.counts.unknown += 1
            return _DROPPED
        body = _body(frame)
        if not layout.fits(frame, body):
            return None
        head, sender = _SECOND_HEAD, (frame[5], frame[6], frame[4])
        if frame[0] == START_V1:
            head, sender = _FIRST_HEAD, (frame[3], frame[4], frame[2])
        system, component, _ = sender
        if not self._is_accepted(frame, system, component):
            self.counts.refused += 1
            return _DROPPED
        if self._wanted and number not in self._wanted:
            self._unread[system, number] += 1
            return _DROPPED
        return layout.message(frame, head, body, sender)

    def _is_accepted(self, frame: bytes, system: int, component: int) -> bool:
        """Return whether the frame's signature is acceptable."""
        if self._signing is None:
            self.counts.signed += is_signed(frame)
            return True
        if not is_signed(frame):
            return False
        if self._signing.accepts(frame, system, component):
            return True
        if self._signing.knows(frame):
            self.counts.stale += 1
            self.stale.add((system, component))
        return False


def _is_whole(data: bytes) -> bool:
    """Return whether the bytes begin with a valid frame."""
    size = size_of(data, 0, len(data)) if data else 0
    layout = LAYOUTS.get(number_of(data[:size])) if size > 0 else None
    return layout is not None and layout.fits(data[:size], _body(data[:size]))


class Packer:
    """Packs frames for one receiver, with a sequence number for each of our components."""

    def __init__(self, system: int, signing: Signing | None = None, link: int = 0) -> None:
        self._system, self._signing, self._link = system, signing, link
        self._sequences: dict[int, int] = {}

    def pack(self, message: Message, component: int = ONBOARD) -> bytes:
        """Return the frame of a message. Raises DriverError if a value doesn't fit its field."""
        layout = LAYOUTS[message.get_msgId()]  # some messages have a field `id`
        sequence = self._sequences.get(component, 0)
        sender = self._system, component
        if self._signing is None:
            frame = layout.frame(message, sequence, sender, 0)
        else:
            frame = layout.frame(message, sequence, sender, SIGNED_FLAG)
            frame += self._signing.signature(frame, self._link)
        self._sequences[component] = (sequence + 1) % 256
        return frame
