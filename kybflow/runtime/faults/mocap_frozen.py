"""Motion capture delivers the same pose of the vehicle over and over, with new time stamps.

This simulates a server that continues to send the last pose of a body that it has lost. Other
measurements still arrive.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from kybflow.core.signals import Measurement, Pose
from kybflow.parts import Effect, Fault, params

if TYPE_CHECKING:
    import random


@params
class MocapFrozenParams:
    pass


class MocapFrozen(Fault[MocapFrozenParams]):
    spoils = Pose
    ours = True

    def __init__(self, params: MocapFrozenParams, generator: random.Random) -> None:
        super().__init__(params, generator)
        self._kept: Pose | None = None

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(filter=self._keep, repeats=True)}

    def _keep(self, measurement: Measurement) -> Measurement | None:
        if not isinstance(measurement, Pose):
            return measurement
        self._kept = self._kept or measurement
        return self._kept._replace(time=measurement.time)
