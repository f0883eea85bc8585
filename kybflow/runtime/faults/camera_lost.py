"""The vehicle's cameras deliver no more frames.

This simulates a loose cable. Other measurements still arrive.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Frame
from kybflow.parts import Effect, Fault, params


@params
class CameraLostParams:
    pass


class CameraLost(Fault[CameraLostParams]):
    spoils = Frame
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(filter=lambda m: None if isinstance(m, Frame) else m)}
