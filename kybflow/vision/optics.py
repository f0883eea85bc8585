"""The optics of a simulated camera (exposure, shutter, focus and noise) and the look of the floor
below it."""

from __future__ import annotations

from typing import NamedTuple

from kybflow.core.geometry import ZERO, Vec3
from kybflow.core.params import param, params
from kybflow.core.units import Duration, Length, Number, Path, Ratio


@params
class Optics:
    """An inexpensive rolling-shutter camera over a printed floor in a lit room."""

    exposure: Duration = param("Exposure time of a row.", default=0.004, at_least=0.0, at_most=0.1)
    row_time: Duration = param(
        "From the start of a row's exposure to the next row's; zero is a global shutter.",
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
        "Share of tags that something covers.", default=0.0, at_least=0.0, at_most=1.0
    )
    missing: Ratio = param(
        "Share of the map's tags that are not on the floor.",
        default=0.0, at_least=0.0, at_most=1.0,
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
