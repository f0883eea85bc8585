"""Camera images: conversion to grey, and marks of detected tags."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import cv2
import numpy
from numpy.typing import NDArray

from kybflow.core.errors import DriverError
from kybflow.vision.locating.locate import TagView
from kybflow.world.cameras import Camera
from kybflow.world.tags import Key

USED, REJECTED = (60, 190, 40), (50, 40, 230)
"""Colours of used and rejected tags: blue, green, red."""
MAX_PICTURE = 800
"""Largest width of a picture, pixels."""
_QUALITY = 80
_LEGIBLE_SIDE = 0.06
"""Shortest side of a tag whose number is drawn, as a fraction of the picture's width."""
_SHIFT = 4
"""Fractional bits of coordinates in OpenCV's drawing functions."""


def marked(image: NDArray[Any], view: TagView | None, used: Collection[Key]) -> bytes:
    """Return a grey image as a JPEG with the outline and number of each tag of `view`: green for
    the tags in `used`, red for the others. The outline of a tag that is partly outside the image
    joins its visible corners."""
    picture = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    height, width = image.shape
    font, thick = cv2.FONT_HERSHEY_SIMPLEX, max(2, width // 250)
    for tag, seen in zip(view.tags, view.corners, strict=True) if view is not None else ():
        colour = USED if tag.key in used else REJECTED
        corners = seen[numpy.isfinite(seen).all(axis=1)]
        fine = numpy.rint(corners * (1 << _SHIFT)).astype(numpy.int32).reshape(-1, 1, 2)
        cv2.polylines(picture, [fine], True, colour, thick, cv2.LINE_AA, _SHIFT)
        side = float(numpy.hypot(*(corners[1:] - corners[:-1]).T).mean())
        if side < _LEGIBLE_SIDE * width:
            continue
        text, scale = str(tag.id), min(width / 700, side / 70)
        (wide, high), _ = cv2.getTextSize(text, font, scale, thick)
        x, y = corners.mean(axis=0).tolist()
        at = (round(x - wide / 2), round(y + high / 2))
        cv2.putText(picture, text, at, font, scale, (255, 255, 255), 2 * thick + 1, cv2.LINE_AA)
        cv2.putText(picture, text, at, font, scale, colour, thick, cv2.LINE_AA)
    if width > MAX_PICTURE:
        size = (MAX_PICTURE, round(height * MAX_PICTURE / width))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return bytes(data.tobytes())


def grey(image: NDArray[Any], camera: Camera) -> NDArray[Any]:
    """Convert a colour or grey image to grey. Raises DriverError if its size is not that of the
    camera's lens."""
    (height, width), lens = image.shape[:2], camera.lens
    if (width, height) != (lens.width, lens.height):
        message = f"the frames are {width} x {height}, but the lens of `{camera.name}` is described"
        raise DriverError(f"{message} for {lens.width} x {lens.height}")
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
