"""The datagram of navigation data, little-endian and packed.

It consists of u32 header 0x55667788, u32 state mask, u32 sequence and u32 vision flag; then options
of u16 tag, u16 size (including these four bytes) and data; finally the option 0xFFFF with the sum
of all bytes before it. The parser relies on the sizes in the datagram, since those in the SDK's
headers don't hold for every firmware.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from kybflow.drivers.ardrone.protocol.navdata.state import DroneState

HEADER = 0x55667788
CHECKSUM = 0xFFFF
_HEAD, _OPTION, _SUM = struct.Struct("<IIII"), struct.Struct("<HH"), struct.Struct("<I")
SHORTEST = _HEAD.size + _OPTION.size + _SUM.size


class Packet(NamedTuple):
    """One parsed datagram. options: the data of each option by its tag."""

    state: DroneState
    sequence: int
    vision: int
    options: Mapping[int, bytes]


class Malformed(ValueError):
    """The datagram is not navigation data; the message gives the reason."""


def read_packet(data: bytes) -> Packet:
    """Return the parsed datagram. Raises Malformed."""
    if len(data) < SHORTEST:
        raise Malformed("too short")
    header, state, sequence, vision = _HEAD.unpack_from(data)
    if header != HEADER:
        raise Malformed("another header")
    options: dict[int, bytes] = {}
    at = _HEAD.size
    while at + _OPTION.size <= len(data):
        tag, size = _OPTION.unpack_from(data, at)
        if size < _OPTION.size or at + size > len(data):
            raise Malformed("an option that ends beyond it")
        if tag == CHECKSUM:
            if size != _OPTION.size + _SUM.size:
                raise Malformed("a checksum of another size")
            if _SUM.unpack_from(data, at + _OPTION.size)[0] != sum(data[:at]):
                raise Malformed("a wrong checksum")
            return Packet(DroneState(state), sequence, vision, options)
        options[tag] = data[at + _OPTION.size : at + size]
        at += size
    raise Malformed("no checksum")


def write_packet(
    state: DroneState, sequence: int, options: Iterable[tuple[int, bytes]] = (), vision: int = 0
) -> bytes:
    data = _HEAD.pack(HEADER, int(state), sequence & 0xFFFF_FFFF, vision)
    for tag, content in options:
        data += _OPTION.pack(tag, _OPTION.size + len(content)) + content
    return data + _OPTION.pack(CHECKSUM, _OPTION.size + _SUM.size) + _SUM.pack(sum(data))
