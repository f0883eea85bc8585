"""The parameters of all trackers for an on-board attitude loop. They are not in `steering`, which
may be compiled, because the types of compiled classes can't be read."""

from __future__ import annotations

from kybflow.core.params import param, params
from kybflow.core.units import Acceleration, Angle, Damping, Length, Ratio


@params
class SteeringParams:
    """The parameters of every tracker for an on-board attitude loop, beside the gains of its
    law."""

    integral_limit: Acceleration = param(
        "Limit of the integral term along each axis.", default=1.0, at_least=0
    )
    tilt: Angle = param(
        "Largest tilt, within the airframe's own limit.", default=0.349, above=0, below=1.3
    )
    mass_guess: Ratio = param(
        "Initial estimate of the mass divided by the airframe's.",
        default=0.8, at_least=0.5, at_most=2.0, read_only=True,
    )  # fmt: skip
    trim: Damping = param(
        "Rate at which the on-board attitude's error is estimated.",
        default=2.0, at_least=0.0, at_most=4.0,
    )  # fmt: skip
    lift_off: Length = param(
        "Height above the ground from which the vehicle counts as flying.", default=0.02, at_least=0
    )
