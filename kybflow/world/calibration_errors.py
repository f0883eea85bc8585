"""How far cameras, printed tags and clocks are from what is believed of them.

A simulated camera draws its own from these, and an estimator on tags carries them as its
uncertainty. The figures are those of a lab that measures with tape and ruler and calibrates its
lens with a chessboard; `kybflow calibrate` tells better ones.
"""

from __future__ import annotations

from kybflow.core.params import param, params
from kybflow.core.units import DEG, Angle, Duration, Length, Number, Ratio

FULL_SIZE = 0.2
"""The side of a tag that lies as wrong as is said, metres; a smaller one is on a sheet with others,
and errs as much less as it is smaller."""


@params
class CalibrationErrors:
    """Standard deviations, all zero-mean."""

    focal_error: Ratio = param(
        "Error of the focal length, standard deviation: a lens of 4 mm that is focused at 40 cm has"
        " 1 % more than at infinity (thin lens, f / d).",
        default=0.01, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    k1_error: Number = param(
        "Error of the lens's first radial term, standard deviation: 0.03 moves what is in the"
        " corner of a view of 70 deg by 2 %, which a chessboard that never was there leaves open.",
        default=0.03, at_least=0.0, at_most=0.2, read_only=True,
    )  # fmt: skip
    mount_error: Length = param(
        "Error of the lens's place on the body along each axis, standard deviation: by ruler, to"
        " half a centimetre at most.",
        default=0.003, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    mount_misalignment: Angle = param(
        "Error of the camera's attitude on the body about each axis, standard deviation: a bracket"
        " that is 1 mm askew over 10 cm is 0.6 deg off.",
        default=0.5 * DEG, at_least=0.0, at_most=10.0 * DEG, read_only=True,
    )  # fmt: skip
    survey_error: Length = param(
        "Error of the place of a tag of 20 cm along x and y, standard deviation: tape measures of"
        " class II may be 0.7 mm off at 2 m (directive 2014/32/EU, MI-008); laying and taping add"
        " the rest. A smaller tag errs as much less as it is smaller.",
        default=0.005, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    survey_turn: Angle = param(
        "Error of a tag's heading, standard deviation: 1.7 mm over the side of 20 cm.",
        default=0.5 * DEG, at_least=0.0, at_most=10.0 * DEG, read_only=True,
    )  # fmt: skip
    height_error: Length = param(
        "Error of the height of a tag of 20 cm, standard deviation, smaller as above: finished"
        " floors may be 2 mm off the plane over 0.1 m, 4 mm over 1 m (DIN 18202, table 3, line 3).",
        default=0.002, at_least=0.0, at_most=0.1, read_only=True,
    )  # fmt: skip
    stamp_error: Duration = param(
        "By how much the stamps of frames are off, standard deviation, the same for a whole flight."
        " OpenVINS begins with 10 ms for a camera whose offset nobody measured; a measured latency"
        " leaves less.",
        default=0.003, at_least=0.0, at_most=0.05, read_only=True,
    )  # fmt: skip


def share_of(size: float) -> float:
    """How much of a full-sized tag's error one of this size has."""
    return min(1.0, size / FULL_SIZE)
