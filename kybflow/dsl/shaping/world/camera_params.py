"""What an airframe says of a camera, and where that looks."""

from __future__ import annotations

from math import pi
from typing import Literal

from kybflow.core.files import File
from kybflow.core.geometry import Quat, from_axes
from kybflow.core.params import declared, param
from kybflow.core.units import Angle, Duration, Frequency, Position
from kybflow.dsl.shaping.world.calibration import read_calibration
from kybflow.world.cameras import DOWN

Facing = Literal["down", "up", "forward", "backward", "left", "right"]
_DOWNWARD = (0.0, 0.0, -1.0)
FACING: dict[str, Quat] = {
    "down": DOWN,
    "up": from_axes((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "forward": from_axes((0.0, -1.0, 0.0), _DOWNWARD, (1.0, 0.0, 0.0)),
    "backward": from_axes((0.0, 1.0, 0.0), _DOWNWARD, (-1.0, 0.0, 0.0)),
    "left": from_axes((1.0, 0.0, 0.0), _DOWNWARD, (0.0, 1.0, 0.0)),
    "right": from_axes((-1.0, 0.0, 0.0), _DOWNWARD, (0.0, -1.0, 0.0)),
}
"""Optical frame to body. Down and up have the image's upper edge forward, the others up."""
_TRIM = "Turned from there about the body's {} axis, right-handed; roll first, then pitch, yaw."


@declared
class CameraParams:
    at: Position = param("Where its lens is, body frame (x forward, y left, z up).")
    facing: Facing = param(
        "Where it looks; `down` and `up` have the image's upper edge forward.", default="down"
    )
    roll: Angle = param(_TRIM.format("x"), default=0.0)
    pitch: Angle = param(_TRIM.format("y"), default=0.0)
    yaw: Angle = param(_TRIM.format("z"), default=0.0)
    width: int | None = param(
        "Width of its image, pixels.", default=None, at_least=16, at_most=8192
    )
    height: int | None = param(
        "Height of its image, pixels.", default=None, at_least=16, at_most=8192
    )
    field_of_view: Angle | None = param(
        "From the image's left edge to its right one; the lens has no distortion.",
        default=None, above=0.0, below=0.95 * pi,
    )  # fmt: skip
    calibration: File | None = param(
        "Calibration file of ROS or OpenCV, in place of width, height and field_of_view.",
        default=None, reads=read_calibration,
    )  # fmt: skip
    rate: Frequency = param("Frames a second.", default=30.0, above=0.0, at_most=1000.0)
    row_time: Duration = param(
        "From the start of a row's exposure to the next row's (rolling shutter); zero is a global "
        "shutter.",
        default=0.0, at_least=0.0, at_most=1e-3,
    )  # fmt: skip
