"""The configuration that the drone sends over TCP, lines of `section:key = value` and a zero byte;
and the ids of applications and users."""

from __future__ import annotations

from collections.abc import Mapping
from zlib import crc32

END = b"\0"
MOST = 1 << 16
"""Largest size of a configuration, bytes; a real one has about 5,000."""


def read_configuration(data: bytes) -> dict[str, str]:
    """Return the values by `section:key`; malformed lines are skipped."""
    values = {}
    for line in data.partition(END)[0].decode("utf-8", "replace").splitlines():
        key, equals, value = line.partition("=")
        if equals and ":" in key:
            values[key.strip()] = value.strip()
    return values


def write_configuration(values: Mapping[str, str]) -> bytes:
    lines = "".join(f"{key} = {value}\n" for key, value in values.items())
    return lines.encode("utf-8") + END


def identity(words: str) -> str:
    """Return the id of an application or a user: CRC-32 of its name, 8 hexadecimal digits."""
    return f"{crc32(words.encode('utf-8')):08x}"


def agrees(asked: str, found: str) -> bool:
    """Return whether the value found matches the one written, although the drone formats numbers
    and booleans differently."""
    if asked.strip().upper() == found.strip().upper():
        return True
    try:
        one, other = float(asked), float(found)
    except ValueError:
        return False
    return abs(one - other) <= 1e-3 * max(abs(one), abs(other), 1e-3)
