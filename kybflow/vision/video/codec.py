"""H.264 decoding and encoding of grey pictures, (height, width) uint8, with PyAV."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import av

from kybflow.vision.video.pave import H264, FrameType, VideoFrame

BLOCK = 16
"""The sides of a coded picture are multiples of this number of pixels."""


class FrameDecoder:
    """Decodes the frames of one stream, from its first key frame on. broken: the number of frames
    that could not be decoded."""

    def __init__(self) -> None:
        self._codec: Any = av.CodecContext.create("h264", "r")
        self._began = False
        self.broken = 0

    def decode(self, frame: VideoFrame) -> list[Any]:
        """Return the pictures that this frame completes."""
        self._began = self._began or frame.is_key
        if not self._began or frame.codec != H264:
            return []
        try:
            pictures = self._codec.decode(av.Packet(frame.payload))
        except av.FFmpegError:
            self.broken += 1
            return []
        cut = slice(frame.height), slice(frame.width)
        return [picture.to_ndarray(format="gray")[cut] for picture in pictures]


class FrameEncoder:
    """Encodes pictures of one size, each as a key frame, so that a viewer may start with any of
    them. rate: Hz."""

    def __init__(self, width: int, height: int, rate: int) -> None:
        self._size = width, height
        codec: Any = av.CodecContext.create("libx264", "w")
        codec.width, codec.height = (-(-side // BLOCK) * BLOCK for side in self._size)
        codec.pix_fmt, codec.time_base = "yuv420p", Fraction(1, rate)
        codec.options = {
            "preset": "ultrafast", "tune": "zerolatency", "profile": "baseline", "g": "1",
        }  # fmt: skip
        self._codec, self._number = codec, 0

    def encode(self, picture: Any, milliseconds: int) -> list[VideoFrame]:
        """Return the encoded frames of a picture, normally one."""
        width, height = self._size
        padded = picture
        if (self._codec.width, self._codec.height) != self._size:
            import numpy

            grown = (self._codec.height - height, self._codec.width - width)
            padded = numpy.pad(picture, ((0, grown[0]), (0, grown[1])), mode="edge")
        coded = av.VideoFrame.from_ndarray(padded, format="gray").reformat(format="yuv420p")
        frames = []
        for packet in self._codec.encode(coded):
            frames.append(
                VideoFrame(
                    H264, width, height, self._number, milliseconds, FrameType.IDR, bytes(packet)
                )
            )
            self._number += 1
        return frames
