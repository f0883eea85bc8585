"""The messages that a vehicle publishes to its neighbours are lost; it still receives theirs.

This simulates a radio between vehicles that hangs. The vehicle's own link, estimate and behavior
are not affected.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.parts import Effect, Fault, params


@params
class NeighboursLostParams:
    pass


class NeighboursLost(Fault[NeighboursLostParams]):
    ours = True

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(silent=True)}
