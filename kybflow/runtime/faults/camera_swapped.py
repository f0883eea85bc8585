"""The frames of two vehicles are exchanged: each sees from where the other is.

As when two radio links are taken for each other. Both keep their own lens, mounting, rate and
latency: with alike cameras that is the other's image.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Frame
from kybflow.parts import Effect, Fault, param, params


@params
class CameraSwappedParams:
    other: str = param("The vehicle whose frames it gets.", names="vehicle", read_only=True)


class CameraSwapped(Fault[CameraSwappedParams]):
    spoils = Frame

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        other = self.params.other
        return {vehicle: Effect(view=other), other: Effect(view=vehicle)}
