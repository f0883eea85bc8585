"""A camera as a mission says it."""

from __future__ import annotations

from math import degrees

from kybflow.core.geometry import Quat, conjugate, multiply, to_euler
from kybflow.dsl.shaping.cameras import FACING
from kybflow.world.cameras import Camera


def written_camera(camera: Camera, calibration: str) -> str:
    """An entry of `cameras`, to a tenth of a millimetre and a hundredth of a degree, with its lens
    in a file."""
    at = ", ".join(f"{metres:.4f} m" for metres in camera.position)
    facing = max(FACING, key=lambda name: abs(_trim(camera, name)[0]))
    angles = zip(("roll", "pitch", "yaw"), to_euler(_trim(camera, facing)), strict=True)
    turned = "".join(f", {name}: {degrees(angle):.3f} deg" for name, angle in angles)
    more = f", row_time: {camera.row_time:g} s" if camera.row_time else ""
    return (
        f"{camera.name}: {{at: [{at}], facing: {facing}{turned}, calibration: {calibration},"
        f" rate: {camera.rate:g} Hz{more}}}"
    )


def _trim(camera: Camera, facing: str) -> Quat:
    """How the camera is turned from where it faces."""
    return multiply(camera.attitude, conjugate(FACING[facing]))
