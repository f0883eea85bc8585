"""The battery suddenly has less charge left, as if a cell had failed.

The vehicle reports the lower charge, its voltage drops accordingly, and the rotors' thrust drops
with the square of the voltage.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.units import Ratio
from kybflow.parts import Effect, Fault, param, params


@params
class BatterySagParams:
    by: Ratio = param(
        "Missing share of a full battery's charge.", default=0.3, above=0.0, at_most=1.0,
        read_only=True,
    )  # fmt: skip


class BatterySag(Fault[BatterySagParams]):
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(sag=self.params.by)}
