"""One rotor gives less thrust than commanded.

This simulates a chipped blade or a worn motor: the rotor's thrust, drag torque and largest thrust
are reduced to the fraction `left`. The controller does not know the change.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from kybflow.core.units import Ratio
from kybflow.parts import Effect, Fault, param, params

_ROTORS = ("front_left", "rear_left", "rear_right", "front_right")


@params
class RotorWeakParams:
    rotor: Literal["front_left", "rear_left", "rear_right", "front_right"] = param(
        "Which one.", default="front_left", read_only=True
    )
    left: Ratio = param(
        "Remaining share of the rotor's thrust.",
        default=0.85,
        at_least=0.0,
        at_most=1.0,
        read_only=True,
    )


class RotorWeak(Fault[RotorWeakParams]):
    @classmethod
    def is_nothing(cls, params: RotorWeakParams) -> bool:
        return params.left == 1.0

    def effects(self, vehicle: str) -> Mapping[str, Effect]:
        a, b, c, d = (self.params.left if r == self.params.rotor else 1.0 for r in _ROTORS)
        return {vehicle: Effect(rotors=(a, b, c, d))}
