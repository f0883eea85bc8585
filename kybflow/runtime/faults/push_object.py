"""A force and a torque push an object of the world, as a person's hand does.

The force acts at the object's centre of mass, the torque about the vertical through it, both at
once and in full; what the object's joint doesn't allow its stops and bearings carry. `on` names the
vehicle whose work is disturbed. World frame.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.geometry import ZERO
from kybflow.core.units import Forces, Torque
from kybflow.parts import Effect, Fault, param, params


@params
class PushObjectParams:
    object: str = param("The object that is pushed.", names="object", read_only=True)
    force: Forces = param("Force, world frame.", default=ZERO, read_only=True)
    torque: Torque = param("Torque about the vertical.", default=0.0, read_only=True)


class PushObject(Fault[PushObjectParams]):
    @classmethod
    def is_nothing(cls, params: PushObjectParams) -> bool:
        return not any(params.force) and params.torque == 0.0

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        p = self.params
        return {p.object: Effect(force=p.force, torque=p.torque)}
