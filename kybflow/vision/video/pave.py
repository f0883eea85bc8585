"""PaVE: the header before each frame of the AR.Drone's video stream (SDK 2.0,
`video_encapsulation.h`).

The header is little-endian. A field of it gives its length: 64 bytes, or 68 and more in some
firmwares. The payload of codec 4 is H.264. A stream may start anywhere: bytes before the first
header are skipped.
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import NamedTuple

SIGNATURE = b"PaVE"
H264 = 4
_LAYOUT = struct.Struct("<4sBBHIHHHHIIBBB")
MIN_HEADER, LONGEST_HEADER = 64, 1024
MAX_FRAME = 1 << 20
"""Largest plausible frame, bytes."""


class FrameType(IntEnum):
    UNKNOWN = 0
    IDR = 1
    I = 2  # noqa: E741  the codec's name
    P = 3
    HEADERS = 4


class VideoFrame(NamedTuple):
    """One encoded frame. width, height: the size displayed, pixels; the encoded size is a multiple
    of 16. milliseconds: time since the drone's start."""

    codec: int
    width: int
    height: int
    number: int
    milliseconds: int
    kind: int
    payload: bytes

    @property
    def is_key(self) -> bool:
        """Whether decoding can start with this frame."""
        return self.kind in (FrameType.IDR, FrameType.I)


class FrameCutter:
    """Splits a stream into frames. skipped: the number of bytes that belong to no frame."""

    def __init__(self) -> None:
        self._data = bytearray()
        self.skipped = 0

    def take(self, data: bytes) -> list[VideoFrame]:
        """Return the frames that these bytes complete."""
        self._data += data
        frames: list[VideoFrame] = []
        while True:
            at = self._data.find(SIGNATURE)
            drop = at if at >= 0 else max(0, len(self._data) - len(SIGNATURE) + 1)
            self.skipped += drop
            del self._data[:drop]
            if len(self._data) < MIN_HEADER:
                return frames
            frame, size = _frame(self._data)
            if size == 0:
                return frames
            if frame is not None:
                frames.append(frame)
            else:
                self.skipped += size
            del self._data[:size]


def _frame(data: bytearray) -> tuple[VideoFrame | None, int]:
    """Return the frame at the start of `data`, None if it is invalid or incomplete; and the number
    of bytes to consume, 0 if the frame is incomplete."""
    (
        _, _, codec, header, payload, _, _, width, height, number, at, _, _, kind,
    ) = _LAYOUT.unpack_from(data)  # fmt: skip
    if not MIN_HEADER <= header <= LONGEST_HEADER or payload > MAX_FRAME:
        return None, len(SIGNATURE)
    size = header + payload
    if len(data) < size:
        return None, 0
    return VideoFrame(codec, width, height, number, at, kind, bytes(data[header:size])), size


def write_frame(frame: VideoFrame) -> bytes:
    header = _LAYOUT.pack(
        SIGNATURE, 2, frame.codec, MIN_HEADER, len(frame.payload),
        -(-frame.width // 16) * 16, -(-frame.height // 16) * 16, frame.width, frame.height,
        frame.number, frame.milliseconds & 0xFFFF_FFFF, 1, 0, frame.kind,
    )  # fmt: skip
    return header.ljust(MIN_HEADER, b"\0") + frame.payload
