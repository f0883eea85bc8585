"""The parameters that trackers for an on-board attitude loop share; apart from `steering`, which
may be compiled, because types of compiled classes can't be read."""

from __future__ import annotations

from kybflow.core.params import param, params
from kybflow.core.units import Acceleration, Angle, Damping, Length, Ratio


@params
class SteeringParams:
    """What every tracker for an on-board attitude loop may be told, beside its law's gains."""

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
