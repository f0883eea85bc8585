"""Reads a capture device in a thread, and opens it again when it is lost."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from kybflow.core.errors import DriverError
from kybflow.core.signals import Time

AGAIN = 1.0
"""Seconds between two attempts to open a lost device."""
KEPT = 4
"""Frames that are kept while nobody reads."""


class Capture(Protocol):
    """What of OpenCV's VideoCapture is used."""

    def read(self) -> tuple[bool, Any]: ...
    def release(self) -> None: ...


class Captured(NamedTuple):
    """An image, and how long ago it arrived."""

    image: Any
    age: Time


class Grabber:
    """`error` says why nothing comes, None while the device is open. The first opening is made
    here, and raises DriverError."""

    def __init__(self, opened: Callable[[], Capture], again: float = AGAIN) -> None:
        self.error: str | None = None
        self._opened, self._again = opened, again
        self._frames: deque[tuple[Any, Time]] = deque(maxlen=KEPT)
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(opened(),), name="camera", daemon=True
        )
        self._thread.start()

    def taken(self) -> list[Captured]:
        """What arrived since the last call, oldest first."""
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
                capture = self._reopened()
                continue
            try:
                found, image = capture.read()
            except Exception:  # a foreign library's; the device is opened anew
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

    def _reopened(self) -> Capture | None:
        if self._stop.wait(self._again):
            return None
        try:
            return self._opened()
        except DriverError as error:
            self.error = str(error)
            return None
