"""A steady force pushes the vehicle, as a tether, a cable or a hand does.

The force is acceleration x the body's mass without its payload. It acts at the centre of mass, at
once and in full. An accelerometer measures it, unlike a change of the mass.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.units import Accelerations
from kybflow.parts import Effect, Fault, param, params


@params
class PushParams:
    acceleration: Accelerations = param("Force over mass, world frame.", read_only=True)


class Push(Fault[PushParams]):
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(push=self.params.acceleration)}
