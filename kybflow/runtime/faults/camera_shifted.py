"""The vehicle's cameras see from a shifted position, so a position measured from tags jumps.

The frames are rendered from a position `offset` away from the true one, as if the floor with its
tags had been moved the other way.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Frame
from kybflow.core.units import Position
from kybflow.parts import Effect, Fault, param, params
from kybflow.world.cameras import Weakness


@params
class CameraShiftedParams:
    offset: Position = param(
        "Displacement of the apparent position, world frame.", default=(1.0, 0.0, 0.0),
        read_only=True,
    )  # fmt: skip


class CameraShifted(Fault[CameraShiftedParams]):
    spoils = Frame
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(camera=Weakness(offset=self.params.offset))}
