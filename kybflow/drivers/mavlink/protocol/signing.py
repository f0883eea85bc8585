"""Signatures of MAVLink 2 messages: only senders that have the secret key are accepted, and each
frame only once.

The 13 bytes after the checksum are the link id, the time (48 bits, steps of 10 us since 1 January
2015, UTC), and the first 6 bytes of SHA-256 over the key and all bytes before them. A frame is
refused unless its time is later than the last one of its stream (link id, system, component), or,
in a new stream, no more than a minute before our own time. No message is exempt, not even
RADIO_STATUS.

pymavlink's own check is not used, because it adopts the time of a frame before it has checked the
signature: one forged frame would silence a vehicle.
"""

from __future__ import annotations

import stat
import time
import warnings
from collections.abc import Callable
from hashlib import sha256
from hmac import compare_digest
from pathlib import Path
from string import hexdigits

from kybflow.core.errors import DriverError
from kybflow.core.files import read_all

SIGNATURE_BYTES = 13
"""The size of a signature with its link id and time, bytes."""
STAMP_STEP_NS = 10_000
"""The resolution of the time stamp, nanoseconds."""
EPOCH_NS = 1_420_070_400_000_000_000
"""The start of 2015 in nanoseconds since 1970."""
MINUTE = 60 * 100_000
KEY_BYTES = 32


class Signing:
    """Signs frames to send and checks received ones. read: returns the time in nanoseconds since
    1970."""

    def __init__(self, key: bytes, read: Callable[[], int] = time.time_ns) -> None:
        """Create the signer. Raises DriverError unless the key has 32 bytes."""
        if len(key) != KEY_BYTES:
            raise DriverError(f"the key of signed messages has {len(key)} bytes, not {KEY_BYTES}")
        self._key, self._read = key, read
        self._newest = 0
        self._last: dict[tuple[int, int, int], int] = {}

    def signature(self, frame: bytes, link: int) -> bytes:
        """Return the signature to append to a frame."""
        self._newest = max(self._newest + 1, self._now())
        data = frame + bytes((link,)) + self._newest.to_bytes(6, "little")
        return data[len(frame) :] + sha256(self._key + data).digest()[:6]

    def knows(self, frame: bytes) -> bool:
        """Return whether the signer of a frame has the key, however old the frame is."""
        return compare_digest(sha256(self._key + frame[:-6]).digest()[:6], frame[-6:])

    def accepts(self, frame: bytes, system: int, component: int) -> bool:
        """Return whether a signed frame of that sender is valid and new."""
        if not self.knows(frame):
            return False
        stream = (frame[-13], system, component)
        stamp = int.from_bytes(frame[-12:-6], "little")
        last = self._last.get(stream)
        if stamp <= last if last is not None else stamp + MINUTE < max(self._newest, self._now()):
            return False
        self._last[stream] = stamp
        self._newest = max(self._newest, stamp)
        return True

    def _now(self) -> int:
        return max(0, self._read() - EPOCH_NS) // STAMP_STEP_NS


def read_key(path: Path) -> bytes:
    """Return the key in a file: 32 bytes, 64 hexadecimal digits, or the SHA-256 of a passphrase, as
    in QGroundControl and MAVProxy. Whitespace around a text is ignored. Warns if other users may
    read the file. Raises DriverError."""
    try:
        data, mode = read_all(path), path.stat().st_mode
    except OSError as error:
        raise DriverError(f"no key can be read from `{path}`: {error.strerror}") from error
    if mode & (stat.S_IRGRP | stat.S_IROTH):
        warnings.warn(
            f"others on this machine can read the key in `{path}`: `chmod 600 {path}`", stacklevel=2
        )
    try:
        text = data.decode().strip()
    except UnicodeDecodeError:
        text = "\0"
    if not text.isprintable():  # 32 random bytes practically never are text
        if len(data) != KEY_BYTES:
            raise DriverError(
                f"`{path}` has {len(data)} bytes, which are not text: a key is {KEY_BYTES} bytes,"
                f" {2 * KEY_BYTES} hexadecimal digits or a passphrase"
            )
        return data
    if not text:
        raise DriverError(f"`{path}` is empty: write a passphrase into it")
    if len(text) == 2 * KEY_BYTES and all(character in hexdigits for character in text):
        return bytes.fromhex(text)
    return sha256(text.encode()).digest()
