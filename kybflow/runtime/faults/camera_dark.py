"""No light falls into the vehicle's cameras: their frames are dark.

This simulates a blackout, or something that sticks to the lens. Frames still arrive, but show only
the sensor's noise.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Frame
from kybflow.parts import Effect, Fault, params
from kybflow.world.cameras import Weakness


@params
class CameraDarkParams:
    pass


class CameraDark(Fault[CameraDarkParams]):
    spoils = Frame
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(camera=Weakness(dark=True))}
