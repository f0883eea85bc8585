"""Detection of tags in a whole image, without a prediction or with an inaccurate one.

`Detector` works without a prediction. It uses OpenCV's detector in its quick form (ArUco 3;
Romero-Ramirez, Munoz-Salinas and Medina-Carnicer, "Speeded up detection of squared fiducial
markers", 2018), which takes a third of the time, and in its thorough form after every other miss.
The corners are accurate to a pixel, enough to start `kybflow.vision.locating.search`.

`WideSearch` works with a pose that is some centimetres or degrees off. It compares a few tags,
spread over the image, with the image at all positions around their prediction, half a cell apart,
by the correlation coefficient of pattern and grey levels at the cells' centres. If the best
correlation of a tag is high enough, its position gives the tag's corners to half a cell.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.vision.families import dictionary
from kybflow.vision.locating.search import Shapes
from kybflow.vision.locating.sight import Start, TagView
from kybflow.vision.projection import project
from kybflow.world.cameras import Camera
from kybflow.world.tags import Tag


class DetectedTag(NamedTuple):
    """A detected tag. corners: (4, 2) pixels, in the order of `Tag.corners`."""

    family: str
    id: int
    corners: NDArray[Any]


class Detector:
    """Finds tags of given families in whole images."""

    def __init__(self, families: Sequence[str]) -> None:
        self._quick, self._thorough = (
            [(family, _detector(family, quick)) for family in families] for quick in (True, False)
        )
        self._misses = 0

    def find(self, image: NDArray[Any]) -> list[DetectedTag]:
        """Return the tags in a grey image, (height, width) uint8."""
        detectors = self._thorough if self._misses % 2 else self._quick
        found = [tag for family, detector in detectors for tag in _found(image, family, detector)]
        self._misses = 0 if found else self._misses + 1
        return found


def _detector(family: str, quick: bool) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.useAruco3Detection = quick
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.ArucoDetector(dictionary(family), parameters)


def _found(image: NDArray[Any], family: str, detector: Any) -> list[DetectedTag]:
    quads, numbers, _ = detector.detectMarkers(image)
    if numbers is None:
        return []
    return [
        DetectedTag(family, int(number), quad.reshape(4, 2).astype(float))
        for quad, number in zip(quads, numbers.ravel(), strict=True)
    ]


Array = NDArray[Any]

_TAGS = 9
_ALIKE = 0.6
_STRIDE = 0.4
"""Distance between the positions compared, cells."""
_PLACES = 20
"""Largest number of positions compared to either side of the prediction."""


class WideSearch:
    """Searches for tags near an inaccurate prediction."""

    def __init__(self, shapes: Shapes) -> None:
        self._shapes = shapes

    def find(
        self, image: Array, camera: Camera, pose: Start, tags: Iterable[Tag], off: float
    ) -> TagView:
        """Return some of `tags` in a grey image with approximate corners, seen from a body near
        `pose`. off: largest error of the prediction, pixels."""
        chosen, shapes = self._shapes.in_view(camera, pose, tags)
        found, corners = [], []
        spread = numpy.linspace(0, len(chosen) - 1, min(len(chosen), _TAGS))
        for i in sorted({round(i) for i in spread}):
            tag, shape = chosen[i], shapes[i]
            outline = project(camera, *pose, shape.sides[:, 0])[0]
            size = float(numpy.linalg.norm(outline - numpy.roll(outline, 1, axis=0), axis=1).min())
            stride = max(1.0, _STRIDE * size / shape.size, off / _PLACES)
            pixels = project(camera, *pose, shape.cells)[0]
            shift, alike = _best(image, pixels, shape.bits, off, stride)
            if alike >= _ALIKE:
                found.append(tag)
                corners.append(outline + shift)
        return TagView(camera, found, numpy.array(corners).reshape(-1, 4, 2))


def _best(
    image: Array, pixels: Array, bits: Array, off: float, stride: float
) -> tuple[Array, float]:
    """Return the shift of `pixels` at which the grey levels correlate best with `bits`, (2,)
    pixels, and that correlation."""
    count = int(numpy.ceil(off / stride))
    steps = numpy.arange(-count, count + 1) * stride
    dy, dx = (grid.ravel() for grid in numpy.meshgrid(steps, steps, indexing="ij"))
    x = (pixels[:, :1] + dx).astype(numpy.float32)
    y = (pixels[:, 1:] + dy).astype(numpy.float32)
    levels = cv2.remap(image, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    levels = levels.astype(numpy.float32)
    levels -= levels.mean(axis=0)
    both = bits.astype(numpy.float32) @ levels
    alone = numpy.einsum("ij,ij->j", levels, levels) * float(bits @ bits)
    alike = both / numpy.sqrt(numpy.maximum(alone, 1e-9))
    best = int(alike.argmax())
    return numpy.array((dx[best], dy[best])), float(alike[best])
