"""A steady wind sets in where the vehicle flies, on top of whatever wind there is.

Its speed goes up smoothly within `rise`, then stays as it is; it is gone when the fault
ends. Wind acts on a vehicle in the plane of its rotors, as its drag.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.units import Duration, Velocity
from kybflow.flight.motion import rising
from kybflow.parts import Effect, Fault, param, params


@params
class WindParams:
    velocity: Velocity = param("The air's, world frame.", read_only=True)
    rise: Duration = param(
        "Time until it blows fully.", default=2.0, at_least=0.0, at_most=600.0, read_only=True
    )


class Wind(Fault[WindParams]):
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(wind=rising(self.params.velocity, self.params.rise))}
