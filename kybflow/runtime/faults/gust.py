"""A gust blows against the vehicle, on top of whatever wind there is.

Its speed goes up smoothly within `rise`, stays, and is gone when the fault ends. Wind
acts on a vehicle in the plane of its rotors, as its drag.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.units import Duration, Velocity
from kybflow.flight.motion import rising
from kybflow.parts import Effect, Fault, param, params


@params
class GustParams:
    velocity: Velocity = param("The air's, world frame.", read_only=True)
    rise: Duration = param(
        "Time until it blows fully.", default=0.2, at_least=0.0, at_most=60.0, read_only=True
    )


class Gust(Fault[GustParams]):
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(wind=rising(self.params.velocity, self.params.rise))}
