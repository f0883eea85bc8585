"""Conversion of camera images to grey."""

from __future__ import annotations

from typing import Any

import cv2
from numpy.typing import NDArray

from kybflow.core.errors import DriverError
from kybflow.world.cameras import Camera


def grey(image: NDArray[Any], camera: Camera) -> NDArray[Any]:
    """Convert a colour or grey image to grey. Raises DriverError if its size is not that of the
    camera's lens."""
    (height, width), lens = image.shape[:2], camera.lens
    if (width, height) != (lens.width, lens.height):
        message = f"the frames are {width} x {height}, but the lens of `{camera.name}` is described"
        raise DriverError(f"{message} for {lens.width} x {lens.height}")
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
