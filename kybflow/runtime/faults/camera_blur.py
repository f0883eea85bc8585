"""The vehicle's cameras are out of focus: their frames are blurred.

The blur is normally distributed and added to that of the lens: the squares of their standard
deviations add up.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Frame
from kybflow.core.units import Number
from kybflow.parts import Effect, Fault, param, params
from kybflow.world.cameras import Weakness


@params
class CameraBlurParams:
    pixels: Number = param(
        "Standard deviation of the blur, pixels.", default=3.0, above=0.0, at_most=100.0,
        read_only=True,
    )  # fmt: skip


class CameraBlur(Fault[CameraBlurParams]):
    spoils = Frame
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(camera=Weakness(blur=self.params.pixels))}
