"""The cameras of the vehicle give no frames any more.

As with a cable that has come loose. Other measurements arrive as ever.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Frame, Measurement
from kybflow.parts import Effect, Fault, params


@params
class CameraLostParams:
    pass


class CameraLost(Fault[CameraLostParams]):
    spoils = Frame
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(filter=_lose)}


def _lose(measurement: Measurement) -> Measurement | None:
    return None if isinstance(measurement, Frame) else measurement
