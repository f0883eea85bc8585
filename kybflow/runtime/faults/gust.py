"""A gust blows against the vehicle, in addition to any other wind.

Its speed rises smoothly within `rise`, stays constant, and is gone when the fault ends. Wind acts
on a vehicle as drag in the plane of its rotors.
"""

from __future__ import annotations

from collections.abc import Mapping

from kybflow.core.units import Duration, Velocity
from kybflow.flight.motion import rising
from kybflow.parts import Effect, Fault, param, params


@params
class GustParams:
    velocity: Velocity = param("Velocity of the air, world frame.", read_only=True)
    rise: Duration = param(
        "Time until the gust reaches its full velocity.",
        default=0.2,
        at_least=0.0,
        at_most=60.0,
        read_only=True,
    )


class Gust(Fault[GustParams]):
    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        return {vehicle: Effect(wind=rising(self.params.velocity, self.params.rise))}
