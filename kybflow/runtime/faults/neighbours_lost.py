"""What a vehicle publishes to its neighbours is lost; it still receives theirs.

As when its radio to them hangs. Its own link, its estimate and its behavior go on as ever.
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
