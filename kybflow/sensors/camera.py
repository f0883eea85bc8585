"""Frames of a real camera, or of a recorded video (OpenCV's VideoCapture).

A video is read by the times of its frames, counted from the start of the run, so that the same
frames arrive in the same ticks of every run. A thread reads a device; each frame is stamped
`latency` before its arrival. A lost device is reopened every second.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar

from kybflow.core.errors import DriverError
from kybflow.core.files import File, FilePath
from kybflow.core.params import param, params
from kybflow.core.signals import NS, Frame, Measurement, Time
from kybflow.core.text import did_you_mean
from kybflow.core.units import Duration
from kybflow.dsl.calibration_file import read_calibration
from kybflow.parts import Claim, Link, Objection, Sensor, Stream
from kybflow.parts.sensor import frames_of
from kybflow.vision import OPENCV, WAY_OUT
from kybflow.world.cameras import Camera
from kybflow.world.vehicle_context import VehicleContext

if TYPE_CHECKING:
    import random


REOPEN_PERIOD = 1.0
"""Seconds between two attempts to reopen a lost device."""
MOST_FRAMES = 4
"""Largest number of unread frames; older ones are dropped."""


class Capture(Protocol):
    """The methods of OpenCV's VideoCapture that are used."""

    def read(self) -> tuple[bool, Any]: ...
    def release(self) -> None: ...


class Captured(NamedTuple):
    """An image, and the time since its arrival."""

    image: Any
    age: Time


class Grabber:
    """Reads a device in a thread. error: why no frames arrive; None while the device is open. The
    constructor opens the device, and raises DriverError if that fails."""

    def __init__(self, opened: Callable[[], Capture], again: float = REOPEN_PERIOD) -> None:
        self.error: str | None = None
        self._opened, self._again = opened, again
        self._frames: deque[tuple[Any, Time]] = deque(maxlen=MOST_FRAMES)
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(opened(),), name="camera", daemon=True
        )
        self._thread.start()

    def taken(self) -> list[Captured]:
        """Return the images that arrived since the last call, oldest first."""
        frames: list[tuple[Any, Time]] = []
        while self._frames:
            frames.append(self._frames.popleft())
        now = time.monotonic_ns()
        return [Captured(image, now - at) for image, at in frames]

    def close(self) -> None:
        self._stop.set()
        self._thread.join(2.0)

    def _run(self, capture: Capture | None) -> None:
        while not self._stop.is_set():
            if capture is None:
                if self._stop.wait(self._again):
                    return
                try:
                    capture = self._opened()
                except DriverError as error:
                    self.error = str(error)
                continue
            try:
                found, image = capture.read()
            except Exception:  # of a foreign library; the device is reopened
                found, image = False, None
            if found:
                self._frames.append((image, time.monotonic_ns()))
                self.error = None
            else:
                self.error = "the camera was lost"
                capture.release()
                capture = None
        if capture is not None:
            capture.release()


SILENCE_S = 1.0
"""Seconds without a frame after which a device counts as lost."""


@params
class WhichCamera:
    camera: str | None = param(
        "Name of the camera; required if the airframe has several.", default=None
    )
    calibration: File | None = param(
        "Calibration file of this camera, which replaces the airframe's lens.",
        default=None, reads=read_calibration,
    )  # fmt: skip


@params
class CameraSensorParams(WhichCamera):
    device: int = param("Number of the device.", default=0, at_least=0)
    video: FilePath | None = param("File with a recorded video, instead of a device.", default=None)
    latency: Duration = param(
        "Time from the middle of a frame's exposure to its arrival.",
        default=0.03, at_least=0.0, at_most=1.0,
    )  # fmt: skip


WhichParams = TypeVar("WhichParams", bound=WhichCamera)


class SingleCamera(Sensor[WhichParams]):
    """A sensor that delivers the frames of one of the vehicle's cameras."""

    provides = frozenset({Frame})

    @classmethod
    def seen_by(cls, params: WhichParams, cameras: Mapping[str, Camera]) -> Mapping[str, Camera]:
        if params.calibration is None:
            return cameras
        lens, name = read_calibration(params.calibration), _name_of(params, cameras)
        return {n: c._replace(lens=lens) if n == name else c for n, c in cameras.items()}

    @classmethod
    def objection(cls, params: WhichParams, cameras: Mapping[str, Camera]) -> Objection | None:
        known = ", ".join(f"`{name}`" for name in cameras)
        if not cameras or _name_of(params, cameras) in cameras:
            return None
        if params.camera is not None:
            reason = f"the airframe has no camera `{params.camera}`; it has {known}"
            return Objection("camera", reason, did_you_mean(params.camera, cameras))
        reason = f"`camera` is missing; the airframe has {known}"
        return Objection("camera", reason, f"write `camera: {next(iter(cameras))}`")

    @classmethod
    def claims(cls, params: WhichParams, cameras: Mapping[str, Camera]) -> Sequence[str]:
        return frames_of([_name_of(params, cameras)])

    @classmethod
    def camera_of(cls, params: WhichParams, context: VehicleContext) -> Camera:
        """Return the camera whose frames this sensor delivers. Raises DriverError if it is unknown
        or ambiguous."""
        objection = cls.objection(params, context.cameras)
        if objection is not None:
            raise DriverError(objection.reason)
        if not context.cameras:
            raise DriverError(f"the vehicle `{context.vehicle}` has no camera")
        return context.cameras[_name_of(params, context.cameras)]


class CameraSensor(SingleCamera[CameraSensorParams]):
    packages = OPENCV

    @classmethod
    def claim(cls, params: CameraSensorParams, vehicle: str) -> Claim | None:
        return None if params.video is not None else Claim("device", f"the device {params.device}")

    @classmethod
    def real_time(cls, params: CameraSensorParams) -> bool:
        return params.video is None

    @classmethod
    def open(
        cls,
        params: CameraSensorParams,
        context: VehicleContext,
        link: Link,
        generator: random.Random,
    ) -> Video | Device:
        camera, latency = cls.camera_of(params, context), round(params.latency * NS)
        if params.video is None:
            return Device(Grabber(lambda: _device(params.device, camera)), camera, latency)
        if not os.path.isfile(params.video):
            raise DriverError(f"the video `{params.video}` no longer exists")
        return Video(_opened(params.video, f"the video `{params.video}`"), camera, latency)


def _name_of(params: WhichCamera, cameras: Mapping[str, Camera]) -> str:
    """Return the name of the sensor's camera; empty if it is ambiguous."""
    return params.camera or (next(iter(cameras)) if len(cameras) == 1 else "")


def _opened(source: int | str, what: str) -> Any:
    try:
        import cv2
    except ImportError as error:
        raise DriverError(f"a camera needs OpenCV ({error}); {WAY_OUT}") from None
    capture = cv2.VideoCapture(source)
    if not capture.isOpened():
        capture.release()
        raise DriverError(f"{what} can't be opened")
    return capture


def _device(number: int, camera: Camera) -> Any:
    """Return a device, opened with the image size and rate of the airframe's camera."""
    capture = _opened(number, f"the camera {number}")
    import cv2

    capture.set(cv2.CAP_PROP_FRAME_WIDTH, camera.lens.width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, camera.lens.height)
    capture.set(cv2.CAP_PROP_FPS, camera.rate)
    return capture


def frame_of(image: Any, time: Time, camera: Camera) -> Frame:
    """Convert an image from OpenCV to a frame. Raises DriverError if its size is not the
    camera's."""
    from kybflow.vision.images import grey

    return Frame(time, camera.name, grey(image, camera))


class Video(Stream):
    """The frames of a video file. After the last frame, `read` raises DriverError."""

    def __init__(self, capture: Any, camera: Camera, latency: Time) -> None:
        self._capture, self._camera, self._latency = capture, camera, latency
        self._first: float | None = None
        self._next = self._grabbed()

    def read(self, now: Time) -> Sequence[Measurement]:
        arrived: list[Measurement] = []
        while self._next is not None and self._next[0] + self._latency <= now:
            time, image = self._next
            arrived.append(frame_of(image, time, self._camera))
            self._next = self._grabbed()
        if not arrived and self._next is None:
            raise DriverError("the video has ended")
        return arrived

    def close(self) -> None:
        self._capture.release()

    def _grabbed(self) -> tuple[Time, Any] | None:
        """Return the next frame and its time; None after the last."""
        import cv2

        found, image = self._capture.read()
        if not found:
            return None
        at = self._capture.get(cv2.CAP_PROP_POS_MSEC)
        self._first = at if self._first is None else self._first
        return round((at - self._first) * 1e-3 * NS), image


class Device(Stream):
    """The frames of a device, delivered as they arrive."""

    def __init__(self, grabber: Grabber, camera: Camera, latency: Time) -> None:
        self._grabber, self._camera, self._latency = grabber, camera, latency
        self._last_data: Time | None = None

    def read(self, now: Time) -> Sequence[Measurement]:
        self._last_data = now if self._last_data is None else self._last_data
        captured: list[Captured] = self._grabber.taken()
        if captured:
            self._last_data = now
        elif self._grabber.error is not None:
            raise DriverError(self._grabber.error)
        elif now - self._last_data > SILENCE_S * NS:
            raise DriverError(f"no frame for {(now - self._last_data) / NS:.1f} s")
        return [
            frame_of(one.image, now - one.age - self._latency, self._camera) for one in captured
        ]

    def close(self) -> None:
        self._grabber.close()
