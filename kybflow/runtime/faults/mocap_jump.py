"""The vehicle's positions from motion capture are displaced by a vector.

This simulates a new origin, or other markers that are mistaken for those of the body. The attitude
stays correct.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.geometry import add
from kybflow.core.signals import Measurement, Pose
from kybflow.core.units import Position
from kybflow.parts import Effect, Fault, param, params


@params
class MocapJumpParams:
    offset: Position = param(
        "Added to the position, world frame.", default=(1.0, 0.0, 0.0), read_only=True
    )


class MocapJump(Fault[MocapJumpParams]):
    spoils = Pose
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(filter=self._move)}

    def _move(self, measurement: Measurement) -> Measurement | None:
        if not isinstance(measurement, Pose):
            return measurement
        return measurement._replace(position=add(measurement.position, self.params.offset))
