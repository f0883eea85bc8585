"""The camera of an AR.Drone 2.0, over its network (PaVE with H.264, TCP 5555).

The drone sends one of its two cameras at 640 x 360, which the driver's `video` selects. A thread
decodes frames from the first key frame on. Each frame is stamped `latency` before its arrival. A
lost stream is reopened every second.
"""

from __future__ import annotations

import os
import socket
from collections import deque
from typing import TYPE_CHECKING, Any

from kybflow.core.errors import DriverError
from kybflow.core.params import param, params
from kybflow.core.signals import NS
from kybflow.core.units import Duration
from kybflow.parts import Link
from kybflow.sensors.camera import Device, Grabber, SingleCamera, WhichCamera
from kybflow.vision.video import PYAV, WAY_OUT
from kybflow.vision.video.pave import FrameCutter
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random

    from kybflow.vision.video.codec import FrameDecoder

PORT = 5555
STREAM_TIMEOUT_S = 2.0
"""Seconds without data after which the stream counts as lost."""
CHUNK = 1 << 16


@params
class ArdroneCameraParams(WhichCamera):
    host: str = param("The drone's IPv4 address.", default="192.168.1.1")
    latency: Duration = param(
        "Time from the middle of a frame's exposure to its arrival.",
        default=0.1, at_least=0.0, at_most=1.0,
    )  # fmt: skip


class ArdroneCamera(SingleCamera[ArdroneCameraParams]):
    packages = PYAV

    @classmethod
    def real_time(cls, params: ArdroneCameraParams) -> bool:
        return True

    @classmethod
    def open(
        cls,
        params: ArdroneCameraParams,
        context: VehicleContext,
        link: Link,
        generator: random.Random,
    ) -> Device:
        try:
            from kybflow.vision.video.codec import FrameDecoder
        except ImportError as error:
            raise DriverError(f"an AR.Drone's video needs PyAV ({error}); {WAY_OUT}") from None
        camera = cls.camera_of(params, context)
        host, latency = params.host, round(params.latency * NS)
        return Device(Grabber(lambda: VideoCapture(host, FrameDecoder())), camera, latency)


class VideoCapture:
    """Reads the drone's video for `Grabber`. The constructor raises DriverError if the drone
    doesn't answer."""

    def __init__(self, host: str, decoder: FrameDecoder) -> None:
        try:
            self._socket = socket.create_connection((host, PORT), STREAM_TIMEOUT_S)
        except OSError as error:
            words = os.strerror(error.errno).lower() if error.errno else str(error)
            raise DriverError(f"no video from the drone at {host}: {words}") from None
        self._cutter, self._decoder = FrameCutter(), decoder
        self._images: deque[Any] = deque()

    def read(self) -> tuple[bool, Any]:
        """Return whether there is a next image, and that image; False after the end of the
        stream."""
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
