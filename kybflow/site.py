"""What a part knows of the place where it works: the world, the airframe, the vehicle's start."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from kybflow.geometry import GRAVITY, Vec3
from kybflow.params import param, params
from kybflow.shapes import Box, Shape
from kybflow.units import Angle, Damping, Duration, Force, Inertias, Length, Mass, Ratio, Speed


@params
class Airframe:
    """A quadrotor as its maker describes it; the simulator may build one that differs, as real ones
    do."""

    mass: Mass = param("Mass, ready to fly.", above=0.0)
    diameter: Length = param("From rotor hub to rotor hub, diagonally.", above=0.0)
    inertia: Inertias = param("Moments of inertia about body x, y, z.")
    thrust: Force = param("Largest thrust of one rotor.", above=0.0)
    torque_ratio: Length = param(
        "Drag torque of a rotor per newton of its thrust.", default=0.016, above=0.0
    )
    rotor_time: Duration = param("Time constant of a rotor's first-order lag.", above=0.0)
    drag: Damping = param(
        "Rotor drag on the body, per unit of mass, in the rotor plane.", default=0.0, at_least=0.0
    )
    tilt: Angle = param(
        "Largest tilt that a tracker may command.", default=0.349, above=0.0, below=1.3
    )
    speed: Speed = param("Largest speed that a mission may ask for.", default=1.0, above=0.0)
    climb: Speed = param(
        "Largest vertical speed that a mission may ask for.", default=1.0, above=0.0
    )
    endurance: Duration = param("Hovering time on a full battery.", default=900.0, above=0.0)
    voltage_spread: Ratio = param(
        "Voltage lost from full to empty.", default=0.2, at_least=0.0, below=0.5
    )

    @property
    def arm(self) -> float:
        """From the centre to a rotor hub, metres."""
        return self.diameter / 2.0

    @property
    def hover_thrust(self) -> float:
        """Newtons that hold the airframe's own weight."""
        return self.mass * GRAVITY

    @property
    def max_thrust(self) -> float:
        """Newtons of all four rotors together."""
        return 4.0 * self.thrust


class Site(NamedTuple):
    """What a vehicle's parts are built with: who it is, what it flies, where, how often.

    home: where `go_home` flies, None for the start. obstacles: the world's, by name. diameters:
    of every vehicle's airframe, by name.
    """

    vehicle: str
    airframe: Airframe
    start: Vec3
    heading: float
    fence: Box | None
    dt: float
    home: Vec3 | None = None
    obstacles: Mapping[str, Shape] = MappingProxyType({})
    diameters: Mapping[str, float] = MappingProxyType({})
