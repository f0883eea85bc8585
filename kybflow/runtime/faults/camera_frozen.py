"""The vehicle's cameras deliver the same image over and over, with new time stamps.

This simulates a driver that delivers its last buffer again. Each camera repeats the first image
that arrives after the fault has begun.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from kybflow.core.signals import Frame, Measurement
from kybflow.parts import Effect, Fault, params

if TYPE_CHECKING:
    import random


@params
class CameraFrozenParams:
    pass


class CameraFrozen(Fault[CameraFrozenParams]):
    spoils = Frame
    ours = True

    def __init__(self, params: CameraFrozenParams, generator: random.Random) -> None:
        super().__init__(params, generator)
        self._kept: dict[str, Frame] = {}

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(filter=self._keep, repeats=True)}

    def _keep(self, measurement: Measurement) -> Measurement | None:
        if not isinstance(measurement, Frame):
            return measurement
        kept = self._kept.setdefault(measurement.camera, measurement)
        return kept._replace(time=measurement.time)
