"""What the trackers for an on-board attitude loop have in common, beside their law."""

from __future__ import annotations

from typing import TypeVar

from kybflow.core.signals import CommandKind
from kybflow.core.units import Acceleration, Angle, Damping, Length, Ratio
from kybflow.flight.steering import Steering
from kybflow.parts import Tracker, param, params
from kybflow.world.vehicle_context import VehicleContext


@params
class SteeredParams:
    integral_limit: Acceleration = param(
        "The most that the integral may ask for, along each axis.", default=1.0, at_least=0
    )
    tilt: Angle = param(
        "Largest tilt; the airframe's own bound holds as well.", default=0.349, above=0, below=1.3
    )
    mass_guess: Ratio = param(
        "The mass believed at the start over the airframe's.",
        default=0.8, at_least=0.5, at_most=2.0, read_only=True,
    )  # fmt: skip
    trim: Damping = param(
        "How fast the on-board attitude's error is learnt from the estimate's attitude.",
        default=2.0, at_least=0.0, at_most=4.0,
    )  # fmt: skip
    lift_off: Length = param(
        "Height above the ground from which it flies.", default=0.02, at_least=0
    )


P = TypeVar("P", bound=SteeredParams)


class Steered(Tracker[P]):
    """A tracker whose law gives a specific force, which `Steering` makes a command."""

    gives = CommandKind.ATTITUDE_THRUST

    def __init__(self, params: P, context: VehicleContext) -> None:
        super().__init__(params, context)
        self._drag = context.airframe.drag
        self._steering = Steering(context, params.mass_guess)
        self._integral = (0.0, 0.0)

    @property
    def hover_thrust(self) -> float:
        return self._steering.hover_thrust
