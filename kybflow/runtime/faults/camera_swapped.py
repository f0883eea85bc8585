"""The frames of two vehicles are exchanged: each vehicle receives what the other's cameras see.

This simulates two radio links that are confused. Each camera keeps its own lens, mounting, rate and
latency, so the image is exactly the other vehicle's only if the cameras are alike.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Frame
from kybflow.parts import Effect, Fault, param, params


@params
class CameraSwappedParams:
    other: str = param(
        "The vehicle whose frames the vehicle receives.", names="vehicle", read_only=True
    )


class CameraSwapped(Fault[CameraSwappedParams]):
    spoils = Frame

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        other = self.params.other
        return {vehicle: Effect(view=other), other: Effect(view=vehicle)}
