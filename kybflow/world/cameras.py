"""A camera as data: its lens and its pose on the body, the errors of a calibration, and the optics
and faults of a simulated camera.

The optical frame has x to the image's right, y down and z out of the lens (REP 103, suffix
`_optical`). Pixel centres have integer coordinates; (0, 0) is the upper left pixel, as in OpenCV.
"""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import ZERO, Quat, Vec3
from kybflow.core.params import param, params
from kybflow.core.units import DEG, Angle, Duration, Length, Number, Path, Ratio

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


FULL_SIZE = 0.2
"""The side of a tag with the full errors, metres. The errors of smaller tags, several of which
share a sheet, are proportional to their side."""


@params
class CalibrationErrors:
    """Standard deviations of the zero-mean errors of calibrated cameras, surveyed tags and clocks.

    A simulated camera draws its errors from these distributions, and an estimator that uses tags
    takes them as its uncertainty. The defaults are for a lab that measures with tape and ruler and
    calibrates its lens with a chessboard; `kybflow calibrate` achieves smaller errors.
    """

    focal_error: Ratio = param(
        "Error of the focal length, standard deviation: a lens of 4 mm focused at 40 cm has 1 %"
        " more than at infinity (thin lens, f / d).",
        default=0.01, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    k1_error: Number = param(
        "Error of the lens's first radial term, standard deviation: 0.03 moves the corners of a"
        " 70 deg view by 2 %, as after a calibration without a chessboard in the corners.",
        default=0.03, at_least=0.0, at_most=0.2, read_only=True,
    )  # fmt: skip
    mount_error: Length = param(
        "Error of the lens's position on the body along each axis, standard deviation: a ruler is"
        " within half a centimetre.",
        default=0.003, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    mount_misalignment: Angle = param(
        "Error of the camera's attitude on the body about each axis, standard deviation: a bracket"
        " of 10 cm that is 1 mm askew turns it by 0.6 deg.",
        default=0.5 * DEG, at_least=0.0, at_most=10.0 * DEG, read_only=True,
    )  # fmt: skip
    survey_error: Length = param(
        "Error of the position of a 20 cm tag along x and y, standard deviation: class II tape"
        " measures may be 0.7 mm off at 2 m (directive 2014/32/EU, MI-008); laying and taping add"
        " the rest. The error of a smaller tag is proportional to its side.",
        default=0.005, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    survey_turn: Angle = param(
        "Error of a tag's heading, standard deviation: 1.7 mm over a side of 20 cm.",
        default=0.5 * DEG, at_least=0.0, at_most=10.0 * DEG, read_only=True,
    )  # fmt: skip
    height_error: Length = param(
        "Error of the height of a 20 cm tag, standard deviation, proportional to the side for"
        " smaller tags: finished floors may be 2 mm off the plane over 0.1 m, 4 mm over 1 m (DIN"
        " 18202, table 3, line 3).",
        default=0.002, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    stamp_error: Duration = param(
        "Error of the stamps of frames, standard deviation, constant during a flight. OpenVINS"
        " starts with 10 ms for a camera with an unknown offset; a measured latency leaves less.",
        default=0.003, at_least=0.0, at_most=0.05, read_only=True,
    )  # fmt: skip


def share_of(size: float) -> float:
    """Return the error of a tag of this size relative to that of a full-sized tag."""
    return min(1.0, size / FULL_SIZE)


@params
class Optics:
    """The optics of a simulated camera (exposure, shutter, focus and noise) and the look of the
    floor below it. By default, an inexpensive rolling-shutter camera over a printed floor in a lit
    room."""

    exposure: Duration = param("Exposure time of a row.", default=0.004, at_least=0.0, at_most=0.1)
    row_time: Duration = param(
        "Time between the exposures of successive rows; zero for a global shutter.",
        default=3e-5, at_least=0.0, at_most=1e-3,
    )  # fmt: skip
    brightness: Ratio = param(
        "Grey level of white paper, of the full scale; above 100 % it is overexposed.",
        default=0.8, above=0.0, at_most=4.0,
    )  # fmt: skip
    floor: Ratio = param(
        "Grey level of the bare floor, of the paper's.", default=0.5, at_least=0.0, at_most=1.0
    )
    pattern: Number = param(
        "Standard deviation of the bare floor's pattern, of 255 grey levels of paper.",
        default=5.0, at_least=0.0, at_most=50.0,
    )  # fmt: skip
    read_noise: Number = param(
        "Standard deviation of a black pixel's noise, of 255 grey levels.",
        default=1.5, at_least=0.0, at_most=50.0,
    )  # fmt: skip
    shot_noise: Number = param(
        "Standard deviation of a white pixel's noise from the light itself, of 255 grey levels; its"
        " variance grows with the light.",
        default=3.0, at_least=0.0, at_most=50.0,
    )  # fmt: skip
    blur: Number = param(
        "Standard deviation of the blur of a point in focus, pixels.",
        default=0.5, at_least=0.0, at_most=20.0,
    )  # fmt: skip
    focus: Length = param("Nearest distance that is in focus.", default=0.4, above=0.0)
    aperture: Length = param(
        "Diameter of the aperture, which blurs what is nearer than the focus.",
        default=0.0012, at_least=0.0, at_most=0.05,
    )  # fmt: skip
    covered: Ratio = param(
        "Share of tags that something covers.", default=0.0, at_least=0.0, below=1.0
    )
    missing: Ratio = param(
        "Share of the map's tags that are not on the floor.",
        default=0.0, at_least=0.0, below=1.0,
    )  # fmt: skip
    misplaced: Ratio = param(
        "Share of the tags of each size that are swapped with each other, unlike in the map.",
        default=0.0, at_least=0.0, at_most=1.0,
    )  # fmt: skip
    patches: Path = param("Round patches on the floor: x, y, radius of each.", default=())


class Weakness(NamedTuple):
    """The current faults of a camera, in addition to its optics. covered: additional share of
    covered tags. blur: standard deviation, pixels. dark: no light at all. offset: error of the
    position from which the frame is drawn, world frame, metres."""

    covered: float = 0.0
    blur: float = 0.0
    dark: bool = False
    offset: Vec3 = ZERO


SOUND = Weakness()
