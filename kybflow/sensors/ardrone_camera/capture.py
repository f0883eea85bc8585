"""The video of one drone: bytes over TCP, cut into frames, decoded by PyAV, its only user."""

from __future__ import annotations

import os
import socket
from collections import deque
from typing import Any

import av

from kybflow.core.errors import DriverError
from kybflow.sensors.ardrone_camera.pave import H264, FrameCutter, VideoFrame

PORT = 5555
PATIENCE = 2.0
"""Seconds without a byte after which the stream is lost."""
CHUNK = 1 << 16


class FrameDecoder:
    """Decodes the frames of one stream, from the first key frame on. `broken`: how many could not
    be decoded."""

    def __init__(self) -> None:
        self._codec: Any = av.CodecContext.create("h264", "r")
        self._began = False
        self.broken = 0

    def decode(self, frame: VideoFrame) -> list[Any]:
        """The grey images that are whole with this frame, (height, width) uint8."""
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


class VideoCapture:
    """What `kybflow.sensors.camera.Grabber` reads. Raises DriverError where nobody answers."""

    def __init__(self, host: str) -> None:
        try:
            self._socket = socket.create_connection((host, PORT), PATIENCE)
        except OSError as error:
            words = os.strerror(error.errno).lower() if error.errno else str(error)
            raise DriverError(f"no video from the drone at {host}: {words}") from None
        self._cutter, self._decoder = FrameCutter(), FrameDecoder()
        self._images: deque[Any] = deque()

    def read(self) -> tuple[bool, Any]:
        """The next image; false where the stream has ended."""
        while not self._images:
            try:
                data = self._socket.recv(CHUNK)
            except OSError:
                return False, None
            if not data:
                return False, None
            for frame in self._cutter.take(data):
                self._images.extend(self._decoder.decode(frame))
        return True, self._images.popleft()

    def release(self) -> None:
        self._socket.close()
