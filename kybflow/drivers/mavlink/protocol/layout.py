"""How a MAVLink frame is built, and how the fields of a message lie in it.

What pymavlink offers for this is not used: it takes twice as long, leaves out good frames after a
bad byte, and can be told by an environment variable to ignore checksums. Its message classes are,
with the layout that they carry.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any

from kybflow.core.errors import DriverError
from kybflow.drivers.mavlink.protocol.signing import SIGNATURE

try:
    from pymavlink.dialects.v20 import all as mavlink
except ImportError as missing:
    raise DriverError("MAVLink needs pymavlink: pip install 'kybflow[mavlink]'") from missing

Message = Any
"""A message object of pymavlink: `get_type()`, `get_srcSystem()`, `get_srcComponent()`, its
fields."""
FIRST = 0xFE
SECOND = 0xFD
"""What a frame of version 1 and of version 2 begins with."""
SIGNED = 1
"""The one flag that is known of those without which a frame can't be understood."""
_MARKER = re.compile(b"[\xfd\xfe]")
_HEADER = struct.Struct("<BBBBBBBHB")
_FIRST_HEAD, _SECOND_HEAD, _CHECKSUM = 6, 10, 2


def size_of(data: bytes, at: int, end: int) -> int:
    """Bytes of the frame that begins there, 0 where none does, -1 where its end has not come."""
    if data[at] == SECOND:
        if end - at < 3:
            return -1
        flags = data[at + 2]
        if flags & ~SIGNED:
            return 0  # what we can't know the meaning of is to be dropped
        size = _SECOND_HEAD + data[at + 1] + _CHECKSUM + (SIGNATURE if flags else 0)
    elif data[at] == FIRST:
        if end - at < 2:
            return -1
        size = _FIRST_HEAD + data[at + 1] + _CHECKSUM
    else:
        return 0
    return size if size <= end - at else -1


def _body(frame: bytes) -> int:
    """Where the payload of a whole frame ends."""
    if frame[2] == SIGNED and frame[0] == SECOND:
        return len(frame) - _CHECKSUM - SIGNATURE
    return len(frame) - _CHECKSUM


def is_signed(frame: bytes) -> bool:
    return frame[0] == SECOND and frame[2] == SIGNED


def number_of(frame: bytes) -> int:
    """Which message it is."""
    return frame[5] if frame[0] == FIRST else frame[7] | frame[8] << 8 | frame[9] << 16


def next_of(data: bytes, at: int) -> int:
    """Where the next frame may begin."""
    found = _MARKER.search(data, at)
    return len(data) if found is None else found.start()


class Layout:
    """How the fields of one kind of message lie in its payload."""

    def __init__(self, made: Any) -> None:
        self.made, self.id = made, made.id
        self.size, self._unpack = made.unpacker.size, made.unpacker.unpack
        self._pack = made.unpacker.pack
        self.extra = bytes((made.crc_extra,))
        self._is_plain = not any(made.array_lengths)
        self._has_texts = "s" in str(made.unpacker.format)
        starts = [sum(made.lengths[:place]) for place in range(len(made.lengths))]
        self._spans = [(starts[place], made.lengths[place]) for place in made.orders]
        self._order: list[int] = list(made.orders)
        self._is_ordered = self._order == sorted(self._order)
        self._arrays = dict(zip(made.ordered_fieldnames, made.array_lengths, strict=True))
        self._fields: Callable[[Message], Sequence[Any]] | None = None

    def fits(self, frame: bytes) -> bool:
        """Whether its checksum is right."""
        body = _body(frame)
        return _checksum(frame[1:body] + self.extra) == frame[body] | frame[body + 1] << 8

    def message(self, frame: bytes) -> Message:
        """Raises where a field can't be what it says, as a text that is none."""
        payload = frame[_FIRST_HEAD if frame[0] == FIRST else _SECOND_HEAD : _body(frame)]
        values = self._unpack(payload[: self.size].ljust(self.size, b"\0"))
        if self._is_plain:
            return self.made(*(values if self._is_ordered else [values[p] for p in self._order]))
        if self._has_texts:
            return self.made(*[_value(values, start, count) for start, count in self._spans])
        return self.made(
            *[
                values[start] if count == 1 else list(values[start : start + count])
                for start, count in self._spans
            ]
        )

    def frame(self, message: Message, sequence: int, sender: tuple[int, int], flags: int) -> bytes:
        """A frame of version 2, without a signature. Raises DriverError where a field does not
        fit."""
        payload = self._payload(message)
        head = _HEADER.pack(
            SECOND, len(payload), flags, 0, sequence, *sender, self.id & 0xFFFF, self.id >> 16
        )
        data = head + payload
        return data + _checksum(data[1:] + self.extra).to_bytes(_CHECKSUM, "little")

    def _payload(self, message: Message) -> bytes:
        if self._fields is None:
            self._fields = _reader([_stored(message, *field) for field in self._arrays.items()])
        try:
            packed: bytes = self._pack(*self._fields(message))
        except (struct.error, OverflowError, TypeError) as error:
            raise DriverError(f"a {message.get_type()} can't be sent: {error}") from error
        return packed.rstrip(b"\0") or b"\0"


def _value(values: tuple[Any, ...], start: int, count: int) -> Any:
    value = values[start]
    if isinstance(value, bytes):
        return value.rstrip(b"\0")
    return value if count == 1 else list(values[start : start + count])


def _stored(message: Message, name: str, count: int) -> tuple[str, bool]:
    """The attribute that holds a field, and whether it is an array of numbers."""
    raw = f"_{name}_raw"  # the bytes of a text
    return (raw, False) if hasattr(message, raw) else (name, count > 0)


def _reader(fields: list[tuple[str, bool]]) -> Callable[[Message], Sequence[Any]]:
    """What reads the values of these attributes, one after another, arrays as their elements."""
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


def _slow_checksum(data: bytes) -> int:
    return int(mavlink.x25crc(data).crc)


_checksum: Callable[[bytes], int] = getattr(mavlink, "mcrf4xx", None) or _slow_checksum
"""CRC-16/MCRF4XX."""
LAYOUTS: dict[int, Layout] = {number: Layout(made) for number, made in mavlink.mavlink_map.items()}
NUMBERS: dict[str, int] = {layout.made.msgname: number for number, layout in LAYOUTS.items()}
