"""The frames of a recorded walk: a video, or a folder of images ordered by name.

The walk is divided into sections, and the sharpest frame of each section is used. The times of a
video count from its first frame; the time of an image is the number of seconds at the start of its
name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.core.errors import CalibrationFailed
from kybflow.vision.images import grey
from kybflow.world.cameras import Camera

_IMAGES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".webp"})
_SECONDS = re.compile(r"\d+(\.\d+)?")


class WalkFrame(NamedTuple):
    """A grey image, and the time at which it was taken, seconds; NaN if unknown."""

    time: float
    image: NDArray[Any]


class WalkFrames(NamedTuple):
    """The selected frames of a walk, and the number of all its frames."""

    frames: list[WalkFrame]
    total: int


def recorded(path: Path, camera: Camera, most: int) -> WalkFrames:
    """Return the sharpest frames of a video or folder, `most` at most. Raises CalibrationFailed if
    there are none or one can't be read, and DriverError if one doesn't have the camera's size."""
    sharp = [cv2.Laplacian(f.image, cv2.CV_32F).var() for f in _frames(path, camera)]
    if not sharp:
        raise CalibrationFailed(f"`{path}` has no frames")
    stretches = numpy.array_split(numpy.arange(len(sharp)), min(most, len(sharp)))
    best = {int(part[numpy.argmax([sharp[i] for i in part])]) for part in stretches}
    frames = [frame for i, frame in enumerate(_frames(path, camera)) if i in best]
    return WalkFrames(frames, len(sharp))


def _frames(path: Path, camera: Camera) -> Iterator[WalkFrame]:
    images = _images(path) if path.is_dir() else _video(path)
    return (WalkFrame(time, grey(image, camera)) for time, image in images)


def _images(folder: Path) -> Iterator[tuple[float, NDArray[Any]]]:
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in _IMAGES:
            continue
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise CalibrationFailed(f"`{path}` is no image")
        said = _SECONDS.match(path.stem)
        yield float(said[0]) if said else nan, image


def _video(path: Path) -> Iterator[tuple[float, NDArray[Any]]]:
    capture = cv2.VideoCapture(str(path))
    try:
        if not capture.isOpened():
            raise CalibrationFailed(f"`{path}` is no video")
        while True:
            found, image = capture.read()
            if not found:
                return
            yield 1e-3 * capture.get(cv2.CAP_PROP_POS_MSEC), image
    finally:
        capture.release()
