"""The vehicle's mass changes in flight, because it picks something up or drops it.

The new mass is factor x the body's mass + added, at the centre of mass; the moments of inertia
change by the same factor as the mass. The controller does not know the change.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.units import Mass, Ratio
from kybflow.parts import Effect, Fault, param, params


@params
class MassChangeParams:
    factor: Ratio = param(
        "Share of the vehicle's own mass; below 100 % the vehicle is lighter.",
        default=1.0, at_least=0.2, at_most=5.0, read_only=True,
    )  # fmt: skip
    added: Mass = param("Additional mass.", default=0.0, at_least=0.0, read_only=True)


class MassChange(Fault[MassChangeParams]):
    @classmethod
    def is_nothing(cls, params: MassChangeParams) -> bool:
        return params.factor == 1.0 and params.added == 0.0

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(mass=self.params.factor, payload=self.params.added)}
