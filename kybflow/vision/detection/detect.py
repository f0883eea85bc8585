"""Tags found in a whole image, with nothing known beforehand.

OpenCV's detector, in its quick form (ArUco 3; Romero-Ramirez, Munoz-Salinas and Medina-Carnicer,
"Speeded up detection of squared fiducial markers", 2018), which takes a third of the time; every
other time that it finds nothing, in its thorough one. The corners are good to a pixel, enough for
`kybflow.vision.detection.search` to start from.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
from numpy.typing import NDArray

from kybflow.vision.families import dictionary


class DetectedTag(NamedTuple):
    """A tag in an image. corners: (4, 2) pixels, in the order of `Tag.corners`."""

    family: str
    id: int
    corners: NDArray[Any]


class Detector:
    """Finds the tags of some families."""

    def __init__(self, families: Sequence[str]) -> None:
        self._quick, self._thorough = (
            [(family, _detector(family, quick)) for family in families] for quick in (True, False)
        )
        self._misses = 0

    def find(self, image: NDArray[Any]) -> list[DetectedTag]:
        """The tags in a grey image, (height, width) uint8."""
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
