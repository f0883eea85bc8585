"""Tag families and their patterns."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

FAMILIES: dict[str, tuple[str, int]] = {
    "36h11": ("DICT_APRILTAG_36h11", 587),
    "36h10": ("DICT_APRILTAG_36h10", 2320),
    "25h9": ("DICT_APRILTAG_25h9", 35),
    "16h5": ("DICT_APRILTAG_16h5", 30),
    "aruco_4x4": ("DICT_4X4_1000", 1000),
    "aruco_5x5": ("DICT_5X5_1000", 1000),
    "aruco_6x6": ("DICT_6X6_1000", 1000),
    "aruco_7x7": ("DICT_7X7_1000", 1000),
    "aruco_original": ("DICT_ARUCO_ORIGINAL", 1024),
}
"""Each family's OpenCV name and number of tags. Kybflow's names of AprilTag families have no
prefix."""


@functools.cache
def dictionary(family: str) -> Any:
    """Return OpenCV's dictionary of a family."""
    import cv2

    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family][0]))


def cells(family: str) -> int:
    """Return the number of cells along a side of the black square, including its border."""
    return int(dictionary(family).markerSize) + 2


@functools.cache
def pattern(family: str, id: int) -> NDArray[Any]:
    """Return the image of a tag with one pixel per cell, top row first: (cells, cells) uint8, 0 for
    black and 255 for white."""
    import cv2

    image: NDArray[Any] = cv2.aruco.generateImageMarker(dictionary(family), id, cells(family))
    return image
