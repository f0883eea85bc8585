"""The errors of calibrated cameras, surveyed tags and clocks.

A simulated camera draws its errors from these distributions, and an estimator that uses tags takes
them as its uncertainty. The defaults are for a lab that measures with tape and ruler and calibrates
its lens with a chessboard; `kybflow calibrate` achieves smaller errors.
"""

from __future__ import annotations

from kybflow.core.params import param, params
from kybflow.core.units import DEG, Angle, Duration, Length, Number, Ratio

FULL_SIZE = 0.2
"""The side of a tag with the full errors, metres. The errors of smaller tags, several of which
share a sheet, are proportional to their side."""


@params
class CalibrationErrors:
    """Standard deviations of zero-mean errors."""

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
