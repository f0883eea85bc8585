"""The configuration as the drone sends it over TCP: lines of `section:key = value`, then a zero
byte; and the ids by which it knows sessions, users and applications."""

from __future__ import annotations

from collections.abc import Mapping
from zlib import crc32

END = b"\0"
MOST = 1 << 16
"""Bytes of a configuration; a real one has about 5,000."""


def read_configuration(data: bytes) -> dict[str, str]:
    """The values by `section:key`; lines that are none are left out."""
    values = {}
    for line in data.partition(END)[0].decode("utf-8", "replace").splitlines():
        key, equals, value = line.partition("=")
        if equals and ":" in key:
            values[key.strip()] = value.strip()
    return values


def write_configuration(values: Mapping[str, str]) -> bytes:
    """The file as a drone sends it."""
    lines = "".join(f"{key} = {value}\n" for key, value in values.items())
    return lines.encode("utf-8") + END


def identity(words: str) -> str:
    """The id of an application or a user: CRC-32 of its name, in 8 hexadecimal digits."""
    return f"{crc32(words.encode('utf-8')):08x}"


def agrees(asked: str, found: str) -> bool:
    """Whether a value that is read back is the one that was asked for; the drone writes numbers and
    truths in its own way."""
    if asked.strip().upper() == found.strip().upper():
        return True
    try:
        one, other = float(asked), float(found)
    except ValueError:
        return False
    return abs(one - other) <= 1e-3 * max(abs(one), abs(other), 1e-3)
