"""A camera: its lens and its pose on the body.

The optical frame has x to the image's right, y down and z out of the lens (REP 103, suffix
`_optical`). Pixel centres have integer coordinates; (0, 0) is the upper left pixel, as in OpenCV.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import Quat, Vec3

DOWN: Quat = (0.0, 0.7071067811865476, -0.7071067811865476, 0.0)
"""Attitude, optical frame to body, of a camera that looks down, with the image's upper edge
forward."""


LEAST_SIDE = 12.0
"""Side of the smallest tag that can be detected in an image, pixels."""


class Lens(NamedTuple):
    """A calibrated lens, in pixels. distortion: OpenCV's k1, k2, p1, p2, k3."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)


class Camera(NamedTuple):
    """A camera on a vehicle. position: the position of the lens in the body frame (FLU), metres.
    attitude: optical frame to body. rate: frames per second. row_time: seconds from the start of
    one row's exposure to that of the next; zero for a global shutter."""

    name: str
    lens: Lens
    position: Vec3
    attitude: Quat = DOWN
    rate: float = 30.0
    row_time: float = 0.0
