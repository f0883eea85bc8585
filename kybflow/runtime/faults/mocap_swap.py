"""Motion capture confuses two vehicles: each receives the other's poses.

This simulates a loss of tracking between bodies with similar markers. Each vehicle keeps its own
noise, rate and latency.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.signals import Pose
from kybflow.parts import Effect, Fault, param, params


@params
class MocapSwapParams:
    other: str = param("The vehicle with which it is confused.", names="vehicle", read_only=True)


class MocapSwap(Fault[MocapSwapParams]):
    spoils = Pose

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        other = self.params.other
        return {vehicle: Effect(body=other), other: Effect(body=vehicle)}
